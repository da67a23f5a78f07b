"""Doors as chains make them, to learn from: simulated exactly, looked at now and then."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.probabilities.chain.chain import Nodes

Reals = NDArray[np.float64]

HOUR_S = 3600.0


def states_at(
    times_s: Reals, opening: float, closing: float, rng: np.random.Generator
) -> NDArray[np.bool_]:
    """Return whether a door of these rates, per second, is open at each time."""
    end_s = float(times_s[-1]) + 1.0
    many = int(3 * end_s * opening * closing / (opening + closing)) + 100
    stays = np.stack([rng.exponential(1 / opening, many), rng.exponential(1 / closing, many)], 1)
    changes = np.cumsum(stays.ravel())
    assert changes[-1] > end_s
    found: NDArray[np.bool_] = np.searchsorted(changes, times_s, "right") % 2 == 1
    return found


def looked_at(
    times_s: Reals, is_open: NDArray[np.bool_], accuracy: float, rng: np.random.Generator
) -> Nodes:
    """Return one sequence of readings that are right so often."""
    reads_open = is_open == (rng.random(len(times_s)) < accuracy)
    llr = np.log(accuracy / (1 - accuracy))
    count = len(times_s)
    return Nodes(
        np.diff(times_s, prepend=times_s[:1]),
        np.where(reads_open, llr, -llr),
        np.zeros(count, np.intp),
        np.arange(count) == 0,
    )
