"""What a file of doors means for a log as it stands: the events to append, and the messages.

Ids of a file are kept where they are free. A door that is there with the same values is left
alone; with other values it is an error, or with `update` the fields that differ are written. An
id that was removed is an error; with `renumber` the door gets the next free one, with `update` its
removal is retracted. Nothing is ever removed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePath

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_index import DoorIndex
from semmap_log.core.folds.early_events import added_since
from semmap_log.core.model import doors as door_model
from semmap_log.core.model import events as ev
from semmap_log.core.model.meaning import PLACING, changed
from semmap_log.core.texts import command_line
from semmap_log.errors import CommandError, DoorExistsError, DoorRemovedError
from semmap_log.interop.formats.files.door_table import DoorTable, TableDoor
from semmap_log.log import KnownPast

BYTES_AN_EVENT = 256
"""So many cells of a floor plan, or characters of a text, count as an event of those that are kept
in memory."""


def weight_of(event: ev.Event) -> int:
    """Return as how many events one counts, of those that are kept in memory."""
    if isinstance(event, ev.FloorMap):
        return 1 + event.cells.size // BYTES_AN_EVENT
    return 1 + len(event.value) // BYTES_AN_EVENT if isinstance(event, ev.DoorAnnotated) else 1


@dataclass(frozen=True, slots=True)
class Present:
    """What the log holds before the import."""

    door_map: door_model.DoorMap
    used_ids: frozenset[door_model.DoorId]
    """Every id that was ever given, those of removed doors too."""
    floor_maps: Mapping[int, ev.FloorMap] = field(default_factory=dict)
    """The floor plan of each level that has one."""
    removed: Mapping[door_model.DoorId, door_model.RemovedDoor] = field(default_factory=dict)
    """Doors that were removed, and can come back."""
    next_event: int = 0
    """The number that the log will give next."""
    index: DoorIndex | None = None
    """What commands are checked against; None: against the door map alone."""
    log: PurePath = Path("LOG")
    """Where the log is, for messages."""
    past: KnownPast | None = None
    """What the log still holds of its past; None: all of it."""

    @property
    def greatest_id(self) -> int:
        """The greatest id that was ever given; 0: none was."""
        return max(self.used_ids, default=0)


@dataclass(frozen=True, slots=True)
class ImportPlan:
    """What to append, in one commit, and the messages for the user."""

    events: Iterable[ev.Event | EventBatch]
    """Can be gone through more than once; those of a large file are made during iteration."""
    count: int
    """How many events there are; 0: the log holds all of the file already."""
    summary: tuple[str, ...] = ()
    """What the events do, in words."""
    left_out: tuple[str, ...] = ()
    """What the file holds and the log will not."""
    warnings: tuple[str, ...] = ()
    there: tuple[door_model.DoorId, ...] = ()
    """Doors of the file that the log has already."""
    nothing: str = ""
    """Why nothing of the file can be imported; empty: something can, or the log holds it."""


@dataclass(frozen=True, slots=True)
class Imported:
    """What became of a file."""

    plan: ImportPlan
    first_event: int | None
    """None: nothing was written, since the log holds all of it."""
    known_before: bool = False
    """This very file was imported before."""


def plan_doors(
    table: DoorTable,
    present: Present,
    *,
    update: bool = False,
    renumber: bool = False,
    at_ns: int | None = None,
    since_ns: int | None = None,
) -> ImportPlan:
    """Return how the doors, levels and floor plans of a file come into the log.

    Args:
        table: What was read from the file.
        present: What the log holds.
        update: Write the values that differ from those of doors that are there, and take back the
            removal of doors that were removed.
        renumber: Give doors whose ids were removed new ones.
        at_ns: When it happened; None: when it is recorded.
        since_ns: From when on new doors are there; their states are of `at_ns`. None: from then.

    Raises:
        DoorExistsError: Doors that are there with other values, without `update`.
        DoorRemovedError: Ids that were removed, without `renumber` and `update`.
        CommandError: A name is borne by two doors of a level.
    """
    return _DoorPlanner(
        table, present, update=update, renumber=renumber, at_ns=at_ns, since_ns=since_ns
    ).plan()


class _DoorPlanner:
    """Goes through the file's levels, doors and maps, and collects events and clashes."""

    def __init__(
        self,
        table: DoorTable,
        present: Present,
        *,
        update: bool,
        renumber: bool,
        at_ns: int | None,
        since_ns: int | None,
    ) -> None:
        self.table = table
        self.present = present
        self.update = update
        self.renumber = renumber
        self.at_ns = at_ns
        self.since_ns = at_ns if since_ns is None else since_ns
        self.is_backdated = since_ns is not None
        self.there_already: list[door_model.DoorId] = []
        self.level_of: dict[int, int] = {}
        """The log's number of each of the file's levels."""
        ids = {door.door_id for door in table.doors if door.door_id is not None}
        self.used_ids: set[int] = {*present.used_ids, *ids}
        self.greatest_id = max(self.used_ids, default=0)
        self.added = self.updated = self.same = self.back = 0
        self.said: list[str] = []
        self.existing: list[str] = []
        self.removed: list[str] = []

    def plan(self) -> ImportPlan:
        events = [*self.levels(), *self.doors(), *self.floor_maps()]
        self.check_clashes()
        counts = [
            (self.added, "added"), (self.back, "brought back"), (self.updated, "updated"),
            (self.same, "the same already"),
        ]  # fmt: skip
        doors = ", ".join(f"{count} {what}" for count, what in counts if count) or "none"
        return ImportPlan(
            events,
            count=len(events),
            summary=(f"doors: {doors}", *self.said),
            left_out=self.table.left_out,
            warnings=(*self.table.warnings, *self.suspect()),
            there=tuple(self.there_already),
            nothing="" if self.table.doors or self.table.levels else "expected doors, got none",
        )

    def suspect(self) -> Iterator[str]:
        """Yield what looks like another unit."""
        for door in self.table.doors:
            for what in door_model.suspect_units(theta=door.theta, width=door.width):
                yield f"{self.where(door)}: {what}"

    def levels(self) -> Iterator[ev.Event]:
        known = {
            level.name: number
            for number, level in self.present.door_map.levels.items()
            if level.name
        }
        next_number = max(self.present.door_map.levels, default=0) + 1
        for level in self.table.levels:
            name = level.name or str(level.level)
            if name in known:
                self.level_of[level.level] = known[name]
                continue
            self.level_of[level.level] = next_number
            self.said.append(f"level {name}: new, as number {next_number}")
            yield ev.LevelAdded(
                happened_ns=self.since_ns, level=next_number, name=name, elevation=level.elevation
            )
            next_number += 1

    def floor_maps(self) -> Iterator[ev.Event]:
        for found in self.table.floor_maps:
            level = self.level_of.get(found.level, found.level)
            there = self.present.floor_maps.get(level)
            since_ns = self.since_ns if there is None else self.at_ns
            wanted = replace(found, level=level, happened_ns=since_ns)
            if there is None or replace(there, happened_ns=since_ns) != wanted:
                height, width = wanted.cells.shape
                self.said.append(f"floor plan of level {level}: {width} x {height} cells")
                yield wanted

    def doors(self) -> Iterator[ev.Event]:
        for door in self.table.doors:
            there = self.there(door)
            if there is not None:
                self.there_already.append(there.door_id)
                yield from self.known_door(door, there)
            elif (removed := self.removed_door(door)) is not None:
                yield from self.door_back(door, removed)
            else:
                door_id = self.new_id(door)
                self.added += 1
                yield from self.new_door(door, door_id)

    def there(self, door: TableDoor) -> door_model.Door | None:
        """Return the log's door that the file's means: by id, else by level and name.

        Raises:
            CommandError: Several are called so, or what is there is no door.
        """
        found = self.called_so(door)
        if found is not None and not found.object_class.is_door:
            raise CommandError(
                f"{self.where(door)}: {found.label}, number {found.door_id}, is a "
                f"{found.object_class.name} in the log, and no door; give the file's door another "
                "number or name. Nothing was imported."
            )
        return found

    def called_so(self, door: TableDoor) -> door_model.Door | None:
        """Return what the log has under the id of a file's door, else its level and name.

        A door without both is the one without a name that lies just there.
        """
        doors = self.present.door_map.doors
        if door.door_id is not None:
            return doors.get(door.door_id)
        level, name = self.level_of.get(door.level, door.level), door.annotations.get("name")
        if name is None:
            there = (each for each in doors.values() if each.level == level and not each.name)
            return next((each for each in there if _is_at(door, each)), None)
        found = [other for other in doors.values() if (other.level, other.name) == (level, name)]
        if len(found) > 1:
            line = command_line(
                "annotate", self.present.log, str(found[-1].door_id), "name", "NEW_NAME"
            )
            raise CommandError(
                f"{self.where(door)}: the log has {len(found)} doors called {name!r} "
                f"on that level; rename all but one, such as the last: {line}"
            )
        return found[0] if found else None

    def removed_door(self, door: TableDoor) -> door_model.RemovedDoor | None:
        """Return the log's door that is to come back under its id; None: there is none."""
        if door.door_id is None or not self.update or self.renumber:
            return None
        return self.present.removed.get(door.door_id)

    def door_back(self, door: TableDoor, removed: door_model.RemovedDoor) -> Iterator[ev.Event]:
        """Take the door's removal back, and write what differs from what it was then."""
        self.back += 1
        self.said.append(f"door {door.door_id}: its removal, event {removed.event}, is taken back")
        yield ev.Retracted(
            happened_ns=self.at_ns, first_event=removed.event, last_event=removed.event
        )
        names = {name for name, _, _ in differences(door, removed.door)}
        yield from self.update_of(door, removed.door, names)

    def new_id(self, door: TableDoor) -> door_model.DoorId:
        if door.door_id is not None and door.door_id not in self.present.used_ids:
            return door.door_id
        if door.door_id is not None:
            known = self.present.removed.get(door.door_id)
            how = (
                "was taken back with its adding"
                if known is None
                else (f"was removed, by event {known.event}")
            )
            self.removed.append(f"{self.where(door)}: door {door.door_id} {how}")
        new = door_model.next_door_id(self.used_ids, self.greatest_id)
        self.used_ids.add(new)
        self.greatest_id = max(self.greatest_id, new)
        if door.door_id is not None:
            self.said.append(f"door {door.door_id} of the file is door {new} in the log")
        return new

    def new_door(self, door: TableDoor, door_id: door_model.DoorId) -> Iterator[ev.Event]:
        added = ev.DoorAdded(
            happened_ns=self.at_ns,
            door_id=door_id,
            level=self.level_of.get(door.level, door.level),
            x=door.x,
            y=door.y,
            theta=door.theta,
            width=door.width,
            state=door.state or door_model.DoorState.UNKNOWN,
            prob_open=door.prob_open,
            prob_closed=door.prob_closed,
        )
        yield from added_since(added, self.since_ns) if self.is_backdated else [added]
        for key, value in door.annotations.items():
            yield ev.DoorAnnotated(happened_ns=self.since_ns, door_id=door_id, key=key, value=value)

    def known_door(self, door: TableDoor, there: door_model.Door) -> Iterator[ev.Event]:
        found = list(differences(door, there))
        if not found:
            self.same += 1
            return
        self.updated += 1
        said = ", ".join(f"{name} {old} there, {new} in the file" for name, old, new in found)
        self.existing.append(
            f"{self.where(door)}: door {there.door_id} is there with other values: {said}"
        )
        yield from self.update_of(door, there, {name for name, _, _ in found})

    def update_of(
        self, door: TableDoor, there: door_model.Door, names: set[str]
    ) -> Iterator[ev.Event]:
        sets = changed(names - door.annotations.keys())
        if not there.is_placed and sets & PLACING:
            sets |= PLACING
        if sets:
            yield ev.DoorUpdated(
                happened_ns=self.at_ns,
                door_id=there.door_id,
                changed=sets,
                level=there.level,
                x=door.x,
                y=door.y,
                theta=door.theta,
                width=door.width,
                state=door.state or door_model.DoorState.UNKNOWN,
                prob_open=door.prob_open,
                prob_closed=door.prob_closed,
            )
        for key in sorted(names & door.annotations.keys()):
            yield ev.DoorAnnotated(
                happened_ns=self.at_ns, door_id=there.door_id, key=key, value=door.annotations[key]
            )

    def check_clashes(self) -> None:
        if self.existing and not self.update:
            raise DoorExistsError(_listed(self.existing, "write the file's values with --update"))
        if self.removed and not self.renumber:
            remedy = "give such doors new ids with --renumber"
            if not self.update:
                remedy = f"bring doors that were removed back with --update, or {remedy}"
            raise DoorRemovedError(_listed(self.removed, remedy))

    def where(self, door: TableDoor) -> str:
        return f"{self.table.path}:{door.line}"


