"""What events do to doors, as rows to draw: pure numpy, nothing of rerun.

`changes_of` lays the events of a batch side by side as one table; `DoorFold` turns one door's part
of it into the rows at which its state, its line and its probabilities become something else.
"""

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
"""An event about a door; `sets` are the bits of `Changed`, the values outside them mean nothing."""

VALUES = ("level", "x", "y", "theta", "width", "state", "prob_open", "prob_closed")

PROBABILITIES = int(Changed.PROB_OPEN | Changed.PROB_CLOSED)
PLACE = int(Changed.POSE | Changed.WIDTH)

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
    opening["kind"], opening["sets"] = DoorAdded.kind, int(ALL_CHANGED)
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
    part["sets"] = int(ALL_CHANGED)
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


def _fill_removed(part: Changes, rows: Any) -> None:
    """A removal sets nothing; its kind says it all."""


_FILLS: Mapping[type[Event], Callable[[Changes, Any], None]] = {
    DoorAdded: _fill_added,
    DoorUpdated: _fill_updated,
    DoorRemoved: _fill_removed,
    DoorObserved: _fill_observed,
    DoorPassed: _fill_passed,
}


@dataclass(frozen=True, slots=True)
class Life:
    """From when to when a door is in the map."""

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


@dataclass(frozen=True, slots=True)
class DoorPicture:
    """Rows to draw for one door: each part with the events (rows of `CHANGE`) behind it."""

    state_changes: Changes
    """One a state; `state` is what it becomes."""
    placements: Changes
    """One a place; x, y, theta, width and level are all filled in."""
    probabilities: Changes
    """One a point of the curves; both probabilities are filled in, NaN where not given."""


class DoorFold:
    """Follows one door and remembers only its last values."""

    def __init__(self, life: Life, *, repeats: bool = False) -> None:
        """Start before the door's first row.

        Args:
            life: Events outside it draw nothing.
            repeats: Keep the state changes that only repeat the state.
        """
        self._life = life
        self._repeats = repeats
        self.last: Changes = np.zeros(1, CHANGE)
        """One row: the values after the last event taken."""
        self.last["state"] = NO_STATE
        for name in ("x", "y", "theta", "width", "prob_open", "prob_closed"):
            self.last[name] = np.nan

    def take(self, changes: Changes) -> DoorPicture:
        """Return what the next events draw; they come in the order in which they count."""
        changes = changes[self._life.covers(changes)]
        return DoorPicture(
            self._take_states(changes), self._take_places(changes), self._take_curves(changes)
        )

    def _take_states(self, changes: Changes) -> Changes:
        setting: Changes = changes[(changes["sets"] & int(Changed.STATE)) != 0]
        if not len(setting):
            return setting
        states = setting["state"]
        differs = np.append(states[0] != self.last["state"][0], states[1:] != states[:-1])
        self.last["state"] = states[-1]
        drawn: Changes = setting[differs | self._repeats]
        return drawn

    def _take_places(self, changes: Changes) -> Changes:
        placed: Changes = changes[(changes["sets"] & PLACE) != 0]
        self._fill_forward(placed, Changed.POSE, ("level", "x", "y", "theta"))
        self._fill_forward(placed, Changed.WIDTH, ("width",))
        return placed

    def _take_curves(self, changes: Changes) -> Changes:
        given: Changes = changes[(changes["sets"] & PROBABILITIES) != 0]
        self._fill_forward(given, Changed.PROB_OPEN, ("prob_open",))
        self._fill_forward(given, Changed.PROB_CLOSED, ("prob_closed",))
        known = ~(np.isnan(given["prob_open"]) & np.isnan(given["prob_closed"]))
        drawn: Changes = given[known | (given["kind"] != DoorAdded.kind)]
        return drawn

    def _fill_forward(self, rows: Changes, bit: Changed, names: tuple[str, ...]) -> None:
        """Give the rows that do not set a field the value that the field had."""
        if not len(rows):
            return
        sets = (rows["sets"] & int(bit)) != 0
        source = np.maximum.accumulate(np.where(sets, np.arange(len(rows)), -1))
        for name in names:
            rows[name] = np.where(source >= 0, rows[name][source], self.last[name])
            self.last[name] = rows[name][-1]


def late_rows(changes: Changes) -> NDArray[np.bool_]:
    """Tell which rows, in the order in which they count, were recorded after one that counts later.

    By the order of recording they never set anything: the later one had won before they came.
    """
    least_behind = np.minimum.accumulate(changes["number"][::-1])[::-1]
    return least_behind < changes["number"]


def strips_of(placements: Changes) -> NDArray[np.float32]:
    """Return the doors' lines, float32 (rows, 2 ends, x and y), metres, frame `map`."""
    starts = np.stack([placements["x"], placements["y"]], -1)
    along = np.stack([np.cos(placements["theta"]), np.sin(placements["theta"])], -1)
    ends = starts + placements["width"][:, None] * along
    return np.stack([starts, ends], 1).astype(np.float32)
