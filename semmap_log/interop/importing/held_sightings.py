"""What a door CSV means for a log as it stands: rows as events of the doors that they name.

Sightings that the log has already are left out, so that exports that overlap do not count twice.
Two are the same if they report the same state of the same door, at the same nanosecond, with the
same accuracy. Files of two sensors are kept apart by their sources: if a source is given, only the
log's sightings of that source are compared.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.levels import resolve_level
from semmap_log.core.model import events as ev
from semmap_log.core.model.doors import Door, DoorId, DoorMap, next_door_id
from semmap_log.core.model.meaning import Changed
from semmap_log.core.texts import counted
from semmap_log.errors import UnknownDoorError, UnknownLevelError
from semmap_log.interop.formats.files.csv_sightings import Rows, Sightings, accuracies_of
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.interop.importing.import_plan import ImportPlan, Present
from semmap_log.log import DoorLog, Window, kinds_mask


def plan_sightings(
    sightings: Sightings, present: Present, *, held: HeldSightings | None = None,
    level: int | None = None, renumber: bool = False, new_doors: bool = False,
    hints_at_accuracy: bool = False,
) -> ImportPlan:  # fmt: skip
    """Return how the rows of a door CSV come into the log.

    A name means the one door that bears it, else `level name/name`, else the id of a door without
    a name, else a door that was removed and bore it; else it is a new, unplaced door, added when
    its first row happened. Rows that the log holds by another file are left out.

    Args:
        sightings: What was read from the file.
        present: What the log holds.
        held: Finds rows that the log holds; None: nothing is looked for.
        level: Names without a level mean doors of that one, and new ones are added there; None: of
            any level, and new ones are on the default level.
        renumber: A name that a removed door bore is that of a new one.
        new_doors: Names of no door are those of new ones, also where the log has doors.
        hints_at_accuracy: Say how long states hold if no row has an accuracy.

    Raises:
        UnknownDoorError: A name that several doors bear, or a level that has no door of the name;
            or names of no door, in a log that has doors, without `new_doors`.
        UnknownLevelError: Doors are new, there are several levels, and no level is given.
    """
    known = _names(present.door_map.doors.values(), present.door_map, level)
    if not renumber:
        removed = [removed.door for removed in present.removed.values()]
        known = _names(removed, present.door_map, level) | known
    ids: list[DoorId] = []
    new: list[bool] = []
    used_ids, greatest_id = {*present.used_ids}, present.greatest_id
    for name in sightings.doors:
        found = known.get(name, [])
        if len(found) > 1:
            raise UnknownDoorError(
                f"{sightings.path}: {name!r} is the name of {len(found)} doors "
                f"({', '.join(map(str, found))}); say which level is meant."
            )
        if not found:
            _check_no_level(sightings, name, present.door_map)
        new.append(not found)
        ids.append(found[0] if found else next_door_id(used_ids, greatest_id))
        used_ids.add(ids[-1])
        greatest_id = max(greatest_id, ids[-1])
    added = [name for name, is_new in zip(sightings.doors, new, strict=True) if is_new]
    if added and not new_doors:
        _check_known_doors(sightings, added, present)
    if level is None:
        level = _level_of_new(sightings, new, present.door_map) if any(new) else 0
    events = _SightingEvents(sightings, tuple(ids), tuple(new), level, [])
    if held is not None and not all(new):
        events.leave_out(held)
    known_rows = 0 if held is None else held.count
    extra = len(sightings) - sightings.rows_in_file
    return ImportPlan(
        events,
        count=len(sightings) - known_rows + 2 * len(added),
        summary=(
            f"doors: {len(ids)}, "
            + (
                f"of which {len(added)} new, without a place yet: {_few(added)}"
                if added
                else "none of them new"
            ),
            f"rows: {sightings.rows_in_file:,}"
            + (
                f", and {counted(extra, 'state')} at the ends and starts of windows"
                if extra
                else ""
            )
            + (f"; in the log already, by another file: {known_rows:,}" if known_rows else ""),
            *([_UNTIL_THE_NEXT] if hints_at_accuracy and _has_no_accuracy(sightings) else []),
        ),
        warnings=sightings.warnings,
        left_out=sightings.left_out,
        nothing="" if len(sightings) else _why_nothing(sightings),
    )


_UNTIL_THE_NEXT = (
    "no row has an accuracy, so each state holds until the door's next row; if these are a robot's "
    "sightings: --accuracy 0.9, into a new log"
)


def _has_no_accuracy(sightings: Sightings) -> bool:
    return all(np.isnan(accuracies_of(rows)).all() for rows in sightings.columns.parts())


def _why_nothing(sightings: Sightings) -> str:
    told = "; ".join(sightings.left_out)
    return f"no row is read; {told}" if told else "expected rows after the header, got none"


def _level_of_new(sightings: Sightings, new: list[bool], door_map: DoorMap) -> int:
    try:
        return resolve_level(None, door_map)
    except UnknownLevelError as error:
        names = [name for name, is_new in zip(sightings.doors, new, strict=True) if is_new]
        raise UnknownLevelError(
            f"{sightings.path}: no door is called {_few(names)}, so they would be new; {error}"
        ) from None


def _check_known_doors(sightings: Sightings, names: Sequence[str], present: Present) -> None:
    """Return unless the log has doors: then a name of none of them may be mistyped.

    Raises:
        UnknownDoorError: It has.
    """
    doors = [door for door in present.door_map.doors.values() if door.object_class.is_door]
    if not doors:
        return
    called = [door.name for door in doors if door.name]
    close = get_close_matches(names[0], called, n=1)
    meant = f" (did you mean {shown(close[0])}?)" if close else ""
    raise UnknownDoorError(
        f"{sightings.path}: no door is called {_few(names)}{meant}; correct the file, or add such "
        "doors, without a place yet: --new-doors. Nothing was imported."
    )


MOST_NAMED = 3
"""So many of the doors that are new are named."""


def _few(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(map(shown, names[:MOST_NAMED])) + more


def _check_no_level(sightings: Sightings, name: str, door_map: DoorMap) -> None:
    """Return unless a name that no door bears begins as `level/name` does: it is mistyped.

    Raises:
        UnknownDoorError: It does.
    """
    level = name.partition("/")[0]
    if level != name and level in {known.name for known in door_map.levels.values()}:
        raise UnknownDoorError(
            f"{sightings.path}: {shown(name)}: level {level} has no door of that name."
        )


@dataclass(frozen=True, slots=True)
class _SightingEvents:
    """The events of a file's rows, as columns, made again at each iteration."""

    sightings: Sightings
    ids: tuple[DoorId, ...]
    new: tuple[bool, ...]
    level: int
    held: list[NDArray[np.uint8]]
    """Which rows of each part the log holds already, as bits; empty: none."""

    def leave_out(self, held: HeldSightings) -> None:
        """Leave out the rows that the log holds."""
        ids = np.array(self.ids, np.uint32)
        found = [held.among(_batch_of(rows, ids)) for rows in self.sightings.columns.parts()]
        if held.count:
            self.held.extend(np.packbits(each) for each in found)

    def _parts(self) -> Iterator[Rows]:
        """Yield the rows that the log does not hold."""
        parts = self.sightings.columns.parts()
        if not self.held:
            yield from parts
            return
        for rows, bits in zip(parts, self.held, strict=True):
            left = np.unpackbits(bits, count=len(rows.door)) == 0
            if left.any():
                accuracy = None if rows.accuracy is None else rows.accuracy[left]
                yield Rows(rows.door[left], rows.happened_ns[left], rows.state[left], accuracy)

    def __iter__(self) -> Iterator[ev.DoorEvent | EventBatch]:
        ids = np.array(self.ids, np.uint32)
        seen = 0
        """So many doors had rows: they are numbered in the order of their first ones."""
        for rows in self._parts():
            batch = _batch_of(rows, ids)
            highest = np.maximum(np.maximum.accumulate(rows.door.astype(np.int64)), seen - 1)
            firsts = np.flatnonzero(np.diff(highest, prepend=seen - 1))
            done = 0
            for first in firsts.tolist():
                door = int(rows.door[first])
                if self.new[door]:
                    before, batch = batch.split(first - done)
                    done = first
                    if len(before):
                        yield before
                    yield from self._adding(door, int(rows.happened_ns[first]))
            if len(batch):
                yield batch
            seen = int(highest[-1]) + 1

    def _adding(self, door: int, happened_ns: int) -> Iterator[ev.DoorEvent]:
        door_id, name = self.ids[door], self.sightings.doors[door]
        yield ev.DoorAdded(happened_ns=happened_ns, door_id=door_id, level=self.level)
        yield ev.DoorAnnotated(happened_ns=happened_ns, door_id=door_id, key="name", value=name)


