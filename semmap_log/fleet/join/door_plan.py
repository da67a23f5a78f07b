"""Which doors and levels of the logs are one in the building, and what they are called there.

Levels match by their names, else by their numbers.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.doors import NAN, Door, DoorId, DoorState, ObjectClass
from semmap_log.core.model.events import DoorAdded, DoorRemoved, FloorMap
from semmap_log.errors import FormatError, SemmapError
from semmap_log.fleet.join.joined_logs import DoorRow, JoinedLog, JoinedLogs, log_called
from semmap_log.log import DoorLog, Window, kinds_mask

Stamp = tuple[int, int, str, int]
"""The order in which events count: when it happened, but never after recording; when its commit
was recorded; the log's id; its number there."""


@dataclass(frozen=True, slots=True)
class LogDoor:
    """A door of one of the logs, as it is at the log's end."""

    log: str
    door_id: int
    door: Door
    is_present: bool


@dataclass(frozen=True, slots=True)
class BuildingDoor:
    """A door of the building, and what the logs call it."""

    door_id: int
    name: str
    doors: tuple[LogDoor, ...]

    @property
    def is_shared(self) -> bool:
        """True if several logs contain it."""
        return len({each.log for each in self.doors}) > 1


@dataclass(frozen=True, slots=True)
class DoorPlan:
    """What becomes of the doors and levels of each log."""

    doors: tuple[BuildingDoor, ...]
    """By their numbers in the building."""
    ids: Mapping[str, tuple[NDArray[np.int64], NDArray[np.int64]]]
    """Log -> its door ids, ascending, and those in the building."""
    adding: frozenset[tuple[str, int]]
    """(log, event): the additions that stay such; others of a building's door become updates."""
    removing: frozenset[tuple[str, int]]
    """(log, event): the removals that count: the first after the last addition."""
    levels: LevelPlan
    is_alone: bool
    """One log alone stays as it is."""
    names: Mapping[int, str] = field(default_factory=dict)
    """Building door -> name."""
    classes: Mapping[tuple[str, str], str] = field(default_factory=dict)
    """(log, class) -> its name in the building, if it differs."""

    @property
    def unmatched(self) -> list[BuildingDoor]:
        """The doors that only one log contains."""
        return [door for door in self.doors if not door.is_shared]


def plan_doors(joined: JoinedLogs) -> DoorPlan:
    """Return which doors are one: those of the table, then those of one level and name.

    Raises:
        FormatError: The table names a log or a door that is not there, or a door twice.
    """
    is_alone = len(joined.logs) == 1 and not joined.definition.doors
    states = {log.name: log.opened.state_in() for log in joined.logs}
    levels = level_plan(joined, states)
    known = {log.name: _doors_of(log.name, states[log.name]) for log in joined.logs}
    told = _told(joined, known)
    classes = _classes(states)
    groups = _groups(joined, known, told, levels, classes)
    comings = {log.name: list(_comings(log)) for log in joined.logs}
    doors = _numbered(joined, groups, comings, is_alone=is_alone)
    adding, removing = _counting(doors, comings)
    return DoorPlan(
        doors,
        {log.name: _ids(log.name, doors) for log in joined.logs},
        adding,
        removing,
        levels,
        is_alone,
        {door.door_id: door.name for door in doors},
        classes,
    )


def _classes(states: Mapping[str, DoorMapState]) -> dict[tuple[str, str], str]:
    """Return new names for classes that have the same name, but differ, between logs."""
    said: dict[str, dict[str, ObjectClass]] = defaultdict(dict)
    for log, state in states.items():
        for name, one in state.classes().items():
            said[name][log] = one
    return {
        (log, name): f"{log.replace(',', '.').replace('/', '.')}.{name}"
        for name, by_log in said.items()
        if len({*by_log.values()}) > 1
        for log in by_log
    }


def _doors_of(log: str, state: DoorMapState) -> dict[int, LogDoor]:
    found = {}
    for door_id in sorted(state.used_door_ids):
        door, removed = state.door(door_id), state.removed_door(door_id)
        value = door or (removed.door if removed else _retracted(door_id, state))
        found[door_id] = LogDoor(log, door_id, value, door is not None)
    return found


def _retracted(door_id: int, state: DoorMapState) -> Door:
    """Return what is left of a door whose addition was retracted."""
    level, unknown = state.level_of(door_id), DoorState.UNKNOWN
    return Door(DoorId(door_id), level, NAN, NAN, NAN, NAN, unknown, NAN, NAN)


