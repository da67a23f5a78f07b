"""Where a gap in a wall really begins and ends: at its jambs, by what beams ended on.

Poses err, so what beams ended on is blurred, and a gap between cells that are wall is too narrow by
the blur on both sides. So the blur is fitted, too: beyond a jamb as many beams end everywhere, on
the jamb's face some more, and both are blurred alike.
"""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.proposing.swept_cells import SweptCells
from semmap_log.analysis.scans.proposing.wall_gaps import Gaps

Floats = NDArray[np.float64]

ACROSS_M = 0.15
"""So far from the line on both sides ends of beams are those on its wall."""
INSIDE_M, OUTSIDE_M = 0.25, 0.45
"""So far around a gap's end they are looked at."""
SHIFTS_M = np.arange(-0.1, 0.2001, 0.01)
"""Where the jamb may be, farther out than the gap's end (+) or not so far."""
BLURS_M = (0.02, 0.035, 0.05, 0.065, 0.08, 0.1, 0.12)
"""Standard deviations of where beams ended."""
LEAST_ENDS = 20
"""Fewer say nothing."""


def at_jambs(gaps: Gaps, swept: SweptCells) -> Gaps:
    """Return gaps whose lines go from jamb to jamb; an end without enough beams stays."""
    lines = np.array([_line(swept, row) for row in gaps.lines]).reshape(-1, 4)
    return replace(gaps, lines=lines)


def _line(swept: SweptCells, line: Floats) -> list[float]:
    x, y, theta, width = line.tolist()
    along, ends = _ends_along(swept, line)
    start, end = -jamb(-along, ends), width + jamb(along - width, ends)
    return [x + start * cos(theta), y + start * sin(theta), theta, end - start]


def _ends_along(swept: SweptCells, line: Floats) -> tuple[Floats, Floats]:
    """Return how far along a line its cells lie, m, and how many beams ended in each."""
    x, y, theta, width = line.tolist()
    c, s = cos(theta), sin(theta)
    middle = x + width / 2 * c, y + width / 2 * s
    cells, at_x, at_y = swept.around(middle, width / 2 + OUTSIDE_M + ACROSS_M)
    along, off = (at_x - x) * c + (at_y - y) * s, (at_y - y) * c - (at_x - x) * s
    is_on = np.abs(off) <= ACROSS_M
    return along[is_on], cells[is_on].astype(float)


def jamb(places: Floats, ends: Floats) -> float:
    """Return how far beyond a gap's end its jamb stands, m, by least squares.

    Args:
        places: Of cells along the line, m: 0 at the gap's end, more in the wall.
        ends: How many beams ended in each.
    """
    is_near = (places > -INSIDE_M) & (places < OUTSIDE_M)
    places, ends = places[is_near], ends[is_near]
    if ends.sum() < LEAST_ENDS:
        return 0.0
    misfits = [_misfits(places, ends, blur) for blur in BLURS_M]
    best = np.unravel_index(np.argmin(misfits), (len(BLURS_M), len(SHIFTS_M)))
    return float(SHIFTS_M[best[1]])


def _misfits(places: Floats, ends: Floats, blur: float) -> Floats:
    """Return for each shift how much of the squares no wall and no jamb of it explain."""
    off = (places[None] - SHIFTS_M[:, None]) / blur
    wall, face = _normal(off), np.exp(-(off**2) / 2)
    ww, ff, wf = (wall**2).sum(1), (face**2).sum(1), (wall * face).sum(1)
    w, f = wall @ ends, face @ ends
    both = np.maximum(ww * ff - wf**2, 1e-12)
    of_wall, of_face = (ff * w - wf * f) / both, (ww * f - wf * w) / both
    explained = np.where(
        (of_wall >= 0) & (of_face >= 0),
        of_wall * w + of_face * f,
        np.maximum(w**2 / np.maximum(ww, 1e-12), f**2 / np.maximum(ff, 1e-12)),
    )
    misfits: Floats = -explained
    return misfits


def _normal(x: Floats) -> Floats:
    """Return the normal distribution's share below x, within 0.0005."""
    share: Floats = (1 + np.tanh(sqrt(2 / pi) * (x + 0.044715 * x**3))) / 2
    return share
