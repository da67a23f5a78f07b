"""Orders that a search starts from: each next stop the one that is best by itself."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.planning.round_task import Orders, RoundTask

Values = NDArray[np.float64]


def greedy_order(task: RoundTask) -> Orders:
    """Return the stops, always on to the one of most P for the time that it takes.

    P is that at the time of arrival.
    """

    def worth(stops: Orders, leg_s: Values, p_passes: Values) -> Values:
        takes_s = leg_s + p_passes * task.enter_s[stops] + (1 - p_passes) * task.fail_s[stops]
        found: Values = p_passes / np.maximum(takes_s, 1e-9)
        return found

    return _by(task, worth)


def nearest_order(task: RoundTask) -> Orders:
    """Return the stops, always on to the nearest one that is left."""
    return _by(task, lambda _stops, leg_s, _p: -leg_s)


def _by(task: RoundTask, worth: Callable[[Orders, Values, Values], Values]) -> Orders:
    left, order = np.arange(len(task)), list[int]()
    now_s = task.now_s
    while len(left):
        leg_s = task.leg_s[order[-1], left] if order else task.from_start_s[left]
        p_passes = task.p_at(left, now_s + leg_s)
        place = int(worth(left, leg_s, p_passes).argmax())
        stop, p = int(left[place]), float(p_passes[place])
        now_s += float(leg_s[place] + p * task.enter_s[stop] + (1 - p) * task.fail_s[stop])
        order.append(stop)
        left = np.delete(left, place)
    return np.array(order, np.intp)
