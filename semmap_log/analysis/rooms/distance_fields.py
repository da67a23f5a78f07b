"""Shortest ways over free cells from many starts at once: sweeps over runs, up and down the rows.

A step to a side costs 1, one to a corner 1.414, and only where both cells beside it are free
(the octile metric without cut corners): at most 8 % above the straight line. Costs are whole
numbers, thousandths of a cell, so that a sweep ends when nothing changes, to the bit.

Every row of cells is held as runs of free ones; a sweep goes over the runs that changed: along a
run by a running minimum, then into the runs of the next row. All starts are swept together.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.rooms.regions import Index, Regions, touching

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
            cells: Where to start, as `index_of` tells cells.
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
        """Tell what changed to the next rows, in the order of the sweep."""
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
    """Take the steps from cells to those beside them in the next row; tell if one was shorter."""
    found = source + STRAIGHT
    np.minimum(found[1:], source[:-1] + DIAGONAL, out=found[1:])
    np.minimum(found[:-1], source[1:] + DIAGONAL, out=found[:-1])
    if not (found < target).any():
        return False
    np.minimum(target, found, out=target)
    return True
