"""A costmap's cells as shades for people: clear on a grey print and for colour-blind eyes.

Light is cheap, dark is dear: free is white, inflation runs from pale to deep violet, inscribed is
darker than all of it, lethal is black. Unknown is hatched, as no cost is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import (
    FREE_SPACE,
    INSCRIBED,
    LETHAL,
    NO_INFORMATION,
    to_occupancy,
)
from semmap_log.views.palette import (
    COST_FREE,
    COST_HATCH,
    COST_INSCRIBED,
    COST_LEAST,
    COST_LETHAL,
    COST_MOST,
    COST_UNKNOWN,
)

Grid = NDArray[np.uint8] | NDArray[np.int8]

HATCH_PX = 8
LEVELS = 24
"""Of the violet: as many as an eye can tell, and few enough that the file stays small."""


def costs_of(grid: Grid) -> NDArray[np.uint8]:
    """Return the grid as costs; map values (int8) as the least cost that is published so.

    A map value that is none (below -1, above 100) is lethal, as the static layer takes it.
    """
    if grid.dtype == np.uint8:
        return np.asarray(grid, np.uint8)
    published = to_occupancy(np.arange(256, dtype=np.uint8)).view(np.uint8)
    table = np.full(256, LETHAL, np.uint8)
    table[published[::-1]] = np.arange(255, -1, -1, dtype=np.uint8)
    costs: NDArray[np.uint8] = table[grid.view(np.uint8)]
    return costs


def shaded(costs: NDArray[np.uint8], scale: int) -> NDArray[np.uint8]:
    """Return the cells as a picture, its top row first.

    Args:
        costs: (height, width), row 0 at the lowest y.
        scale: Pixels a cell; or, below 0, so many cells a pixel: the dearest of them shows, so that
            no wall and no door is lost.

    Returns:
        uint8, (rows, columns, 3).
    """
    if scale < 0:
        costs = _dearest(costs, -scale)
    picture = _shades()[costs[::-1]]
    if scale > 1:
        picture = picture.repeat(scale, axis=0).repeat(scale, axis=1)
        costs = costs.repeat(scale, axis=0).repeat(scale, axis=1)
    rows, columns = picture.shape[:2]
    diagonal = np.add.outer(np.arange(rows), np.arange(columns)) % HATCH_PX < HATCH_PX // 4
    picture[(costs[::-1] == NO_INFORMATION) & diagonal] = COST_HATCH
    return picture


def _dearest(costs: NDArray[np.uint8], cells: int) -> NDArray[np.uint8]:
    """Return one cost for each block of cells; what lies beyond the edge is unknown."""
    height, width = costs.shape
    # Unknown is the least of all: a block that knows anything shows it.
    ranked = costs + np.uint8(1)
    rows = np.maximum.reduceat(ranked, np.arange(0, height, cells), axis=0)
    blocks = np.maximum.reduceat(rows, np.arange(0, width, cells), axis=1)
    least: NDArray[np.uint8] = np.subtract(blocks, 1, dtype=np.uint8)
    return least


def _shades() -> NDArray[np.uint8]:
    """Return the colour of each cost, (256, 3)."""
    costs = np.arange(256)
    share = (costs - 1) * LEVELS // 252 / (LEVELS - 1)
    least, most = np.array(COST_LEAST), np.array(COST_MOST)
    table: NDArray[np.float64] = np.rint(least + np.clip(share, 0, 1)[:, None] * (most - least))
    for cost, colour in (
        (FREE_SPACE, COST_FREE),
        (INSCRIBED, COST_INSCRIBED),
        (LETHAL, COST_LETHAL),
        (NO_INFORMATION, COST_UNKNOWN),
    ):
        table[cost] = colour
    return table.astype(np.uint8)
