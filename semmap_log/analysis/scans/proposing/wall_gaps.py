"""Gaps of a door's width in walls: where a wall stops and goes on in the same line.

Walls are points. They are turned by each direction in which walls run, so that a wall lies along
the rows of a picture; a gap is an empty stretch of a row between two occupied ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

CELL_M = 0.05
LEAST_M, MOST_M = 0.5, 2.4
"""A door's width, as wide as it is between cells that are wall: blurred, they stand into it."""
ROW_CELLS = 2
"""A wall is as thick as so many cells more on both sides of its row: it is not straight."""
HOLE_CELLS = 2
"""A hole so small in a wall is none."""
AROUND_EDGE_M = 0.6
"""On either side of a gap so much of the line is looked at for a wall."""
ALONG_M = 3.0
WALL, POST = 0.7, 0.15
"""So large a share of it is wall on one side, and on the other: a door can be next to a corner."""
DIRECTIONS = 90
"""That are tried, of half a turn: each 2 degrees."""
FOOT = 4
"""A peak is measured from where it is so many steps away."""
PEAK = 0.12
"""Of the highest peak; smaller ones are no direction in which walls run."""
TOGETHER_M = 0.35
"""Gaps whose middles are so near are the same one, seen in neighbouring rows."""


@dataclass(frozen=True, slots=True, eq=False)
class Gaps:
    """Gaps: rows belong together."""

    lines: Floats
    """(n, 4): x, y of the start m, theta rad, width m; as those of doors."""
    walls: Floats
    """(n, 2): share of the line that is wall, beyond the start and beyond the end."""
    along: Floats
    """(n,) the same of `ALONG_M` on both sides together: furniture stands in no long row."""

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.lines)

    def of(self, kept: NDArray[np.generic]) -> Gaps:
        """Return some of them, by their numbers or by a mask."""
        return Gaps(self.lines[kept], self.walls[kept], self.along[kept])

    @property
    def middles(self) -> Floats:
        """(n, 2) m."""
        x, y, theta, width = self.lines.T
        return np.stack([x + width / 2 * np.cos(theta), y + width / 2 * np.sin(theta)], axis=1)


def gaps_in(points: Floats) -> Gaps:
    """Return the gaps in walls, each once; the better ones of those that overlap.

    Args:
        points: (n, 2) m: the middles of the cells that are wall.
    """
    found = [_gaps_along(points, theta) for theta in directions_of(points)]
    if not found:
        return Gaps(np.zeros((0, 4)), np.zeros((0, 2)), np.zeros(0))
    every = Gaps(
        np.concatenate([each.lines for each in found]),
        np.concatenate([each.walls for each in found]),
        np.concatenate([each.along for each in found]),
    )
    return _once(every)


def directions_of(points: Floats) -> list[float]:
    """Return the directions in which walls run, rad in [0, pi): the strongest first."""
    if not len(points):
        return []
    angles = np.arange(DIRECTIONS) * pi / DIRECTIONS
    strength = np.array([_strength(points, theta) for theta in angles])
    beside = np.maximum(np.roll(strength, -1), np.roll(strength, 1))
    height = strength - np.maximum(np.roll(strength, -FOOT), np.roll(strength, FOOT))
    peaks = (strength >= beside) & (height > PEAK * height.max())
    order = np.flatnonzero(peaks)[np.argsort(-height[peaks], kind="stable")]
    return [_sharpened(points, float(angles[i])) for i in order]


def _strength(points: Floats, theta: float) -> float:
    """Return how much the points lie in rows along a direction."""
    across = points[:, 1] * np.cos(theta) - points[:, 0] * np.sin(theta)
    bins = np.floor((across - across.min()) / (2 * CELL_M)).astype(int)
    return float((np.bincount(bins).astype(float) ** 2).sum()) / len(points)


def _sharpened(points: Floats, theta: float) -> float:
    """Return the best direction within half a step of one."""
    step = pi / DIRECTIONS
    near = theta + np.linspace(-step / 2, step / 2, 9)
    return float(near[np.argmax([_strength(points, each) for each in near])]) % pi


