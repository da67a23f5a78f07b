"""The cells of a polygon: those that its sides go through, and those whose middle lies within."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.analysis.costmap_2d.lines import draw_lines

FARTHEST_CELL = 1e8
"""What starts or ends further from the origin, in cells, is not drawn."""


def area_cells(geometry: GridGeometry, corners: Sequence[tuple[float, float]]) -> NDArray[np.int64]:
    """Return the flat indices of a polygon's cells on the map, ascending.

    Within is what an odd number of sides lie beside (the even-odd rule): the inside of a figure
    that crosses itself has holes. Its sides are drawn as doors' lines are, so that the thinnest
    polygon is seen.

    Args:
        geometry: The grid.
        corners: (x, y), metres, frame `map`; the last is joined to the first. One that is not
            finite, or too far away, and nothing is drawn.
    """
    origin = np.array([geometry.origin_x, geometry.origin_y])
    with np.errstate(over="ignore", invalid="ignore"):
        points = (np.asarray(corners, np.float64) - origin) / geometry.resolution
    if not (np.abs(points) <= FARTHEST_CELL).all():  # or NaN
        return np.empty(0, np.int64)
    starts = np.floor(points).astype(np.int64)
    sides = draw_lines(starts, np.roll(starts, -1, axis=0), geometry.shape)
    inside = np.zeros(geometry.shape, np.bool_)
    inside[sides.y, sides.x] = True
    low = np.maximum(starts.min(axis=0), 0)
    high = np.minimum(starts.max(axis=0) + 1, (geometry.width, geometry.height))
    if (low < high).all():
        columns, rows = (np.arange(*span) + 0.5 for span in zip(low, high, strict=True))
        inside[low[1] : high[1], low[0] : high[0]] |= _within(points, columns, rows)
    flat: NDArray[np.int64] = np.flatnonzero(inside)
    return flat


def _within(
    points: NDArray[np.float64], columns: NDArray[np.float64], rows: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Tell of points of a grid, (rows, columns), which lie within a polygon."""
    within = np.zeros((len(rows), len(columns)), np.bool_)
    for (x0, y0), (x1, y1) in zip(points, np.roll(points, -1, axis=0), strict=True):
        crosses = (y0 <= rows) != (y1 <= rows)
        if crosses.any():
            at = x0 + (rows[crosses] - y0) * (x1 - x0) / (y1 - y0)
            within[crosses] ^= columns[None, :] < at[:, None]
    return within
