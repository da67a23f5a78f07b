"""What a laser can meet, as lines seen from above, and of what each is made."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Surface(IntEnum):
    """Of what a line is made: it decides how much light comes back."""

    PAINT = 0
    WOOD = 1
    DARK = 2
    SHINY = 3
    CLOTH = 4
    GLASS = 5


REFLECTIVITY = np.array([0.8, 0.5, 0.04, 0.35, 0.3, 0.1])
"""Of each surface, diffuse, at some 900 nm."""


@dataclass(frozen=True, slots=True)
class Lines:
    """Lines on the floor plan, rows belong together."""

    ends: Floats
    """(n, 4): x0, y0, x1, y1 m, frame `map`."""
    surface: NDArray[np.int8]
    """(n,)"""

    def __len__(self) -> int:
        return len(self.ends)

    def __getitem__(self, which: NDArray[np.bool_]) -> Lines:
        return Lines(self.ends[which], self.surface[which])


NO_LINES = Lines(np.empty((0, 4)), np.empty(0, np.int8))


def outline(corners: Floats | Sequence[Sequence[float]], surface: Surface) -> Lines:
    """Return the sides of a polygon."""
    points = np.asarray(corners, float)
    ends = np.concatenate([points, np.roll(points, -1, axis=0)], axis=1)
    return Lines(ends, np.full(len(ends), surface, np.int8))


def joined(parts: Iterable[Lines]) -> Lines:
    """Return all the lines of these."""
    some = [part for part in parts if len(part)]
    if not some:
        return NO_LINES
    return Lines(
        np.concatenate([part.ends for part in some]),
        np.concatenate([part.surface for part in some]),
    )


def bar(start: Floats, end: Floats, *, left_m: float, right_m: float, surface: Surface) -> Lines:
    """Return the outline of a slab along a line, so far to its left and its right."""
    along = end - start
    left = np.array([-along[1], along[0]]) / (np.hypot(*along) or 1.0)
    return outline(
        [start - right_m * left, end - right_m * left, end + left_m * left, start + left_m * left],
        surface,
    )


def box(middle: Floats, size_m: tuple[float, float], turn: float, surface: Surface) -> Lines:
    """Return the outline of a box: along and across, turned by so many radians."""
    c, s = np.cos(turn), np.sin(turn)
    half = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * size_m / 2
    return outline(middle + half @ np.array([[c, s], [-s, c]]), surface)
