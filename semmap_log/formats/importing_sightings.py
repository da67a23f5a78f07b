"""What a door CSV means for a log as it stands: rows as events of the doors that they name."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from semmap_log.doors import MAX_DOOR_ID, DoorId
from semmap_log.errors import CommandError, UnknownDoorError
from semmap_log.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorEvent,
    DoorObserved,
    DoorUpdated,
)
from semmap_log.formats.door_csv import Sighting, Sightings
from semmap_log.formats.importing import ImportPlan, Present


def plan_sightings(
    sightings: Sightings, present: Present, *, level: int | None = None
) -> ImportPlan:
    """Return how the rows of a door CSV come into the log.

    A name means the one door that bears it, else `level name/name`, else the id of a door without
    a name; else it is a new, unplaced door, added when its first row happened.

    Args:
        sightings: What was read from the file.
        present: What the log holds.
        level: Only doors of that level are meant, and new ones are added there; None: of any
            level, and new ones have level 0.

    Raises:
        UnknownDoorError: A name that several doors bear.
        CommandError: Ids have run out.
    """
    known = _names(present, level)
    ids: list[DoorId] = []
    new: list[bool] = []
    next_id = present.next_id
    for name in sightings.doors:
        found = known.get(name, [])
        if len(found) > 1:
            raise UnknownDoorError(
                f"{sightings.path}: {name!r} is the name of {len(found)} doors "
                f"({', '.join(map(str, found))}); say which level is meant."
            )
        new.append(not found)
        ids.append(found[0] if found else next_id)
        next_id = next_id if found else DoorId(next_id + 1)
    if next_id > MAX_DOOR_ID + 1:
        raise CommandError(f"{sightings.path}: no id is free any more (at most {MAX_DOOR_ID}).")
    events = _SightingEvents(sightings, tuple(ids), tuple(new), level or 0)
    added = sum(new)
    extra = len(sightings) - sightings.rows_in_file
    return ImportPlan(
        events,
        count=len(sightings) + 2 * added,
        summary=(
            f"doors: {len(ids)}, of which {added} new, without a place yet",
            f"rows: {sightings.rows_in_file:,}"
            + (f", and {extra:,} states at the ends and starts of windows" if extra else ""),
        ),
        warnings=sightings.warnings,
    )


@dataclass(frozen=True, slots=True)
class _SightingEvents:
    """The events of a file's rows, made one by one, as often as they are asked for."""

    sightings: Sightings
    ids: tuple[DoorId, ...]
    new: tuple[bool, ...]
    level: int

    def __iter__(self) -> Iterator[DoorEvent]:
        id_of = dict(zip(self.sightings.doors, self.ids, strict=True))
        to_add = {name for name, new in zip(self.sightings.doors, self.new, strict=True) if new}
        for row in self.sightings:
            if row.door in to_add:
                to_add.remove(row.door)
                yield from self._adding(row, id_of[row.door])
            yield _event_of(row, id_of[row.door])

    def _adding(self, row: Sighting, door_id: DoorId) -> Iterator[DoorEvent]:
        yield DoorAdded(happened_ns=row.happened_ns, door_id=door_id, level=self.level)
        yield DoorAnnotated(
            happened_ns=row.happened_ns, door_id=door_id, key="name", value=row.door
        )


def _event_of(row: Sighting, door_id: DoorId) -> DoorEvent:
    if math.isnan(row.accuracy):
        return DoorUpdated(
            happened_ns=row.happened_ns, door_id=door_id, changed=Changed.STATE, state=row.state
        )
    return DoorObserved(
        happened_ns=row.happened_ns,
        door_id=door_id,
        state=row.state,
        accuracy_open=row.accuracy,
        accuracy_closed=row.accuracy,
    )


def _names(present: Present, level: int | None) -> dict[str, list[DoorId]]:
    """Return what a file may call each door: its name before level/name, before its id."""
    door_map = present.door_map
    doors = [door for door in door_map.doors.values() if level in (None, door.level)]
    by_name: dict[str, list[DoorId]] = {}
    by_level: dict[str, list[DoorId]] = {}
    for door in doors:
        if door.name:
            by_name.setdefault(door.name, []).append(door.door_id)
            by_level.setdefault(f"{door_map.level_name(door.level)}/{door.name}", []).append(
                door.door_id
            )
    by_id = {str(door.door_id): [door.door_id] for door in doors if not door.name}
    return by_id | by_level | by_name