def _told(
    joined: JoinedLogs, known: Mapping[str, Mapping[int, LogDoor]]
) -> dict[tuple[str, int], str]:
    """Return the doors of the table, and the building's door that each is."""
    lines: dict[tuple[str, int], DoorRow] = {}
    told: dict[tuple[str, int], str] = {}
    for row in joined.definition.doors:
        try:
            log = log_called(row.log, joined.logs)
            door_id = int(log.opened.resolve_any_door(row.door))
        except FormatError:
            raise
        except SemmapError as error:
            raise _wrong(joined, row, str(error)) from None
        key = log.name, door_id
        if key in told and (told[key] != row.building_door or not _same(lines[key], row)):
            before = f" (line {lines[key].line})" if lines[key].line else ""
            raise _wrong(joined, row, f"door {row.door!r} of {log.name} stands twice{before}")
        told[key], lines[key] = row.building_door, row
    _check_one_each(joined, known, told, lines)
    return told


def _same(first: DoorRow, second: DoorRow) -> bool:
    """Return whether a row is repeated by another join, not within one table."""
    return first.line == second.line == 0


def _check_one_each(
    joined: JoinedLogs,
    known: Mapping[str, Mapping[int, LogDoor]],
    told: Mapping[tuple[str, int], str],
    lines: Mapping[tuple[str, int], DoorRow],
) -> None:
    first: dict[tuple[str, str], int] = {}
    for (log, door_id), name in told.items():
        if not known[log][door_id].is_present:
            continue
        other = first.setdefault((log, name), door_id)
        if other != door_id:
            problem = f"doors {other} and {door_id} of {log} cannot both be {name!r}"
            raise _wrong(joined, lines[log, door_id], problem)


def _wrong(joined: JoinedLogs, row: DoorRow, problem: str) -> FormatError:
    where = joined.definition.doors_from or "the table of doors"
    return FormatError(where, [(row.line, problem)] if row.line else problem)


Group = tuple[str, tuple[LogDoor, ...]]


def _groups(
    joined: JoinedLogs,
    known: Mapping[str, Mapping[int, LogDoor]],
    told: Mapping[tuple[str, int], str],
    levels: LevelPlan,
    classes: Mapping[tuple[str, str], str],
) -> list[Group]:
    """Return the building's doors: the name, and the logs' doors that are one with it."""
    groups: list[Group] = []
    by_told: dict[str, list[LogDoor]] = defaultdict(list)
    by_name: dict[tuple[int, str, str], list[LogDoor]] = defaultdict(list)
    for log in joined.logs:
        free = {}
        for each in known[log.name].values():
            if (each.log, each.door_id) in told:
                by_told[told[each.log, each.door_id]].append(each)
            else:
                free[each.door_id] = each
        for each in _unique(free, levels):
            level = levels.of(log.name, each.door.level)
            of = each.door.object_class.name  # a dock is no door of its name
            of = classes.get((log.name, of), of)
            by_name[level, of, each.door.name or ""].append(free.pop(each.door_id))
        groups += [(_own_name(each), (each,)) for each in free.values()]
    groups += [(name, tuple(doors)) for name, doors in by_told.items()]
    for (_, _, name), doors in by_name.items():
        groups.append((name if len(doors) > 1 else _own_name(doors[0]), tuple(doors)))
    return groups


def _unique(doors: Mapping[int, LogDoor], levels: LevelPlan) -> list[LogDoor]:
    """Return the doors that alone bear their name on their level; those that are there first."""
    bearers: dict[tuple[int, str], list[LogDoor]] = defaultdict(list)
    for each in doors.values():
        if each.door.name:
            bearers[levels.of(each.log, each.door.level), each.door.name].append(each)
    chosen = []
    for found in bearers.values():
        present = [each for each in found if each.is_present] or found
        chosen += present if len(present) == 1 else []
    return chosen


def _own_name(each: LogDoor) -> str:
    return f"{each.log}/{each.door.name or each.door_id}"


@dataclass(frozen=True, slots=True)
class _Coming:
    door_id: int
    stamp: Stamp
    comes: bool


def _comings(log: JoinedLog) -> Iterator[_Coming]:
    """Yield additions and removals of doors that were not retracted."""
    hidden = log.opened.retractions()
    for batch in log.opened.batches_in(Window(kinds=kinds_mask([DoorAdded, DoorRemoved]))):
        seen = hidden.visible(batch)
        rows = zip(seen, seen.folds_ns.tolist(), seen.door_ids().tolist(), strict=True)
        for recorded, folds_ns, door_id in rows:
            stamp = (folds_ns, log.known_ns(recorded.number), log.log_id, recorded.number)
            yield _Coming(door_id, stamp, isinstance(recorded.event, DoorAdded))


