"""Where a robot's map lies in the building: a turn about its origin, then a shift."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from semmap_log.errors import LogError


@dataclass(frozen=True, slots=True)
class MapTransform:
    """From a log's frame `map` to that of the building."""

    dx: float = 0.0
    """Metres."""
    dy: float = 0.0
    theta: float = 0.0
    """Radians, counterclockwise."""

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (self.dx, self.dy, self.theta))):
            raise LogError(f"expected finite metres and radians, got {self.as_list()}.")

    @classmethod
    def parse(cls, text: str) -> tuple[str, MapTransform]:
        """Return the log's name, and its transform, of `log=dx,dy,theta`.

        Raises:
            LogError: It is none.
        """
        name, _, numbers = text.rpartition("=")
        try:
            dx, dy, theta = map(float, numbers.split(","))
        except ValueError:
            name = ""
        if not name:
            raise LogError(
                f"{text!r}: expected LOG=DX,DY,THETA (metres, metres, radians), such as "
                "tug2=12.5,-3,1.5708."
            )
        return name, cls(dx, dy, theta)

    def as_list(self) -> list[float]:
        """Return it as the definition holds it."""
        return [self.dx, self.dy, self.theta]

    def moved(self, x: Any, y: Any, theta: Any) -> tuple[Any, Any, Any]:
        """Return poses in the building's frame; numbers, or columns of them."""
        if self == MapTransform():
            return x, y, theta
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        turned = np.remainder(theta + self.theta + math.pi, 2 * math.pi) - math.pi
        return self.dx + cos * x - sin * y, self.dy + sin * x + cos * y, turned