def _batch_of(rows: Rows, ids: NDArray[np.uint32]) -> EventBatch:
    """Return rows as events: with an accuracy sightings, without one updates of the state."""
    door_ids = ids[rows.door]
    if rows.accuracy is None:
        return EventBatch.of(
            ev.DoorUpdated,
            happened_ns=rows.happened_ns,
            door_id=door_ids,
            changed=Changed.STATE,
            state=rows.state,
        )
    seen = ~np.isnan(rows.accuracy)
    accuracy = rows.accuracy[seen]
    observed = EventBatch.of(
        ev.DoorObserved,
        happened_ns=rows.happened_ns[seen],
        door_id=door_ids[seen],
        state=rows.state[seen],
        accuracy_open=accuracy,
        accuracy_closed=accuracy,
    )
    if seen.all():
        return observed
    updated = EventBatch.of(
        ev.DoorUpdated,
        happened_ns=rows.happened_ns[~seen],
        door_id=door_ids[~seen],
        changed=Changed.STATE,
        state=rows.state[~seen],
    )
    return EventBatch.mixed(
        np.where(seen, ev.DoorObserved.kind, ev.DoorUpdated.kind), observed, updated
    )


def _names(
    doors: Collection[Door], door_map: DoorMap, level: int | None
) -> dict[str, list[DoorId]]:
    """Return what a file may call each door: its name before level/name, before its id."""
    by_name: dict[str, list[DoorId]] = {}
    by_level: dict[str, list[DoorId]] = {}
    for door in doors:
        if door.name:
            if level in (None, door.level):
                by_name.setdefault(door.name, []).append(door.door_id)
            by_level.setdefault(f"{door_map.level_name(door.level)}/{door.name}", []).append(
                door.door_id
            )
    by_id = {str(door.door_id): [door.door_id] for door in doors if not door.name}
    return by_id | by_level | by_name


