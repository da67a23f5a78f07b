"""A floor as a grid of prices, and the cheapest ways over it to a goal.

Cells are (row, column), row 0 lowest; a price is what a metre in that cell costs, inf: no way.
"""

from __future__ import annotations

import heapq
import math

import numpy as np
from numpy.typing import NDArray

Cell = tuple[int, int]

RADIUS_M = 0.2
"""The middle of the robot keeps this far from cells that a wall touches."""
SHY_M = 0.8
"""Nearer to a wall than this, a metre costs up to three: the robot likes the middle."""


class Tree:
    """The shortest ways from everywhere to one goal (Dijkstra)."""

    def __init__(self, cost: NDArray[np.float64], goal: Cell, cell_m: float) -> None:
        columns = cost.shape[1]
        price = cost.ravel().tolist()
        length = [math.inf] * len(price)
        onward = [-1] * len(price)
        steps = [
            (row * columns + column, math.hypot(row, column) * cell_m)
            for row in (-1, 0, 1)
            for column in (-1, 0, 1)
            if row or column
        ]
        start = goal[0] * columns + goal[1]
        length[start] = 0.0
        queue = [(0.0, start)]
        while queue:
            far, cell = heapq.heappop(queue)
            if far > length[cell]:
                continue
            for offset, metres in steps:  # the outermost cells are never free: no wrapping round
                farther = far + metres * price[cell + offset]
                if farther < length[cell + offset]:
                    length[cell + offset] = farther
                    onward[cell + offset] = cell
                    heapq.heappush(queue, (farther, cell + offset))
        self.length = np.array(length).reshape(cost.shape)
        self._onward = np.array(onward, np.int32).reshape(cost.shape)

    def cells_from(self, start: Cell) -> list[Cell] | None:
        """Return the cells from start to the goal; None: there is no way."""
        if not math.isfinite(self.length[start]):
            return None
        columns = self.length.shape[1]
        cells = [start]
        while (onward := int(self._onward[cells[-1]])) >= 0:
            cells.append(divmod(onward, columns))
        return cells


def coarser(solid: NDArray[np.bool_], factor: int) -> NDArray[np.bool_]:
    """Return blocks of `factor` cells, solid where any of theirs is, with a solid border."""
    rows, columns = (-(-size // factor) for size in solid.shape)
    whole = np.ones((rows * factor, columns * factor), np.bool_)
    whole[: solid.shape[0], : solid.shape[1]] = solid
    blocks = whole.reshape(rows, factor, columns, factor).any(axis=(1, 3))
    blocks[[0, -1], :] = blocks[:, [0, -1]] = True
    return blocks


def costs(solid: NDArray[np.bool_], cell_m: float) -> NDArray[np.float64]:
    """Return the price of a metre in each cell: inf where the robot does not fit."""
    cost = np.ones(solid.shape)
    rings = [solid]
    for _ in range(round(SHY_M / cell_m)):
        rings.append(grown(rings[-1]))
    for distance in range(len(rings) - 1, 0, -1):
        cost[rings[distance]] = 3.0 - 2.0 * (distance - 1) / len(rings)
    cost[rings[max(1, round(RADIUS_M / cell_m))]] = math.inf
    return cost


def grown(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the mask and all cells that touch it."""
    tall = mask.copy()
    tall[1:] |= mask[:-1]
    tall[:-1] |= mask[1:]
    wide = tall.copy()
    wide[:, 1:] |= tall[:, :-1]
    wide[:, :-1] |= tall[:, 1:]
    return wide