def differences(door: TableDoor, there: door_model.Door) -> Iterator[tuple[str, object, object]]:
    """Yield (name, value there, value in the file) of each value that the file gives otherwise."""
    for name in ("x", "y", "theta", "width", "prob_open", "prob_closed"):
        old, new = getattr(there, name), getattr(door, name)
        if old != new and not math.isnan(new):
            yield name, old, new
    # The thesis's file cannot say MOVING or OFFLINE: there its UNKNOWN means the same.
    if door.state is not None and door.state != door_model.reduced(there.state):
        yield "state", there.state.name, door.state.name
    for key, value in door.annotations.items():
        if there.annotations.get(key) != value:
            yield key, repr(there.annotations.get(key, "")), repr(value)


def _is_at(door: TableDoor, there: door_model.Door) -> bool:
    """Return whether a file's door lies just where one of the log does."""
    return all(getattr(door, name) == getattr(there, name) for name in ("x", "y", "theta", "width"))


def _listed(clashes: list[str], remedy: str) -> str:
    shown = clashes[:MOST_CLASHES_SHOWN]
    if len(clashes) > len(shown):
        shown.append(f"… and {len(clashes) - len(shown)} more")
    return "\n".join(shown) + f"\nNothing was imported; {remedy}."


MOST_CLASHES_SHOWN = 10
