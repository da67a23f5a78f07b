"""What the costmap of a recording needs to know of each door, kept until the end. Pure numpy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.folds.door_changes import Changes
from semmap_log.views.excerpt.door_fold import DoorPicture
from semmap_log.views.excerpt.object_shapes import AS_A_DOOR, ObjectShape

STAMPS = ("number", "folds_ns", "recorded_ns")
STATE = np.dtype([(name, "i8") for name in STAMPS] + [("state", "u1")])
"""All that is kept of a change of state until the recording is written: there may be millions."""


@dataclass(frozen=True, slots=True)
class DoorRows:
    """What happens to a door along a timeline, in the order in which it counts there."""

    states: Changes
    """Rows of `STATE`."""
    placements: Changes
    """Rows of `CHANGE`, as the removals."""
    removals: Changes
    shape: ObjectShape = AS_A_DOOR

    @classmethod
    def of(cls, picture: DoorPicture, shape: ObjectShape) -> DoorRows:
        """Return what is needed of a picture."""
        return cls(slim(picture.states), picture.placements, picture.removals, shape)

    def __len__(self) -> int:
        """How many there are."""
        return len(self.states) + len(self.placements) + len(self.removals)

    @property
    def last_number(self) -> int:
        """Of the event that was recorded last."""
        parts = (self.states, self.placements, self.removals)
        return max(int(part["number"].max()) for part in parts if len(part))

    @classmethod
    def joined(cls, pieces: Sequence[DoorRows]) -> DoorRows:
        """Return all of a door's rows, of which these are the pieces."""
        fields = ((one.states, one.placements, one.removals) for one in pieces)
        states, placements, removals = map(np.concatenate, zip(*fields, strict=True))
        return cls(states, placements, removals, pieces[-1].shape)

    def last(self) -> DoorRows:
        """Return what counts at the end: all that later rows need to go on from."""
        return DoorRows(self.states[-1:], self.placements[-1:], self.removals[-1:], self.shape)


def slim(changes: Changes) -> Changes:
    """Return the stamps and states of changes alone."""
    states = np.empty(len(changes), STATE)
    for name in STATE.names or ():
        states[name] = changes[name]
    return states


Order = Callable[[Changes], NDArray[np.intp]]


def happened_order(rows: Changes) -> NDArray[np.intp]:
    """Return the order in which rows count."""
    return np.lexsort((rows["number"], rows["folds_ns"]))


def recorded_order(rows: Changes) -> NDArray[np.intp]:
    """Return the order in which rows were recorded."""
    return np.argsort(rows["number"], kind="stable")
