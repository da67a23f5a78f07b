"""How much of each slot of time a door was open, and how much of it that was known: pure numpy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.folds.timeline import Timeline, Times
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.model.doors import DoorState

Shares = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TimeShares:
    """What is said of a door in slots of time that follow each other."""

    opened: Shares
    """(slots,): share of the time known to be open or closed in which it was open; NaN: none."""
    known: Shares
    """(slots,): share of the slot in which that was known: a sighting held, or a set state."""
    there: Shares
    """(slots,): share of the slot in which the door was in the map."""


def time_shares(timeline: Timeline, edges_ns: Times) -> TimeShares:
    """Return how a door spent slots of time.

    Args:
        timeline: The door's.
        edges_ns: (slots + 1,), ascending: where each slot begins, and the last one ends.
    """
    length_ns = np.diff(edges_ns)
    open_ns, closed_ns = (
        timeline.spent_ns(state, edges_ns) for state in (DoorState.OPEN, DoorState.CLOSED)
    )
    there_ns = sum(
        timeline.spent_ns(state, edges_ns) + timeline.lapsed_ns(state, edges_ns)
        for state in DoorState
    )
    known_ns = open_ns + closed_ns
    opened = np.full(len(length_ns), np.nan)
    np.divide(open_ns, known_ns, out=opened, where=known_ns > 0)
    return TimeShares(opened, known_ns / length_ns, there_ns / length_ns)
