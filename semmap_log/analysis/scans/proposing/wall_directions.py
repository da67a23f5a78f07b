"""Which way a gap's own wall runs, where that is none of the directions that most walls have.

For floor plans alone: in line with a gap between what beams ended on, furniture stands, too.
"""

from __future__ import annotations

from dataclasses import replace
from math import radians

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.proposing.wall_gaps import ALONG_M, CELL_M, ROW_CELLS, Gaps

Floats = NDArray[np.float64]

TURNS = np.radians(np.arange(-15.0, 15.5, 1.0))
"""Which are tried, rad, from the direction in which the gap was found."""
LEAST_TURN = radians(2.0)
"""Less than that is how well directions are known."""
MORE = 0.1
"""By so much more wall a turned line has to have."""
STEP_M = 3 * CELL_M
"""A wall's cells may lie so far apart."""
THICK_M = (ROW_CELLS + 0.5) * CELL_M


def along_their_walls(gaps: Gaps, points: Floats) -> Gaps:
    """Return gaps turned about their middles to where more wall is in line with them.

    Args:
        gaps: In directions in which many walls run.
        points: (n, 2) m: the middles of the cells that are wall.
    """
    lines, along = gaps.lines.copy(), gaps.along.copy()
    for row, middle in enumerate(gaps.middles):
        theta, width = lines[row, 2:]
        shares = _wall_shares(points - middle, theta + TURNS, width)
        best = int(np.lexsort((np.abs(TURNS), -shares))[0])
        here = shares[len(TURNS) // 2]
        if shares[best] >= here + MORE and abs(TURNS[best]) >= LEAST_TURN:
            turned = theta + TURNS[best]
            ahead = np.array([np.cos(turned), np.sin(turned)])
            lines[row, :3] = *(middle - width / 2 * ahead), turned
            along[row] = max(along[row], shares[best])
    return replace(gaps, lines=lines, along=along)


def _wall_shares(offsets: Floats, angles: Floats, width: float) -> Floats:
    """Return for each angle the share of the line through (0, 0), next to the gap, that is wall."""
    near = offsets[np.hypot(*offsets.T) < width / 2 + ALONG_M + THICK_M]
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    along = near[:, 0] * c + near[:, 1] * s
    across = near[:, 1] * c - near[:, 0] * s
    beyond = np.abs(along) - width / 2
    is_on = (np.abs(across) <= THICK_M) & (beyond >= 0) & (beyond < ALONG_M)
    steps = round(ALONG_M / STEP_M)
    angle, point = np.nonzero(is_on)
    step = np.minimum((beyond[angle, point] / STEP_M).astype(int), steps - 1)
    side = along[angle, point] > 0
    seen = np.zeros((len(angles), 2, steps), bool)
    seen[angle, side.astype(int), step] = True
    shares: Floats = seen.mean((1, 2))
    return shares
