"""Doors as chains make them, to learn from: simulated exactly, looked at now and then."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from semmap_log.probabilities.chain.markov_chain import Nodes

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
