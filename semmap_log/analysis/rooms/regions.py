"""Connected regions of free cells, and shortest ways over them, as runs along rows.

No picture of labels is made. Two cells belong together where they share an edge (4-connected) or,
optionally, also where they share a corner (8-connected). Runs that touch from row to row are joined
by union-find, all of a round at once; so the work grows with the number of runs, of which a floor
plan has a few in each row, and not with its cells.

Shortest ways are found from many starts at once, by sweeps up and down the rows. A step to a side
costs 1, one to a corner 1.414, and only where both cells next to it are free (the octile metric
without cut corners): at most 8 % above the straight line. Costs are whole numbers, thousandths of a
cell, so that a sweep ends when nothing changes, to the bit. A sweep goes over the runs that
changed: along a run by a running minimum, then into the runs of the next row.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

STRAIGHT, DIAGONAL = 1000, 1414
"""What a step costs."""
NO_WAY = 2**30
"""The cost of a cell that no way leads to; a real one is far below."""

Costs = NDArray[np.int32]


class DistanceFields:
    """The free cells of one region, and how far they are from where one starts."""

    def __init__(self, regions: Regions, label: int) -> None:
        runs = np.flatnonzero(regions.labels == label)
        starts, ends = regions.starts[runs], regions.ends[runs]
        self._starts, self._ends = starts, ends
        self._firsts = np.concatenate([[0], np.cumsum(ends - starts)])
        self._width = regions.shape[1]
        self._ramp = (np.arange((ends - starts).max(initial=0)) * STRAIGHT).astype(np.int32)[
            :, None
        ]
        upper, lower = touching(starts, ends, self._width)
        self._below = self._touched(upper, lower, -self._width)
        self._above = self._touched(lower, upper, self._width)

    @property
    def size(self) -> int:
        """How many cells there are."""
        return int(self._firsts[-1])

    def index_of(self, flat: Index) -> Index:
        """Return where cells lie in a field, by row x width + column; they are of this region."""
        run = np.searchsorted(self._starts, flat, side="right") - 1
        return self._firsts[run] + flat - self._starts[run]

    def flat_of(self, index: int) -> int:
        """Return row x width + column of a cell of a field."""
        run = int(np.searchsorted(self._firsts, index, side="right")) - 1
        return int(self._starts[run] + index - self._firsts[run])

    def from_cells(self, cells: Index) -> Costs:
        """Return the costs to all cells: (size, starts), thousandths of a cell.

        Args:
            cells: Where to start, as indices from `index_of`.
        """
        field = np.full((self.size, len(cells)), NO_WAY, np.int32)
        field[cells, np.arange(len(cells))] = 0
        runs = np.unique(np.searchsorted(self._firsts, cells, side="right") - 1)
        down = np.zeros(len(self._starts), np.bool_)
        for run in runs.tolist():
            self._along(field, run)
        down[runs] = True
        up = down.copy()
        while down.any() or up.any():
            self._sweep(field, range(len(down)), self._below, down, up)
            self._sweep(field, range(len(up) - 1, -1, -1), self._above, up, down)
        return field

    def _touched(
        self, one: Index, other: Index, shift: int
    ) -> list[list[tuple[int, slice, slice]]]:
        """Return for each run the runs that it touches in a next row, and the cells in common.

        Args:
            one: Runs.
            other: Of each, one that it touches.
            shift: What brings a cell of the other's row into the row of the one.
        """
        found: list[list[tuple[int, slice, slice]]] = [[] for _ in self._starts]
        low = np.maximum(self._starts[one], self._starts[other] + shift)
        high = np.minimum(self._ends[one], self._ends[other] + shift)
        mine = self._firsts[one] + low - self._starts[one]
        theirs = self._firsts[other] + low - shift - self._starts[other]
        for a, b, first, second, count in zip(
            *(part.tolist() for part in (one, other, mine, theirs, high - low)), strict=True
        ):
            found[a].append((b, slice(first, first + count), slice(second, second + count)))
        return found

    def _sweep(
        self,
        field: Costs,
        order: range,
        onward: list[list[tuple[int, slice, slice]]],
        waiting: NDArray[np.bool_],
        waiting_back: NDArray[np.bool_],
    ) -> None:
        """Pass changes on to the next rows, in the order of the sweep."""
        for run in order:
            if not waiting[run]:
                continue
            waiting[run] = False
            for other, mine, theirs in onward[run]:
                if _stepped(field[mine], field[theirs]):
                    self._along(field, other)
                    waiting[other] = waiting_back[other] = True

    def _along(self, field: Costs, run: int) -> None:
        """Let costs run along a run, both ways."""
        cells = field[self._firsts[run] : self._firsts[run + 1]]
        ramp = self._ramp[: len(cells)]
        ahead = np.minimum.accumulate(cells - ramp, axis=0) + ramp
        back = np.minimum.accumulate((ahead + ramp)[::-1], axis=0)[::-1] - ramp
        np.minimum(ahead, back, out=cells)


def _stepped(source: Costs, target: Costs) -> bool:
    """Take the steps to adjacent cells in the next row; return whether one was shorter."""
    found = source + STRAIGHT
    np.minimum(found[1:], source[:-1] + DIAGONAL, out=found[1:])
    np.minimum(found[:-1], source[1:] + DIAGONAL, out=found[:-1])
    if not (found < target).any():
        return False
    np.minimum(target, found, out=target)
    return True


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
    """The same of the cell after its last."""
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
    if by_corners:  # one cell longer, and one after each row, which keeps the rows apart
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
