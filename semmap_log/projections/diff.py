"""What is different between two door maps, door by door and field by field."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from semmap_log.doors import Door, DoorMap
from semmap_log.projections.history import HistoryEntry

FIELDS = ("level", "x", "y", "theta", "width", "state", "prob_open", "prob_closed", "annotations")
"""The fields of a door that a diff compares."""


@dataclass(frozen=True, slots=True)
class FieldChange:
    """One field of a door that is in both maps."""

    door: Door
    """As it is in the later map."""
    field: str
    before: Any
    after: Any


@dataclass(frozen=True, slots=True)
class Diff:
    """What leads from one door map to another."""

    before: DoorMap
    after: DoorMap
    added: Sequence[Door]
    removed: Sequence[Door]
    changed: Sequence[FieldChange]
    events: Sequence[HistoryEntry]
    """Those with happened time behind the first moment, up to and with the second."""

    def __bool__(self) -> bool:
        return bool(self.added or self.removed or self.changed)


def diff(before: DoorMap, after: DoorMap, events: Sequence[HistoryEntry] = ()) -> Diff:
    """Return the difference; doors ascending, fields in the order of `FIELDS`."""
    changed = [
        FieldChange(door, field, old, new)
        for door_id, door in after.doors.items()
        if door_id in before.doors
        for field in FIELDS
        if not _same(old := getattr(before.doors[door_id], field), new := getattr(door, field))
    ]
    return Diff(
        before=before,
        after=after,
        added=[door for door_id, door in after.doors.items() if door_id not in before.doors],
        removed=[door for door_id, door in before.doors.items() if door_id not in after.doors],
        changed=changed,
        events=events,
    )


def _same(old: Any, new: Any) -> bool:
    both_nan = isinstance(old, float) and math.isnan(old) and math.isnan(new)
    return both_nan or bool(old == new)
