"""A floor plan's cells as a picture can show them: of a large one, blocks of cells."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.model.events import FloorMap

MOST_CELLS = 4_000_000
"""A picture has less than that; what is more only takes memory."""


def plan_cells(
    floor: FloorMap, *, most_cells: int = MOST_CELLS
) -> tuple[NDArray[np.int8], tuple[float, float, float, float]]:
    """Return cells, the lowest y first, and what they cover: x0, x1, y0, y1, metres.

    Of a plan with more cells each stands for a block, and is as its most occupied one: no wall is
    lost.

    Args:
        floor: The plan.
        most_cells: How many a picture may have, about.
    """
    height, width = floor.cells.shape
    stride = max(1, math.ceil(math.sqrt(height * width / most_cells)))
    cells = floor.cells
    if stride > 1:
        rows, columns = np.arange(0, height, stride), np.arange(0, width, stride)
        cells = np.maximum.reduceat(np.maximum.reduceat(cells, rows, axis=0), columns, axis=1)
    side_m = floor.resolution * stride
    return cells, (
        floor.origin_x, floor.origin_x + cells.shape[1] * side_m,
        floor.origin_y, floor.origin_y + cells.shape[0] * side_m,
    )  # fmt: skip
