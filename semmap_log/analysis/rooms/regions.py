"""Connected regions of free cells, as runs along rows: no picture of labels is made.

Two cells belong together where they share an edge (4-connected); if asked, also where they share a
corner (8-connected). Runs that touch from row to row are joined by union-find, all of a round at
once; so the work grows with the number of runs, of which a floor plan has a few in each row, and
not with its cells.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Index = NDArray[np.int64]

BLOCK_CELLS = 4_000_000
"""So many cells are looked at together, so that a large plan is not copied as a whole."""


@dataclass(frozen=True, slots=True)
class Regions:
    """The regions of a grid; numbered from 1 on, in the order of their first cells."""

    shape: tuple[int, int]
    starts: Index
    """Of each run: row x width + column of its first cell, ascending."""
    ends: Index
    """The same of the cell behind its last."""
    labels: Index
    """The region of each run."""

    @property
    def count(self) -> int:
        """How many there are."""
        return int(self.labels.max(initial=0))

    def label_at(self, rows: ArrayLike, columns: ArrayLike) -> Index:
        """Return the regions of cells; 0: a cell that is not free, or off the grid."""
        row, column = np.asarray(rows, np.int64), np.asarray(columns, np.int64)
        height, width = self.shape
        on_grid = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        if not len(self.starts):
            return np.zeros(on_grid.shape, np.int64)
        flat = np.where(on_grid, row * width + column, -1)
        run = np.searchsorted(self.starts, flat, side="right") - 1
        inside = (run >= 0) & (flat < self.ends[run])
        found: Index = np.where(inside, self.labels[run], 0)
        return found

    def cell_counts(self) -> Index:
        """Return how many cells each region has; [0] is 0, so that a label is an index."""
        counts = np.zeros(self.count + 1, np.int64)
        np.add.at(counts, self.labels, self.ends - self.starts)
        return counts

    def at_border(self) -> NDArray[np.bool_]:
        """Return whether each region has a cell at the grid's border; [0] is False."""
        height, width = self.shape
        first = self.starts % width == 0
        last = self.ends % width == 0
        lowest = self.starts < width
        highest = self.starts >= (height - 1) * width
        found = np.zeros(self.count + 1, np.bool_)
        found[self.labels[first | last | lowest | highest]] = True
        return found

    def mask(self, wanted: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return the cells of some regions, (height, width).

        Args:
            wanted: For each label whether its cells are meant.
        """
        height, width = self.shape
        edges = np.zeros(height * width + 1, np.int8)
        runs = wanted[self.labels]
        edges[self.starts[runs]] += 1
        edges[self.ends[runs]] -= 1
        cells: NDArray[np.bool_] = np.cumsum(edges[:-1], dtype=np.int8).view(np.bool_)
        return cells.reshape(height, width)

    def label_grid(self) -> NDArray[np.int32]:
        """Return the region of each cell, (height, width); 0: not free."""
        height, width = self.shape
        turns = np.zeros(height * width + 1, np.int32)
        turns[self.starts] = self.labels
        np.subtract.at(turns, self.ends, self.labels.astype(np.int32))
        grid: NDArray[np.int32] = np.cumsum(turns[:-1], dtype=np.int32).reshape(height, width)
        return grid


def regions_of(free: NDArray[np.bool_], *, by_corners: bool = False) -> Regions:
    """Return the regions of the cells that are true in a grid of shape (height, width).

    Args:
        free: The grid.
        by_corners: Cells that only share a corner belong together, too.
    """
    starts, ends = _runs(free)
    width = free.shape[1]
    if by_corners:  # one cell longer, and one behind each row, which keeps the rows apart
        rows = starts // max(width, 1)
        pairs = touching(starts + rows, ends + rows + 1, width + 1)
    else:
        pairs = touching(starts, ends, width)
    parents = _united(len(starts), *pairs)
    is_first = parents == np.arange(len(parents))
    labels = np.cumsum(is_first)[parents]
    height, width = free.shape
    return Regions((height, width), starts, ends, labels)


def _runs(free: NDArray[np.bool_]) -> tuple[Index, Index]:
    """Return where runs of free cells start and end, row by row."""
    height, width = free.shape
    rows = max(1, BLOCK_CELLS // max(width, 1))
    starts, ends = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    for first in range(0, height, rows):
        block = np.pad(free[first : first + rows], ((0, 0), (1, 1)))
        turns = np.flatnonzero(block[:, 1:] != block[:, :-1])  # a start, an end, a start, …
        row, column = np.divmod(turns, width + 1)
        flat = (row + first) * width + column
        starts.append(flat[::2])
        ends.append(flat[1::2])
    return np.concatenate(starts), np.concatenate(ends)


def touching(starts: Index, ends: Index, width: int) -> tuple[Index, Index]:
    """Return the pairs of runs, upper and lower row, that have a column in common."""
    first = np.searchsorted(ends, starts - width, side="right")
    behind = np.searchsorted(starts, ends - width, side="left")
    count = np.maximum(behind - first, 0)
    lower = np.repeat(np.arange(len(starts)), count)
    before = np.cumsum(count) - count
    upper = np.arange(len(lower)) - (before - first)[lower]
    return upper, lower


def _united(count: int, one: Index, other: Index) -> Index:
    """Return for each run the first run of its region."""
    parents = np.arange(count)
    while len(one):
        a, b = parents[one], parents[other]
        parents[np.maximum(a, b)] = np.minimum(a, b)  # roots only; of several the last one counts
        while True:
            grand = parents[parents]
            if np.array_equal(grand, parents):
                break
            parents = grand
        apart = parents[one] != parents[other]
        one, other = one[apart], other[apart]
    return parents
