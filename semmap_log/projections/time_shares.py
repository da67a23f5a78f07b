"""How much of each slot of time a door was open, and how much of it that was known: pure numpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.doors import DoorState
from semmap_log.projections.timeline import Timeline, Times

Shares = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TimeShares:
    """What is said of a door in slots of time that follow each other."""

    opened: Shares
    """(slots,): share of the time known to be open or closed in which it was open; NaN: none."""
    known: Shares
    """(slots,): share of the slot in which that was known."""
    there: Shares
    """(slots,): share of the slot in which the door was in the map."""


def time_shares(timeline: Timeline, edges_ns: Times) -> TimeShares:
    """Return how a door spent slots of time.

    Args:
        timeline: The door's.
        edges_ns: (slots + 1,), ascending: where each slot begins, and the last one ends.
    """
    length_ns = np.diff(edges_ns)
    open_ns = _spent_ns(timeline, timeline.state == DoorState.OPEN, edges_ns)
    known_ns = open_ns + _spent_ns(timeline, timeline.state == DoorState.CLOSED, edges_ns)
    there_ns = _spent_ns(timeline, np.ones(len(timeline), np.bool_), edges_ns)
    opened = np.full(len(length_ns), np.nan)
    np.divide(open_ns, known_ns, out=opened, where=known_ns > 0)
    return TimeShares(opened, known_ns / length_ns, there_ns / length_ns)


def _spent_ns(timeline: Timeline, chosen: NDArray[np.bool_], edges_ns: Times) -> Times:
    """Return how much of each slot lies in the chosen intervals, nanoseconds."""
    start_ns, end_ns = timeline.start_ns[chosen], timeline.end_ns[chosen]
    before_ns = np.concatenate([np.zeros(1, np.int64), np.cumsum(end_ns - start_ns)])
    begun = np.searchsorted(start_ns, edges_ns, "right")
    # Of all that began by an edge, only the last interval may reach beyond it.
    last_end_ns = np.concatenate([edges_ns[:1], end_ns])[begun]
    spent: Times = before_ns[begun] - np.where(begun, np.maximum(last_end_ns - edges_ns, 0), 0)
    return np.diff(spent)
