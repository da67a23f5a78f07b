"""Doors as chains make them, to learn from: simulated exactly."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]


def stretches_of(
    hours: float, closed_h: float, open_h: Reals | float, rng: np.random.Generator
) -> list[tuple[float, float, bool]]:
    """Return (start, end, is open) in hours of a door, closed at first.

    Args:
        hours: How long.
        closed_h: Mean of how long it stays shut.
        open_h: Mean of how long it stays open; several: any of them, each time anew.
        rng: Of chance.
    """
    many = int(3 * hours / (closed_h + np.mean(open_h))) + 100
    stays = np.stack(
        [rng.exponential(closed_h, many), rng.exponential(rng.choice(np.atleast_1d(open_h), many))],
        axis=1,
    ).ravel()
    ends = np.cumsum(stays)
    count = int(np.searchsorted(ends, hours)) + 1
    assert count <= len(ends)
    edges = np.append(0.0, np.minimum(ends[:count], hours)).tolist()
    return [(a, b, bool(i % 2)) for i, (a, b) in enumerate(pairwise(edges))]
