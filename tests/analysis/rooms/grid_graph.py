"""The oracle: Dijkstra's algorithm over the cells of a grid, as a textbook has it."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from semmap_log.analysis.rooms.regions import DIAGONAL, STRAIGHT

Cell = tuple[int, int]


def steps(free: NDArray[np.bool_], cell: Cell) -> Iterator[tuple[Cell, int]]:
    """Yield the cells beside one, with what the step costs; corners are not cut."""
    row, column = cell

    def is_free(up: int, right: int) -> bool:
        r, c = row + up, column + right
        return 0 <= r < free.shape[0] and 0 <= c < free.shape[1] and bool(free[r, c])

    for up in (-1, 0, 1):
        for right in (-1, 0, 1):
            if (up, right) == (0, 0) or not is_free(up, right):
                continue
            if up and right and not (is_free(up, 0) and is_free(0, right)):
                continue
            yield (row + up, column + right), DIAGONAL if up and right else STRAIGHT


def textbook(free: NDArray[np.bool_], start: Cell) -> Mapping[Cell, int]:
    """Return the costs to all cells that can be reached."""
    costs, waiting = {start: 0}, [(0, start)]
    while waiting:
        cost, cell = heapq.heappop(waiting)
        if cost > costs[cell]:
            continue
        for beside, step in steps(free, cell):
            if cost + step < costs.get(beside, 2**62):
                costs[beside] = cost + step
                heapq.heappush(waiting, (cost + step, beside))
    return costs


def shortest(free: NDArray[np.bool_], starts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the costs from cells, row x width + column, to all cells: (starts, cells)."""
    if find_spec("scipy"):
        return by_scipy(free, starts)
    found = np.full((len(starts), free.size), np.inf)
    for row, start in enumerate(starts.tolist()):
        for (r, c), cost in textbook(free, divmod(start, free.shape[1])).items():
            found[row, r * free.shape[1] + c] = cost
    return found


def by_scipy(free: NDArray[np.bool_], starts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the costs from cells, row x width + column, to all cells: (starts, cells)."""
    sparse: Any = pytest.importorskip("scipy.sparse", reason="scipy is the oracle here")
    csgraph: Any = pytest.importorskip("scipy.sparse.csgraph", reason="scipy is the oracle here")
    index = np.arange(free.size).reshape(free.shape)
    right, up = free[:, :-1] & free[:, 1:], free[:-1] & free[1:]
    square = free[:-1, :-1] & free[1:, 1:] & free[:-1, 1:] & free[1:, :-1]
    edges = [
        (index[:, :-1][right], index[:, 1:][right], STRAIGHT),
        (index[:-1][up], index[1:][up], STRAIGHT),
        (index[:-1, :-1][square], index[1:, 1:][square], DIAGONAL),
        (index[:-1, 1:][square], index[1:, :-1][square], DIAGONAL),
    ]
    one, other = (np.concatenate([edge[n] for edge in edges]) for n in (0, 1))
    cost = np.concatenate([np.full(len(edge[0]), edge[2]) for edge in edges])
    graph = sparse.csr_matrix((cost, (one, other)), shape=(free.size, free.size))
    found: NDArray[np.float64] = csgraph.dijkstra(graph, directed=False, indices=starts)
    return found
