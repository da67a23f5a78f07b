"""Which events say how a door is, and what they say: the same for every fold of states."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.doors import DoorState
from semmap_log.events import (
    Changed,
    DoorAdded,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorUpdated,
    Event,
)

STATE_WORDS = (DoorAdded, DoorUpdated, DoorObserved, DoorPassed, DoorRemoved)
"""The kinds of events that set a door's state, or end it."""

UNKNOWN = np.uint8(DoorState.UNKNOWN)
"""What a state is that only a later version knows."""


def sets_state(kind: type[Event], rows: NDArray[np.void]) -> NDArray[np.bool_]:
    """Return which events of one of these kinds set their door's state, or end it."""
    if kind is DoorUpdated:
        return np.asarray(rows["changed"] & int(Changed.STATE), np.bool_)
    return rows["passed"] if kind is DoorPassed else np.ones(len(rows), np.bool_)


def states_of(kind: type[Event], rows: NDArray[np.void]) -> NDArray[np.uint8]:
    """Return the `DoorState` that each event sets: who passed saw it open; a removal, UNKNOWN."""
    if kind is DoorPassed:
        return np.full(len(rows), int(DoorState.OPEN), np.uint8)
    if kind is DoorRemoved:
        return np.full(len(rows), UNKNOWN)
    return np.where(rows["state"] < len(DoorState), rows["state"], UNKNOWN)
