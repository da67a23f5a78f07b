"""What is different between two door maps, door by door and field by field: enough to go over."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from types import MappingProxyType
from typing import Any

from semmap_log.core.folds.history import HistoryEntry
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.model import meaning
from semmap_log.core.model.doors import Door, DoorId, DoorMap, DoorState, Level
from semmap_log.core.model.shown_as_table import ShownAsTable
from semmap_log.core.texts import counted
from semmap_log.errors import CommandError

FIELDS = (*meaning.FIELDS, "annotations", "object_class")
"""The fields that make a door what it is: if one differs, the door was changed."""

STAMPS = ("last_seen_ns", "last_event")
"""What tells that something was heard of a door, though it may be the same as before."""


@dataclass(frozen=True, slots=True)
class FieldChange:
    """One field of a door that is in both maps."""

    door: Door
    """As it is in the later map."""
    field: str
    before: Any
    after: Any


@dataclass(frozen=True, slots=True)
class LevelChange:
    """A level that came, went, or is another now; None: it is not there."""

    number: int
    before: Level | None
    after: Level | None


@dataclass(frozen=True, slots=True, repr=False)
class Diff(ShownAsTable):
    """What leads from one door map to another."""

    before: DoorMap
    after: DoorMap
    added: Sequence[Door]
    removed: Sequence[Door]
    changed: Sequence[FieldChange]
    """Of the doors in both maps, by `FIELDS`."""
    heard: Sequence[FieldChange]
    """Of the same, by `STAMPS`."""
    levels: Sequence[LevelChange]
    events: Sequence[HistoryEntry]
    """Those with happened time behind the first moment, up to and with the second."""

    def __repr__(self) -> str:
        changed = len({change.door.door_id for change in self.changed})
        doors = f"{len(self.added)} added, {len(self.removed)} removed, {changed} changed"
        return f"<Diff of doors: {doors}; {counted(len(self.events), 'event')}>"

    def __bool__(self) -> bool:
        """Tell whether a door is another than before; that it was seen again does not count."""
        return bool(self.added or self.removed or self.changed)

    def applied_to(self, before: DoorMap) -> DoorMap:
        """Return the later map, made of the earlier one and what is different: equal in all fields.

        Args:
            before: The earlier map, from wherever.

        Raises:
            CommandError: It is another: a door, a level or a value is not as it was then.
        """
        doors = dict(before.doors)
        for door in self.removed:
            _check(doors.pop(door.door_id, None), door, f"door {door.door_id}")
        for door in self.added:
            _check(doors.get(door.door_id), None, f"door {door.door_id}")
            doors[door.door_id] = door
        for change in (*self.changed, *self.heard):
            door_id = change.door.door_id
            if door_id not in doors:
                _check(None, "a door", f"door {door_id}")
            _check(getattr(doors[door_id], change.field), change.before,
                   f"{change.field} of door {door_id}")  # fmt: skip
            doors[door_id] = replace(doors[door_id], **{change.field: change.after})
        levels = dict(before.levels)
        for level in self.levels:
            _check(levels.pop(level.number, None), level.before, f"level {level.number}")
            if level.after is not None:
                levels[level.number] = level.after
        return replace(
            self.after,  # the moment that it is of: its event, its times
            doors=MappingProxyType(dict(sorted(doors.items()))),
            levels=MappingProxyType(dict(sorted(levels.items()))),
        )


def diff(before: DoorMap, after: DoorMap, events: Sequence[HistoryEntry] = ()) -> Diff:
    """Return the difference; doors ascending, fields in the order of `FIELDS` and `STAMPS`."""
    numbers = sorted({*before.levels, *after.levels})
    levels = (LevelChange(n, before.levels.get(n), after.levels.get(n)) for n in numbers)
    return Diff(
        before=before,
        after=after,
        added=_doors_only_in(after.doors, before.doors),
        removed=_doors_only_in(before.doors, after.doors),
        changed=list(_changes(before, after, FIELDS)),
        heard=list(_changes(before, after, STAMPS)),
        levels=[level for level in levels if not _is_same(level.before, level.after)],
        events=events,
    )


def _doors_only_in(doors: Mapping[DoorId, Door], others: Mapping[DoorId, Door]) -> Sequence[Door]:
    return [door for door_id, door in doors.items() if door_id not in others]


def _changes(before: DoorMap, after: DoorMap, names: Sequence[str]) -> Iterator[FieldChange]:
    """Yield the fields of these names in which doors that are in both maps differ."""
    for door_id, door in after.doors.items():
        known = before.doors.get(door_id)
        for field in names if known is not None else ():
            old, new = getattr(known, field), getattr(door, field)
            if not _is_same(old, new):
                yield FieldChange(door, field, old, new)


def _check(actual: Any, expected: Any, what: str) -> None:
    """Return if a map that a diff is applied to is as the diff knows it.

    Raises:
        CommandError: It is not.
    """
    if not _is_same(actual, expected):
        raise CommandError(
            f"{what}: expected {_said(expected)} before the change, got {_said(actual)}; "
            "this is not the map that the diff is from."
        )


def _said(value: Any) -> str:
    if isinstance(value, DoorState):
        return value.name
    return "none" if value is None else str(value)


def _is_same(one: Any, other: Any) -> bool:
    """Tell whether two values are equal, NaN being equal to NaN."""
    if isinstance(one, float) and isinstance(other, float):
        return one == other or (math.isnan(one) and math.isnan(other))
    if isinstance(one, (Door, Level)) and type(one) is type(other):
        return all(_is_same(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    return bool(one == other)