def _numbered(
    joined: JoinedLogs,
    groups: Sequence[Group],
    comings: Mapping[str, Sequence[_Coming]],
    *,
    is_alone: bool,
) -> tuple[BuildingDoor, ...]:
    """Number the doors: those of the reference keep theirs, the others follow in order."""
    reference = joined.reference.name
    came: dict[tuple[str, int], Stamp] = {}
    for log, found in comings.items():
        for coming in found:
            if coming.comes:
                came[log, coming.door_id] = min(
                    came.get((log, coming.door_id), coming.stamp), coming.stamp
                )
    never = (2**63 - 1, 0, "", 0)

    def order(group: Group) -> tuple[Stamp, list[tuple[str, int]]]:
        keys = [(each.log, each.door_id) for each in group[1]]
        return min(came.get(key, never) for key in keys), sorted(keys)

    taken = {d.door_id for _, doors in groups for d in doors if d.log == reference}
    following = max(taken, default=0) + 1
    numbered = []
    for name, doors in sorted(groups, key=order):
        own = [each.door_id for each in doors if each.log == reference]
        if own:
            number = min(own)
        else:
            number, following = following, following + 1
        called = (doors[0].door.name or "") if is_alone else name
        numbered.append(BuildingDoor(number, called, doors))
    return tuple(sorted(numbered, key=lambda door: door.door_id))


def _counting(
    doors: Sequence[BuildingDoor], comings: Mapping[str, Sequence[_Coming]]
) -> tuple[frozenset[tuple[str, int]], frozenset[tuple[str, int]]]:
    """Return which additions and removals count: at most one of each for a door."""
    by_door: dict[tuple[str, int], list[_Coming]] = defaultdict(list)
    for log, found in comings.items():
        for coming in found:
            by_door[log, coming.door_id].append(coming)
    adding, removing = set(), set()
    for door in doors:
        mine = [(c.stamp, c.comes, each.log) for each in door.doors
                for c in by_door[each.log, each.door_id]]  # fmt: skip
        came = [(stamp, log) for stamp, comes, log in mine if comes]
        if not came:
            continue
        adding.add((min(came)[1], min(came)[0][3]))
        last = max(came)[0]
        gone = [(stamp, log) for stamp, comes, log in mine if not comes and stamp > last]
        if gone:
            removing.add((min(gone)[1], min(gone)[0][3]))
    return frozenset(adding), frozenset(removing)


def _ids(log: str, doors: Sequence[BuildingDoor]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    pairs = sorted((e.door_id, d.door_id) for d in doors for e in d.doors if e.log == log)
    columns = np.array(pairs, np.int64).reshape(-1, 2)
    return columns[:, 0].copy(), columns[:, 1].copy()


@dataclass(frozen=True, slots=True)
class LevelPlan:
    """What the levels of each log are in the building."""

    numbers: Mapping[tuple[str, int], int]
    """(log, level) -> level of the building."""
    told_by: Mapping[int, str]
    """Level of the building -> the log whose name and height of it count."""
    drawn_by: Mapping[int, str]
    """Level of the building -> the log whose floor map counts."""

    def of(self, log: str, level: int) -> int:
        """Return a log's level as one of the building."""
        return self.numbers.get((log, level), level)


def level_plan(joined: JoinedLogs, states: Mapping[str, DoorMapState]) -> LevelPlan:
    """Return which levels are one: the reference keeps its numbers, and its floor maps count."""
    others = [log for log in joined.logs if log is not joined.reference]
    names: dict[int, str | None] = {}
    numbers: dict[tuple[str, int], int] = {}
    told_by: dict[int, str] = {}
    drawn_by: dict[int, str] = {}
    for log in (joined.reference, *others):
        known = states[log.name].door_map().levels
        own = {0: None} | {number: level.name for number, level in known.items()}
        own |= {d.level: own.get(d.level) for d in states[log.name].door_map().doors.values()}
        for number, name in sorted(own.items()):
            level = _level_of(number, name, names)
            numbers[log.name, number] = level
            names[level] = names.get(level) or name
            if number in known and known[number].name:
                told_by.setdefault(level, log.name)
        if log.frame is not None:
            for number in _drawn(log.opened):
                drawn_by.setdefault(numbers.get((log.name, number), number), log.name)
    return LevelPlan(numbers, told_by, drawn_by)


def _drawn(log: DoorLog) -> set[int]:
    """Return the levels of which a log has a floor map."""
    hidden = log.retractions()
    batches = map(hidden.visible, log.batches_in(Window(kinds=kinds_mask([FloorMap]))))
    events = (event for batch in batches for event in batch.to_events())
    return {event.level for event in events if isinstance(event, FloorMap)}


def _level_of(number: int, name: str | None, names: Mapping[int, str | None]) -> int:
    """Return the building's level for a log's: that of the name, else of the number, else new."""
    if name:
        for level, known in names.items():
            if known == name:
                return level
    if number not in names or not name or not names[number]:
        return number
    return max(*names, number) + 1