_KINDS = (ev.DoorObserved, ev.DoorUpdated)
_ROW = np.dtype([("ns", "<i8"), ("door", "<u4"), ("state", "<u4"), ("open", "<f8"),
                 ("closed", "<f8")])  # fmt: skip
_NOT_SEEN = -1.0
"""In the place of an accuracy: the state was set, not seen."""
AT_ONCE = 1000
"""So many single events are compared together."""


class HeldSightings:
    """Finds out which sightings, and updates of a state alone, a log already has."""

    def __init__(self, log: DoorLog, *, source: str = "", before_event: int | None = None) -> None:
        """Look at nothing yet.

        Args:
            log: The log, as it stands.
            source: Compare with those of this source only; empty: with all.
            before_event: Only with events of lower numbers; None: with all.
        """
        self._log = log
        self._source = source
        self._before_event = before_event
        self._span = log.happened_span()
        self._retractions = log.retractions()
        self.count = 0
        """So many were found."""

    def among(self, batch: EventBatch) -> NDArray[np.bool_]:
        """Return which events of a batch the log holds."""
        held = np.zeros(len(batch), np.bool_)
        where, rows = _rows(batch)
        if self._span is None or not len(rows):
            return held
        first, last = int(rows["ns"].min()), int(rows["ns"].max())
        if last < self._span[0] or first > self._span[1]:
            return held
        known = {row for there in self._there(first, last, rows) for row in _texts(there)}
        if known:
            held[where] = [row in known for row in _texts(rows)]
        self.count += int(held.sum())
        return held

    def left(self, events: Iterable[ev.Event]) -> Iterator[ev.Event]:
        """Yield the events that the log does not hold, in their order."""
        waiting: list[ev.Event] = []
        for event in events:
            waiting.append(event)
            if len(waiting) >= AT_ONCE:
                yield from self._left_of(waiting)
                waiting.clear()
        yield from self._left_of(waiting)

    def _left_of(self, events: list[ev.Event]) -> Iterator[ev.Event]:
        places = [i for i, event in enumerate(events) if isinstance(event, _KINDS)]
        held = self.among(EventBatch.from_events(events[i] for i in places))
        gone = {place for place, is_held in zip(places, held.tolist(), strict=True) if is_held}
        return (event for i, event in enumerate(events) if i not in gone)

    def _there(
        self, first_ns: int, last_ns: int, rows: NDArray[np.void]
    ) -> Iterator[NDArray[np.void]]:
        """Yield what the log has of these times."""
        times, kinds = np.unique(rows["ns"]), kinds_mask(_KINDS)
        window = Window(
            happened_from_ns=first_ns, happened_before_ns=last_ns + 1,
            before_event=self._before_event, kinds=kinds, only_kept=True,
        )  # fmt: skip
        for every in self._log.batches_in(window):
            batch = self._retractions.visible(every)
            where, there = _rows(batch)
            chosen = np.isin(there["ns"], times)
            if self._source and chosen.any():
                chosen &= _of_source(batch, self._source)[where]
            yield there[chosen]


def _rows(batch: EventBatch) -> tuple[NDArray[np.intp], NDArray[np.void]]:
    """Return the places of the sightings and updates of a state alone, and what they say."""
    places, found = [np.empty(0, np.intp)], [np.zeros(0, _ROW)]
    for kind in _KINDS:
        where = batch.where(kind)
        if not len(where):
            continue
        told = batch[kind]
        rows = np.zeros(len(where), _ROW)
        rows["ns"] = batch.happened_ns[where]
        rows["door"], rows["state"] = told["door_id"], told["state"]
        good = rows["ns"] >= 0
        if kind is ev.DoorObserved:
            rows["open"], rows["closed"] = told["accuracy_open"], told["accuracy_closed"]
        else:
            rows["open"] = rows["closed"] = _NOT_SEEN
            good &= told["changed"] == Changed.STATE
        places.append(where[good])
        found.append(rows[good])
    return np.concatenate(places), np.concatenate(found)


def _texts(rows: NDArray[np.void]) -> list[bytes]:
    """Return rows as bytes, which can be looked up."""
    data, size = rows.tobytes(), rows.dtype.itemsize
    return [data[at : at + size] for at in range(0, len(data), size)]


def _of_source(batch: EventBatch, source: str) -> NDArray[np.bool_]:
    """Return which sightings and updates of a batch are from a source."""
    found = np.zeros(len(batch), np.bool_)
    for kind in _KINDS:
        which, names = batch.sources(kind)
        named = np.array([name == source for name in names], np.bool_)
        found[batch.where(kind)] = named[which]
    return found