def _gaps_along(points: Floats, theta: float) -> Gaps:
    """Return the gaps in walls that run along a direction, row by row."""
    turn = np.array([[np.cos(theta), np.sin(theta)], [-np.sin(theta), np.cos(theta)]])
    turned = points @ turn.T
    beside = round(AROUND_EDGE_M / CELL_M)
    low = np.floor(turned.min(0) / CELL_M) * CELL_M - (beside + 1) * CELL_M
    columns, rows = (np.ceil((turned.max(0) - low) / CELL_M).astype(int) + beside + 2).tolist()
    picture = np.zeros((rows, columns), bool)
    cells = ((turned - low) / CELL_M).astype(int)
    picture[cells[:, 1], cells[:, 0]] = True
    filled = _without_holes(_thick(picture))
    row, first, last = _empty_runs(filled)
    width = (last - first) * CELL_M
    fits = (width >= LEAST_M) & (width <= MOST_M)
    row, first, last = row[fits], first[fits], last[fits]
    sums = np.cumsum(np.pad(filled, ((0, 0), (1, 0))), axis=1, dtype=np.intp)
    walls = _next_to(sums, (row, first, last), AROUND_EDGE_M)
    long = _next_to(sums, (row, first, last), ALONG_M).mean(1)
    good = (walls.max(1, initial=0.0) >= WALL) & (walls.min(1, initial=1.0) >= POST)
    along = low[0] + first[good] * CELL_M
    starts = np.stack([along, low[1] + (row[good] + 0.5) * CELL_M], axis=1) @ turn
    angles = np.full(len(starts), theta)
    widths = (last - first)[good] * CELL_M
    return Gaps(np.column_stack([starts, angles, widths]), walls[good], long[good])


def _next_to(sums: NDArray[np.intp], runs: tuple[NDArray[np.intp], ...], length_m: float) -> Floats:
    """Return (n, 2) the share of the line that is filled, for so far before and after each run."""
    row, first, last = runs
    cells = round(length_m / CELL_M)
    before = sums[row, first] - sums[row, np.maximum(first - cells, 0)]
    after = sums[row, np.minimum(last + cells, sums.shape[1] - 1)] - sums[row, last]
    return np.stack([before, after], axis=1) / cells


def _thick(picture: Bools) -> Bools:
    made: Bools = picture.copy()
    for off in range(1, ROW_CELLS + 1):
        made[off:] |= picture[:-off]
        made[:-off] |= picture[off:]
    return made


def _without_holes(picture: Bools) -> Bools:
    """Return rows whose small holes are filled."""
    row, first, last = _empty_runs(picture)
    small = last - first <= HOLE_CELLS
    steps = np.zeros((picture.shape[0], picture.shape[1] + 1), np.int8)
    np.add.at(steps, (row[small], first[small]), 1)
    np.add.at(steps, (row[small], last[small]), -1)
    filled: Bools = picture | (np.cumsum(steps, axis=1, dtype=np.int8)[:, :-1] > 0)
    return filled


def _empty_runs(picture: Bools) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Return the empty stretches between two occupied ones: row, first column, column after."""
    row, column = np.nonzero(picture)
    same = (row[1:] == row[:-1]) & (column[1:] > column[:-1] + 1)
    return row[:-1][same], column[:-1][same] + 1, column[1:][same]


def _once(gaps: Gaps) -> Gaps:
    """Return each gap once: the one with the most wall, in the middle of the rows that show it."""
    worth = np.round(gaps.walls.mean(1) + gaps.along, 1)
    middles = gaps.middles
    is_left = np.ones(len(gaps), bool)
    kept: list[int] = []
    lines = gaps.lines.copy()
    for i in np.lexsort((gaps.lines[:, 3], -worth)).tolist():
        if not is_left[i]:
            continue
        near = is_left & (np.hypot(*(middles - middles[i]).T) < TOGETHER_M)
        alike = near & (worth == worth[i]) & (lines[:, 2] == lines[i, 2])
        lines[i, :2] += _across(middles[alike] - middles[i], lines[i, 2])
        is_left &= ~near
        kept.append(i)
    return Gaps(lines, gaps.walls, gaps.along).of(np.array(kept, int))


def _across(offsets: Floats, theta: float) -> Floats:
    """Return the mean of offsets, (2,) m, as far as it is square to a direction."""
    square = np.array([-np.sin(theta), np.cos(theta)])
    return square * float((offsets @ square).mean())
