"""Where the beams of a scan end: exact, for many lines at once.

Each line is met only with the beams that can reach it, which follows from the bearings of its two
ends: some ten thousand pairs a scan in place of a million.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from patrol_sim.laser_surfaces import Floats

Whole = NDArray[np.int64]

NEAR_M = 1e-6
"""A beam does not end on the line that it starts from."""
NOTHING = -1


@dataclass(frozen=True, slots=True)
class Hits:
    """The nearest hit of each beam."""

    ranges: Floats
    """(b,) m; inf: nothing."""
    line: Whole
    """(b,) which line; `NOTHING`: none."""
    cosine: Floats
    """(b,) of the incidence: 1 straight on, 0 grazing."""
    along_m: Floats
    """(b,) m from the start of the line."""


def cast(origins: Floats, bearings: Floats, ends: Floats, *, most_m: float) -> Hits:
    """Return what each beam meets first.

    Args:
        origins: (b, 2) m.
        bearings: (b,) rad, ascending, over at most one turn.
        ends: (n, 4) m, lines.
        most_m: Nothing farther is looked for.
    """
    middle = origins.mean(axis=0)
    spread = float(np.hypot(*(origins - middle).T).max())
    near = distances(middle, ends) <= most_m + spread
    kept = np.flatnonzero(near)
    line, beam = _pairs(bearings, middle, spread, ends[kept])
    return _nearest(origins, bearings, ends, (kept[line], beam), most_m)


def cast_all(origins: Floats, bearings: Floats, ends: Floats, *, most_m: float) -> Hits:
    """Return the same for beams of any origins, in any order: each is tried with each line."""
    beam, line = np.divmod(np.arange(len(origins) * len(ends)), max(len(ends), 1))
    return _nearest(origins, bearings, ends, (line, beam), most_m)


def distances(point: Floats, ends: Floats) -> Floats:
    """Return how far each line is from a point."""
    start, along = ends[:, :2] - point, ends[:, 2:] - ends[:, :2]
    length = (along**2).sum(axis=1)
    share = np.clip(-(start * along).sum(axis=1) / np.where(length > 0, length, 1.0), 0, 1)
    nearest = start + share[:, None] * along
    distances: Floats = np.hypot(nearest[:, 0], nearest[:, 1])
    return distances


def _pairs(bearings: Floats, middle: Floats, spread: float, ends: Floats) -> tuple[Whole, Whole]:
    """Return (line, beam) for all beams whose bearing lies between those of a line's ends."""
    start, end = ends[:, :2] - middle, ends[:, 2:] - middle
    from_, to = np.arctan2(start[:, 1], start[:, 0]), np.arctan2(end[:, 1], end[:, 0])
    turn = np.mod(to - from_ + math.pi, math.tau) - math.pi
    distance = distances(middle, ends)
    # A beam does not start in the middle of them all: by so much may its bearing differ.
    slack = 1e-9 + np.arcsin(np.minimum(1.0, spread / np.maximum(distance, 1e-9)))
    low, high = from_ + np.minimum(turn, 0) - slack, from_ + np.maximum(turn, 0) + slack
    around = distance <= 2 * spread + NEAR_M
    low[around], high[around] = bearings[0], bearings[0] + math.tau
    first = bearings[0]
    shifted = first + np.mod(low - first, math.tau)
    high = high + (shifted - low)
    lines, beams = [], []
    for back in (0.0, math.tau):
        begin = np.searchsorted(bearings, shifted - back, side="left")
        count = np.searchsorted(bearings, high - back, side="right") - begin
        line = np.repeat(np.arange(len(ends)), count)
        within = np.arange(len(line)) - np.repeat(np.cumsum(count) - count, count)
        lines.append(line)
        beams.append(begin[line] + within)
    return np.concatenate(lines), np.concatenate(beams)


def _nearest(
    origins: Floats, bearings: Floats, ends: Floats, pairs: tuple[Whole, Whole], most_m: float
) -> Hits:
    line, beam = pairs
    ux, uy = np.cos(bearings)[beam], np.sin(bearings)[beam]
    ax, ay = (ends[line, :2] - origins[beam]).T
    ex, ey = (ends[line, 2:] - ends[line, :2]).T
    cross = ux * ey - uy * ex
    with np.errstate(divide="ignore", invalid="ignore"):
        far = (ax * ey - ay * ex) / cross
        share = (ax * uy - ay * ux) / cross
        met = (far > NEAR_M) & (far <= most_m) & (share >= 0) & (share <= 1)
    line, beam, far, share = line[met], beam[met], far[met], share[met]
    length = np.hypot(ex[met], ey[met])
    cosine = np.abs(cross[met]) / length
    order = np.argsort(-far, kind="stable")  # of what is written twice, the last stays
    found = Hits(
        np.full(len(origins), math.inf), np.full(len(origins), NOTHING, np.int64),
        np.zeros(len(origins)), np.zeros(len(origins)),
    )  # fmt: skip
    which = beam[order]
    found.ranges[which], found.line[which] = far[order], line[order]
    found.cosine[which], found.along_m[which] = cosine[order], (share * length)[order]
    return found
