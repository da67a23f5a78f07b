"""The line of the thesis (Fig. 4.2, "compact Bresenham"), of many doors at once.

Over k steps of the longer axis it has taken `(2 k minor + major - 1) // (2 major)` of the shorter:
k minor / major, rounded to the nearest, halves down, away from the start. So the line from the
other end hits other cells, as do `costmap_2d`'s `raytraceLine` and scikit-image's `line` in a third
of all directions. The formula replaces the loop, cell for cell: `test_lines.py` checks it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Cells = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Lines:
    """The cells of some lines that lie on a map, line after line, each from its start."""

    line: NDArray[np.intp]
    """Which line a cell is of: its row in what was drawn."""
    x: Cells
    y: Cells


def draw_lines(starts: Cells, ends: Cells, shape: tuple[int, int]) -> Lines:
    """Return the cells of lines, both ends included; those off the map are left out.

    Args:
        starts: (lines, 2): the cells (x, y) where they start, on the map or not, below 2^30.
        ends: (lines, 2): where they end.
        shape: (height, width) of the map.
    """
    steps = np.abs(ends - starts)
    major = steps.max(axis=1, initial=0)
    first, last = _steps_on_map(starts, ends, shape)
    count = np.maximum(last - first + 1, 0)
    line = np.repeat(np.arange(len(starts)), count)
    before = np.cumsum(count) - count
    step = np.arange(len(line)) - (before - first)[line]
    # Along the longer axis this is the step itself; a line of one cell takes none.
    taken = (2 * step[:, None] * steps[line] + (major - 1)[line][:, None]) // np.maximum(
        2 * major, 1
    )[line][:, None]
    cells = starts[line] + np.sign(ends - starts)[line] * taken
    height, width = shape
    x, y = cells[:, 0], cells[:, 1]
    on_map = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return Lines(line[on_map], x[on_map], y[on_map])


def _steps_on_map(starts: Cells, ends: Cells, shape: tuple[int, int]) -> tuple[Cells, Cells]:
    """Return the first and the last step at which the longer axis is on the map.

    A line may be millions of cells long; of those the map never has more than fit along an edge.
    """
    steps = np.abs(ends - starts)
    longer = (steps[:, 1] > steps[:, 0]).astype(np.intp)
    lines = np.arange(len(starts))
    start, end, major = starts[lines, longer], ends[lines, longer], steps[lines, longer]
    cells = np.array([shape[1], shape[0]])[longer]
    rises = end >= start
    first = np.where(rises, -start, start - (cells - 1))
    last = np.where(rises, cells - 1 - start, start)
    return np.maximum(first, 0), np.minimum(last, major)
