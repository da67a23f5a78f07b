"""In which order to go: exact where that can be, else the best that is found."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from semmap_log.analysis.planning.exact_order import MOST_EXACT, exact_order
from semmap_log.analysis.planning.moved_segments import improved
from semmap_log.analysis.planning.round_task import Orders, RoundTask
from semmap_log.analysis.planning.starting_orders import greedy_order, nearest_order

MOST_SWEEPS = 40
"""Steps of the search with P at arrival: each looks at all orders near the last one."""


def best_order(
    task: RoundTask, *, given: Iterable[Orders] = (), sweeps: int = MOST_SWEEPS
) -> Orders:
    """Return the order of all stops with the least mean time to visit; deterministic.

    Of up to `MOST_EXACT` stops whose P does not change it is the best there is. Otherwise it is
    the best of searches from three orders and more: by value, nearest first, and as the stops are
    given; where P changes, or a budget ends the round, it is judged at the times of arrival.

    Args:
        task: The stops.
        given: Orders to start from, too, such as the rest of a plan under way.
        sweeps: See `best_from`.
    """
    if task.is_fixed and len(task) <= MOST_EXACT:
        return exact_order(task)
    as_they_are = np.arange(len(task))
    starts = [greedy_order(task), nearest_order(task), as_they_are, *given]
    return best_from(task, starts, sweeps=sweeps)


def best_from(task: RoundTask, starts: list[Orders], *, sweeps: int = MOST_SWEEPS) -> Orders:
    """Return the best order that searches from these find; deterministic.

    Args:
        task: The stops.
        starts: At least one.
        sweeps: Steps with P at arrival; 0: only with P as it is at the arrival in each start.
    """
    found = [_improved(task, start) for start in starts]
    best = min(found, key=lambda order: float(task.cost(order[None])[0]))
    return best if task.is_fixed else _swept(task, best, sweeps)


def _improved(task: RoundTask, start: Orders) -> Orders:
    """Return a better order by P as it is when one comes to each stop in the order before."""
    if task.is_fixed:
        return improved(task, start)
    best = start
    for _ in range(2):
        order = improved(_as_arrived(task, best), best)
        first, second = task.cost(np.array([best, order]))
        if second >= first:
            break
        best = order
    return best


def _as_arrived(task: RoundTask, order: Orders) -> RoundTask:
    times_s = np.empty(len(order))
    times_s[order] = task.arrivals(order[None])[0][0]
    return task.at(times_s)


def _swept(task: RoundTask, order: Orders, sweeps: int) -> Orders:
    """Return the order that no single move makes better, each judged at the times of arrival."""
    best = float(task.cost(order[None])[0])
    for _ in range(sweeps):
        near = _near(order)
        if not len(near):
            break
        costs = task.cost(near)
        place = int(costs.argmin())
        if costs[place] >= best - 1e-9 * max(1.0, abs(best)):
            break
        order, best = near[place], float(costs[place])
    return order


def _near(order: Orders) -> Orders:
    """Return the orders in which one stop is moved, or a piece turned round."""
    count = len(order)
    places = np.arange(count)
    moved = []
    for source in range(count):
        without = np.delete(places, source)
        moved += [np.insert(without, target, source) for target in range(count) if target != source]
    for low in range(count):
        for high in range(low + 2, count):
            turned = places.copy()
            turned[low : high + 1] = turned[low : high + 1][::-1]
            moved.append(turned)
    return order[np.array(moved, np.intp).reshape(-1, count)]
