"""What events do to doors, side by side as one table: pure numpy, nothing of rerun."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.doors import Door, DoorState
from semmap_log.event_batch import EventBatch
from semmap_log.events import (
    ALL_CHANGED,
    Changed,
    DoorAdded,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorUpdated,
    Event,
)

Changes = NDArray[Any]
"""Rows of `CHANGE`."""

CHANGE = np.dtype([
    ("number", "i8"), ("folds_ns", "i8"), ("recorded_ns", "i8"),
    ("kind", "u1"), ("sets", "u1"), ("state", "u1"), ("level", "u2"), ("door_id", "u4"),
    ("x", "f8"), ("y", "f8"), ("theta", "f8"), ("width", "f8"),
    ("prob_open", "f8"), ("prob_closed", "f8"),
])  # fmt: skip
"""An event about a door; `sets` are the bits of `Changed` and `THERE`, the values outside them mean
nothing."""

THERE = 32
"""In `sets`, beside the bits of `Changed`: it brings the door into the map, or takes it out."""
EVERYTHING = int(ALL_CHANGED) | THERE

VALUES = ("level", "x", "y", "theta", "width", "state", "prob_open", "prob_closed")

Stamp = tuple[int, int]
"""(folds_ns, number): the order in which events count."""
ALWAYS: Stamp = (-1, -1)
NEVER: Stamp = (2**63 - 1, 2**63 - 1)

NO_STATE = 255


def changes_of(batch: EventBatch) -> Changes:
    """Return the events of the batch that can change a door, in order of their numbers."""
    parts = [_part(batch, kind, fill) for kind, fill in _FILLS.items() if kind in batch]
    if not parts:
        return np.empty(0, CHANGE)
    changes = np.concatenate(parts)
    return changes[np.argsort(changes["number"])]


@dataclass(frozen=True, slots=True)
class Edge:
    """Where a recording begins or ends, on each of its timelines."""

    folds_ns: int
    number: int
    recorded_ns: int

    def stamp(self, changes: Changes) -> None:
        """Put the rows there."""
        changes["folds_ns"], changes["number"] = self.folds_ns, self.number
        changes["recorded_ns"] = self.recorded_ns


def opening_changes(doors: Iterable[Door], begin: Edge) -> Changes:
    """Return one row a door that sets all of it to what it is: how a recording begins in midst."""
    listed = list(doors)
    opening = np.zeros(len(listed), CHANGE)
    opening["kind"], opening["sets"] = DoorAdded.kind, EVERYTHING
    begin.stamp(opening)
    for name in ("door_id", *VALUES):
        opening[name] = [getattr(door, name) for door in listed]
    return opening


def by_door(changes: Changes) -> Iterator[Changes]:
    """Yield each door's rows, doors ascending, rows in the order they came."""
    if len(changes):
        ordered = changes[np.argsort(changes["door_id"], kind="stable")]
        yield from np.split(ordered, np.flatnonzero(np.diff(ordered["door_id"])) + 1)


def sorted_by_stamp(changes: Changes) -> Changes:
    """Return the rows in the order in which they count."""
    return changes[np.lexsort((changes["number"], changes["folds_ns"]))]


def _part(batch: EventBatch, kind: type[Event], fill: Callable[[Changes, Any], None]) -> Changes:
    where = batch.where(kind)
    part = np.zeros(len(where), CHANGE)
    part["kind"] = kind.kind
    part["number"] = batch.number[where]
    part["folds_ns"] = batch.folds_ns[where]
    part["recorded_ns"] = batch.recorded_ns[where]
    part["door_id"] = batch[kind]["door_id"]
    fill(part, batch[kind])
    return part


def _fill_values(part: Changes, rows: Any) -> None:
    for name in VALUES:
        part[name] = rows[name]


def _fill_added(part: Changes, rows: Any) -> None:
    part["sets"] = EVERYTHING
    _fill_values(part, rows)


def _fill_updated(part: Changes, rows: Any) -> None:
    part["sets"] = rows["changed"]
    _fill_values(part, rows)


def _fill_observed(part: Changes, rows: Any) -> None:
    part["sets"] = int(Changed.STATE)
    part["state"] = rows["state"]


def _fill_passed(part: Changes, rows: Any) -> None:
    part["sets"] = np.where(rows["passed"], int(Changed.STATE), 0)
    part["state"] = int(DoorState.OPEN)


def _fill_removed(part: Changes, _: Any) -> None:
    part["sets"] = THERE


_FILLS: Mapping[type[Event], Callable[[Changes, Any], None]] = {
    DoorAdded: _fill_added,
    DoorUpdated: _fill_updated,
    DoorRemoved: _fill_removed,
    DoorObserved: _fill_observed,
    DoorPassed: _fill_passed,
}


@dataclass(frozen=True, slots=True)
class Life:
    """From when to when a door is in the map, with all that is known."""

    added: Stamp = NEVER
    removed: Stamp = NEVER

    def covers(self, changes: Changes) -> NDArray[np.bool_]:
        """Tell for each row whether the door was there; the adding counts in, the removal out."""
        return ~_is_before(changes, self.added) & _is_before(changes, self.removed)


def _is_before(changes: Changes, stamp: Stamp) -> NDArray[np.bool_]:
    folds_ns, number = stamp
    ties = (changes["folds_ns"] == folds_ns) & (changes["number"] < number)
    earlier: NDArray[np.bool_] = (changes["folds_ns"] < folds_ns) | ties
    return earlier


def strips_of(placements: Changes) -> NDArray[np.float32]:
    """Return the doors' lines, float32 (rows, 2 ends, x and y), metres, frame `map`."""
    starts = np.stack([placements["x"], placements["y"]], -1)
    along = np.stack([np.cos(placements["theta"]), np.sin(placements["theta"])], -1)
    ends = starts + placements["width"][:, None] * along
    with np.errstate(over="ignore"):  # what float32 cannot hold is nowhere near a building
        return np.stack([starts, ends], 1).astype(np.float32)
