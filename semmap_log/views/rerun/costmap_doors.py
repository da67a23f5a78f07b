"""What the costmap of a recording needs to know of each door, kept until the end. Pure numpy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.views.rerun.door_rows import Changes

STAMPS = ("number", "folds_ns", "recorded_ns")
STATE = np.dtype([(name, "i8") for name in STAMPS] + [("state", "u1")])
"""All that is kept of a change of state until the recording is written: there may be millions."""


@dataclass(frozen=True, slots=True)
class DoorRows:
    """What happens to a door, as `DoorFold` gives it, in the order in which it counts."""

    states: Changes
    """Rows of `STATE`."""
    late_states: NDArray[np.bool_]
    placements: Changes
    """Rows of `CHANGE`, as the removal."""
    late_placements: NDArray[np.bool_]
    removal: Changes

    def __len__(self) -> int:
        """How many there are."""
        return len(self.states) + len(self.placements) + len(self.removal)

    @property
    def last_number(self) -> int:
        """Of the event that was recorded last."""
        parts = (self.states, self.placements, self.removal)
        return max(int(part["number"].max()) for part in parts if len(part))

    @classmethod
    def joined(cls, pieces: Sequence[DoorRows]) -> DoorRows:
        """Return all of a door's rows, of which these are the pieces."""
        return cls(*(np.concatenate(parts) for parts in zip(*map(_fields, pieces), strict=True)))

    def last(self) -> DoorRows:
        """Return what counts at the end: all that later rows need to go on from."""
        return DoorRows(
            self.states[-1:], np.zeros(len(self.states[-1:]), np.bool_),
            self.placements[-1:], np.zeros(len(self.placements[-1:]), np.bool_),
            self.removal[-1:],
        )  # fmt: skip

    def as_recorded(self) -> DoorRows:
        """Return those that counted when they were recorded, in the order of recording."""
        return DoorRows(
            _by_number(self.states[~self.late_states]), np.zeros(0, np.bool_),
            _by_number(self.placements[~self.late_placements]), np.zeros(0, np.bool_),
            self.removal,
        )  # fmt: skip


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


def _by_number(rows: Changes) -> Changes:
    ordered: Changes = rows[recorded_order(rows)]
    return ordered


def _fields(rows: DoorRows) -> tuple[NDArray[np.generic], ...]:
    return rows.states, rows.late_states, rows.placements, rows.late_placements, rows.removal
