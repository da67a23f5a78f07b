"""A short tour of stops, as a person would plan a fixed round: no knowledge of doors in it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Order = NDArray[np.intp]
LONGEST_MOVED = 3


def short_tour(from_start_s: NDArray[np.float64], leg_s: NDArray[np.float64]) -> list[int]:
    """Return the stops in an order that no move of a piece, or turning one round, makes shorter."""

    def length_s(order: Order) -> float:
        return float(from_start_s[order[0]] + leg_s[order[:-1], order[1:]].sum())

    order = _nearest_first(from_start_s, leg_s)
    best = length_s(order)
    is_better = True
    while is_better:
        is_better = False
        for near in _near(order):
            if (length := length_s(near)) < best - 1e-9:
                order, best, is_better = near, length, True
                break
    return [int(stop) for stop in order]


def _nearest_first(from_start_s: NDArray[np.float64], leg_s: NDArray[np.float64]) -> Order:
    order = [int(from_start_s.argmin())]
    left = [stop for stop in range(len(leg_s)) if stop != order[0]]
    while left:
        order.append(left.pop(int(leg_s[order[-1], left].argmin())))
    return np.array(order, np.intp)


def _near(order: Order) -> Iterator[Order]:
    count = len(order)
    for low in range(count):
        for high in range(low + 1, count):
            yield np.concatenate([order[:low], order[low : high + 1][::-1], order[high + 1 :]])
    for length in range(1, LONGEST_MOVED + 1):
        for low in range(count - length + 1):
            piece, rest = order[low : low + length], np.delete(order, np.s_[low : low + length])
            for place in range(len(rest) + 1):
                yield np.concatenate([rest[:place], piece, rest[place:]])
