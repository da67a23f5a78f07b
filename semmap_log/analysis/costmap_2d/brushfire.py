"""Which obstacle claims a cell, as noetic's inflation layer finds it: a brushfire.

It starts in the obstacles and burns to the four neighbours, nearest first. A cell belongs to the
obstacle from which it was reached first, which is nearly always the nearest one, but not always:
an exact distance transform gives other costs in some cells. To be equal in every cell, this is the
same fire, laid distance by distance instead of cell by cell: all that burn at one distance are one
numpy step. Their order is kept, for it decides who comes first further out.

Source: costmap_2d/plugins/inflation_layer.cpp (noetic), updateCosts and enqueue.
"""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

Claims = NDArray[np.unsignedinteger]

STEPS = ((-1, 0), (0, -1), (1, 0), (0, 1))
"""(dx, dy): the order in which a cell's neighbours are set on fire."""


Front = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Cells that catch fire, in order, and their claims."""


class Brushfire:
    """The fire, within some number of cells of its sources.

    A claim is a number: 0 for a cell that nothing claims, else one for each place of the cell as
    seen from its source, times each step that led to it.

    Args:
        reach: Cells; at least 0.
    """

    def __init__(self, reach: int) -> None:
        self._reach = reach
        side = 2 * reach + 3  # one more on each side, that steps may leave the reach
        away = np.arange(side) - (reach + 1)
        squares = away[:, None] ** 2 + away[None, :] ** 2
        self._square_at = squares.ravel()
        self._places = np.array([dx + dy * side for dx, dy in STEPS])
        self._source = side * (reach + 1) + reach + 1
        self.dtype = np.dtype(np.uint16 if side * side * 4 + 4 < 2**16 else np.uint32)
        """Of claims."""
        distinct = np.unique(squares[squares <= reach**2])
        self.distances = [math.sqrt(square) for square in distinct.tolist()]
        """Cells, ascending: all distances that there are."""
        index = np.searchsorted(distinct, self._square_at)
        self.distance_of_claim = np.concatenate([[len(distinct)], np.repeat(index, len(STEPS))])
        """Claim -> index of its distance; one more than there are for no claim."""

    def burnt(self, obstacles: NDArray[np.bool_]) -> Claims:
        """Return the claim on each cell.

        Args:
            obstacles: (rows, columns): where the fire starts, in ascending order of flat index.
        """
        ground = _Ground(obstacles, self.dtype)
        sources = np.flatnonzero(ground.is_obstacle)
        ground.fronts[0].append((sources, np.full(len(sources), self._source * len(STEPS) + 1)))
        for square in np.unique(self._square_at).tolist():
            if square in ground.fronts:
                front = ground.reached_first(_joined(ground.fronts.pop(square)))
                ground.claims[front[0]] = front[1]
                self._spread(front, square, ground)
        return ground.inside

    def _spread(self, front: Front, square: int, ground: _Ground) -> None:
        """Set the neighbours of burning cells on fire, each at its own distance.

        One nearer to the source than the burning cell is left out, as in noetic, whose list of that
        distance has been gone through by then.
        """
        cells, marks = front
        onto = (cells[:, None] + ground.neighbours).ravel()
        into = (((marks - 1) // len(STEPS))[:, None] + self._places).ravel()
        squares = self._square_at[into]
        catches = (squares > square) & (squares <= self._reach**2) & (ground.claims[onto] == 0)
        chosen = np.flatnonzero(catches)
        onto, squares = onto[chosen], squares[chosen]
        marks = into[chosen] * len(STEPS) + 1 + chosen % len(STEPS)
        for further in np.unique(squares).tolist():
            here = squares == further
            ground.fronts[further].append((onto[here], marks[here]))


class _Ground:
    """What burns: the cells in a rim that does not, numbered row by row."""

    def __init__(self, obstacles: NDArray[np.bool_], dtype: np.dtype[Any]) -> None:
        self.is_obstacle = np.pad(obstacles, 1)
        _, width = self.is_obstacle.shape
        self.neighbours = np.array([dx + dy * width for dx, dy in STEPS])
        grid = np.zeros(self.is_obstacle.shape, dtype)
        self.inside: Claims = grid[1:-1, 1:-1]
        grid[[0, -1]] = grid[:, [0, -1]] = 1
        self.claims: Claims = grid.reshape(-1)
        self.fronts: dict[int, list[Front]] = defaultdict(list)
        """Squared distance -> what catches fire there, in order."""
        self._numbers = np.empty(grid.size, np.int32)

    def reached_first(self, front: Front) -> Front:
        """Return the cells of a front that have not burnt, each as it was first reached."""
        cells, marks = front
        fresh = self.claims[cells] == 0
        cells, marks = cells[fresh], marks[fresh]
        order = np.arange(len(cells), dtype=np.int32)
        self._numbers[cells[::-1]] = order[::-1]  # of several numbers for a cell the last one stays
        first = self._numbers[cells] == order
        return cells[first], marks[first]


def _joined(fronts: list[Front]) -> Front:
    if len(fronts) == 1:
        return fronts[0]
    return np.concatenate([cells for cells, _ in fronts]), np.concatenate([m for _, m in fronts])
