"""Labels on a plan: what they say, and where they go so that none covers another."""

from __future__ import annotations

import math

import numpy as np

NEAR_PX = (5, 12)
FAR_PX = (20, 32, 48, 70, 100)
DIRECTIONS = 16

Point = tuple[float, float]
"""(x, y), pixels, y down."""
Box = tuple[int, int, int, int]
"""Left, top, right, bottom: pixels left <= x < right, top <= y < bottom."""


class LabelPlaces:
    """Gives out places in a picture, one label after the other: near first, then farther away."""

    def __init__(self, width: int, height: int) -> None:
        self._taken = np.zeros((height, width), np.bool_)

    def keep_clear(self, start: Point, end: Point, *, margin: int) -> None:
        """Let no label come nearer than `margin` pixels to a line."""
        steps = max(1, math.ceil(math.dist(start, end) / max(1, margin)))
        for share in np.linspace(0, 1, steps + 1):
            x, y = (int(a + share * (b - a)) for a, b in zip(start, end, strict=True))
            self._taken[max(0, y - margin) : max(0, y + margin + 1),
                        max(0, x - margin) : max(0, x + margin + 1)] = True  # fmt: skip

    def place(
        self, at: Point, size: tuple[int, int], *, across: float, distances: tuple[int, ...]
    ) -> Box | None:
        """Return a free place for a label, and take it.

        Args:
            at: What it labels.
            size: (width, height) of the label.
            across: The direction in which to look first, and then its opposite; radians, y down.
            distances: How far away it may be, pixels; the first at which there is room.

        Returns:
            The nearest place that is free; None where there is none.
        """
        for distance in distances:
            for angle in _turns(across):
                box = _beside(at, size, distance, angle)
                if self._is_free(box):
                    left, top, right, bottom = box
                    self._taken[top:bottom, left:right] = True
                    return box
        return None

    def _is_free(self, box: Box) -> bool:
        left, top, right, bottom = box
        height, width = self._taken.shape
        inside = left >= 0 and top >= 0 and right <= width and bottom <= height
        return inside and not self._taken[top:bottom, left:right].any()


def _turns(across: float) -> list[float]:
    """Return directions all around: to both sides first, then ever farther from there."""
    quarter = DIRECTIONS // 4
    aside = [0, *(sign * step for step in range(1, quarter + 1) for sign in (1, -1))]
    return [
        across + side + step * 2 * math.pi / DIRECTIONS for step in aside for side in (0, math.pi)
    ]


def _beside(at: Point, size: tuple[int, int], distance: float, angle: float) -> Box:
    """Return the label's box, so that its edge is that far from the point in that direction."""
    (x, y), (width, height) = at, size
    cos, sin = math.cos(angle), math.sin(angle)
    # How far the box reaches from its middle toward the point.
    reach = min(
        width / 2 / abs(cos) if abs(cos) > 1e-9 else math.inf,
        height / 2 / abs(sin) if abs(sin) > 1e-9 else math.inf,
    )
    left = round(x + (distance + reach) * cos - width / 2)
    top = round(y + (distance + reach) * sin - height / 2)
    return left, top, left + width, top + height


def without_level(name: str, level: str) -> str:
    """Return a door's name without the level in front, which is told by the plan it is on."""
    return name.removeprefix(level).lstrip(" ._-:/") or name
