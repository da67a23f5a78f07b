"""Rows of door changes as pictures take them: where they begin, whose they are, what counts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.folds.door_changes import CHANGE, EVERYTHING, Changes, Stamp, is_before
from semmap_log.core.model.doors import Door
from semmap_log.core.model.events import DoorAdded
from semmap_log.core.model.meaning import FIELDS

ALWAYS: Stamp = (-1, -1)
NEVER: Stamp = (2**63 - 1, 2**63 - 1)

NO_STATE = 255


@dataclass(frozen=True, slots=True)
class RecordingEdge:
    """Where a recording begins or ends, on each of its timelines."""

    folds_ns: int
    number: int
    recorded_ns: int

    def stamp(self, changes: Changes) -> None:
        """Put the rows there."""
        changes["folds_ns"], changes["number"] = self.folds_ns, self.number
        changes["recorded_ns"] = self.recorded_ns


def opening_changes(doors: Iterable[Door], begin: RecordingEdge) -> Changes:
    """Return one row a door that sets all of it to what it is: how a recording begins in midst."""
    listed = list(doors)
    opening = np.zeros(len(listed), CHANGE)
    opening["kind"], opening["sets"] = DoorAdded.kind, EVERYTHING
    begin.stamp(opening)
    for name in ("door_id", *FIELDS):
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


@dataclass(frozen=True, slots=True)
class DoorLifetime:
    """From when to when a door is in the map, with all that is known."""

    added: Stamp = NEVER
    removed: Stamp = NEVER

    def covers(self, changes: Changes) -> NDArray[np.bool_]:
        """Tell for each row whether the door was there; the adding counts in, the removal out."""
        return ~is_before(changes, self.added) & is_before(changes, self.removed)


def strips_of(placements: Changes) -> NDArray[np.float32]:
    """Return the doors' lines, float32 (rows, 2 ends, x and y), metres, frame `map`."""
    starts = np.stack([placements["x"], placements["y"]], -1)
    along = np.stack([np.cos(placements["theta"]), np.sin(placements["theta"])], -1)
    ends = starts + placements["width"][:, None] * along
    with np.errstate(over="ignore"):  # what float32 cannot hold is nowhere near a building
        return np.stack([starts, ends], 1).astype(np.float32)
