"""Lines with a thickness, taken from a grid: what a shut door takes of the floor."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.grid import GridGeometry

Point = tuple[float, float]
BLOCK_CELLS = 1_000_000
"""So many cells are looked at together, however long a line is."""


def clear_stroke(
    cells: NDArray[np.bool_], geometry: GridGeometry, start: Point, end: Point, half_m: float
) -> None:
    """Clear the cells whose centres lie at most `half_m` from a line; off the grid nothing is done.

    With at least half a cell no way of 4-connected cells leads through the line.
    """
    for rows, columns in _blocks(geometry, start, end, half_m):
        x = geometry.origin_x + (np.arange(columns.start, columns.stop) + 0.5) * geometry.resolution
        y = geometry.origin_y + (np.arange(rows.start, rows.stop) + 0.5) * geometry.resolution
        cells[rows, columns] &= distances(x[None, :], y[:, None], start, end) > half_m


def distances(
    x: NDArray[np.float64], y: NDArray[np.float64], start: Point, end: Point
) -> NDArray[np.float64]:
    """Return how far points lie from a line with two ends, metres."""
    (x0, y0), (x1, y1) = start, end
    dx, dy = x1 - x0, y1 - y0
    square = dx * dx + dy * dy
    along = ((x - x0) * dx + (y - y0) * dy) / square if square > 0 else np.zeros(())
    along = np.clip(along, 0.0, 1.0)
    return np.hypot(x - x0 - along * dx, y - y0 - along * dy)


def _blocks(
    geometry: GridGeometry, start: Point, end: Point, half_m: float
) -> Iterator[tuple[slice, slice]]:
    """Yield the parts of the grid in which a line can lie."""
    cell_m = geometry.resolution
    left, right = _span((start[0], end[0]), half_m, (geometry.origin_x, cell_m, geometry.width))
    low, high = _span((start[1], end[1]), half_m, (geometry.origin_y, cell_m, geometry.height))
    if left >= right:
        return
    rows = max(1, BLOCK_CELLS // (right - left))
    for row in range(low, high, rows):
        yield slice(row, min(high, row + rows)), slice(left, right)


def _span(
    ends: tuple[float, float], half_m: float, axis: tuple[float, float, int]
) -> tuple[int, int]:
    """Return the first cell of an axis that a line can touch, and the one behind the last.

    Args:
        ends: Of the line, along that axis.
        half_m: How far it reaches beside itself.
        axis: Where its first cell begins, metres a cell, how many cells it has.
    """
    origin, cell_m, count = axis
    lowest, highest = min(ends) - half_m, max(ends) + half_m
    first = min(max((lowest - origin) / cell_m - 1, 0), count)
    behind = min(max((highest - origin) / cell_m + 1, 0), count)
    return math.floor(first), math.ceil(behind)
