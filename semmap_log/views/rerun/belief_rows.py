"""What a robot could believe of a door over time, as points of a curve: pure numpy.

A belief jumps at each sighting and drifts in between. So it is asked for just before and at all
that is known of the door, and every ten minutes; of those points only the ones are kept that a
line through the others would miss.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence

EVERY_NS = 600 * 10**9
MOST_STEPS = 4096
"""In a long recording the steps are longer, so that there are not more of them."""
TOLERANCE = 0.01
"""No point that is left out lies further than this off the line."""

POINT = np.dtype([("folds_ns", "i8"), ("p_open", "f8")])
"""A point of a curve; NaN: the line has a gap."""

Points = NDArray[np.void]
"""Rows of `POINT`."""
Times = NDArray[np.int64]


def times_of_curve(evidence: DoorEvidence, first_ns: int, last_ns: int) -> Times:
    """Return when to ask for a belief, ascending, from `first_ns` to `last_ns`."""
    step_ns = max(EVERY_NS, (last_ns - first_ns) // MOST_STEPS)
    jumps = np.concatenate([evidence.start_ns, evidence.end_ns, evidence.seen_ns])
    asked = np.concatenate([
        np.arange(first_ns, last_ns, step_ns, dtype=np.int64), [last_ns], jumps, jumps - 1,
    ])  # fmt: skip
    times: Times = np.unique(asked[(asked >= first_ns) & (asked <= last_ns)])
    return times


def curve(times_ns: Times, p_open: NDArray[np.float64], is_known: NDArray[np.bool_]) -> Points:
    """Return the points to draw; where nothing is known is a gap.

    Args:
        times_ns: (n,), ascending.
        p_open: (n,).
        is_known: (n,).
    """
    points = np.empty(len(times_ns), POINT)
    points["folds_ns"], points["p_open"] = times_ns, np.where(is_known, p_open, np.nan)
    edges = np.flatnonzero(np.diff(is_known, prepend=False, append=False))
    kept: list[int] = []
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        run = telling(times_ns[start:stop], p_open[start:stop])
        kept += (run + start).tolist()
        if stop < len(points):
            kept.append(stop)
    return points[kept]


def telling(times_ns: Times, values: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the places of the points that a line through the others would miss.

    From a kept point on, each further one allows some slopes; once the next point lies outside of
    them all, the one before it is kept. (A swing filter: Elmeleegy et al., VLDB 2009.)
    """
    # Whole nanoseconds: as seconds of some years, moments beside each other would be one.
    times, heights = times_ns.tolist(), values.tolist()
    kept = [0]
    steepest, flattest = np.inf, -np.inf
    for i in range(1, len(times)):
        ahead = times[i] - times[kept[-1]]
        rise = heights[i] - heights[kept[-1]]
        if not flattest * ahead <= rise <= steepest * ahead:
            kept.append(i - 1)
            ahead, rise = times[i] - times[i - 1], heights[i] - heights[i - 1]
            steepest, flattest = np.inf, -np.inf
        steepest = min(steepest, (rise + TOLERANCE) / ahead)
        flattest = max(flattest, (rise - TOLERANCE) / ahead)
    if kept[-1] != len(times) - 1:
        kept.append(len(times) - 1)
    return np.array(kept, np.int64)
