"""The best order of few stops whose probabilities do not change: Held and Karp's, for latency."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.planning.round_task import Orders, RoundTask

MOST_EXACT = 12
"""Stops; each one more doubles time and memory."""


def exact_order(task: RoundTask) -> Orders:
    """Return the order with the least mean time to visit.

    Each leg delays all that is not visited yet: it costs its time, and the time spent at the stop
    before, times the sum of P of what is left. That depends on which stops were visited and on the
    last one, not on their order (M. Held, R. Karp, J. SIAM 10, 1962). Of orders as good, the same
    one is taken every time.

    Args:
        task: Of at most `MOST_EXACT` stops; P as at the start, no budget.
    """
    count = len(task)
    if not count:
        return np.empty(0, np.intp)
    weights = task.p_passes[:, 0]
    onward_s = onward(task)
    members = (np.arange(1 << count)[:, None] >> np.arange(count)) & 1 > 0
    left = weights.sum() - members @ weights
    cost = np.full((1 << count, count), np.inf)
    before = np.full((1 << count, count), -1, np.int8)
    cost[1 << np.arange(count), np.arange(count)] = task.from_start_s * weights.sum()
    sizes = members.sum(axis=1)
    for size in range(1, count):
        sets = np.flatnonzero(sizes == size)
        reached = cost[sets][:, :, None] + onward_s * left[sets][:, None, None]
        best, last = reached.min(axis=1), reached.argmin(axis=1)
        row, stop = np.nonzero(~members[sets])
        with_it = sets[row] | (1 << stop)
        cost[with_it, stop] = best[row, stop]
        before[with_it, stop] = last[row, stop]
    return _traced(cost[-1], before)


def onward(task: RoundTask) -> NDArray[np.float64]:
    """Return (n, n): from the arrival at a stop, row, to that at the next, column, on average."""
    p_passes = task.p_passes[:, 0]
    service_s = p_passes * task.enter_s + (1 - p_passes) * task.fail_s
    found: NDArray[np.float64] = service_s[:, None] + task.leg_s
    return found


def _traced(cost: NDArray[np.float64], before: NDArray[np.int8]) -> Orders:
    """Return the order that ends at the stop of least cost, all visited."""
    visited, stop = len(before) - 1, int(cost.argmin())
    order = []
    while stop >= 0:
        order.append(stop)
        visited, stop = visited ^ (1 << stop), int(before[visited, stop])
    return np.array(order[::-1], np.intp)
