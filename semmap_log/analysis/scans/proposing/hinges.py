"""At which end of a proposed door its leaf hangs, where a leaf was seen standing open."""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, hypot, pi, radians, remainder

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.visit import Visit

TURNED = radians(24)
"""A leaf that is turned less against the line may be a recess, or slide."""
LOOKS = 4.0
"""A visit that is worth fewer tells no leaf."""
LEAST_VISITS = 2
"""That saw it."""
AGREED = 0.75
"""So large a share of the visits that saw a leaf has to see it at the same end."""
WIDEST_M = 1.4
"""In a wider opening one leaf is not told from one of two."""


def hinge_of(line: NDArray[np.float64], visits: Sequence[Visit]) -> str:
    """Return `start` or `end`: where a single leaf hangs; empty: nobody saw.

    Args:
        line: x, y of the start m, theta rad, width m.
        visits: To it.
    """
    if line[3] > WIDEST_M:
        return ""
    at = [end for visit in visits if (end := _seen_at(line, visit))]
    for end in ("start", "end"):
        if len(at) >= LEAST_VISITS and at.count(end) >= AGREED * len(at):
            return end
    return ""


def _seen_at(line: NDArray[np.float64], visit: Visit) -> str:
    """Return at which end a visit saw a leaf hang; empty: it did not."""
    if visit.passed or visit.looks < LOOKS or len(visit.leaves) != 1:
        return ""
    x, y, theta, width = line.tolist()
    ((from_x, from_y, to_x, to_y),) = visit.leaves
    turned = abs(remainder(atan2(to_y - from_y, to_x - from_x) - theta, pi))
    if turned < TURNED:
        return ""
    return "start" if hypot(from_x - x, from_y - y) < width / 2 else "end"
