"""A turn about the origin, then a shift: from one map's frame to another's."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from semmap_log.errors import LogError

EXPECTED = "DX,DY,THETA (metres, metres, radians)"


@dataclass(frozen=True, slots=True)
class RigidTransform:
    """A point (x, y) goes to (dx, dy) + R(theta) (x, y); lengths stay as they are.

    Raises:
        LogError: A number is not finite.
    """

    dx: float = 0.0
    """Metres."""
    dy: float = 0.0
    theta: float = 0.0
    """Radians, counterclockwise."""

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (self.dx, self.dy, self.theta))):
            raise LogError(f"expected finite metres and radians, got {self.as_list()}.")

    @classmethod
    def parse(cls, text: str) -> RigidTransform:
        """Return the transform of `dx,dy,theta`.

        Raises:
            LogError: It is not such a text.
        """
        try:
            dx, dy, theta = map(float, text.split(","))
        except ValueError:
            raise LogError(f"{text!r}: expected {EXPECTED}, such as 12.5,-3,1.5708.") from None
        return cls(dx, dy, theta)

    def as_list(self) -> list[float]:
        """Return [dx, dy, theta]."""
        return [self.dx, self.dy, self.theta]

    def moved(self, x: Any, y: Any, theta: Any) -> tuple[Any, Any, Any]:
        """Return poses in the other frame, angles in [-pi, pi); numbers, or columns of them."""
        if self == RigidTransform():
            return x, y, theta
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        turned = np.remainder(theta + self.theta + math.pi, 2 * math.pi) - math.pi
        return self.dx + cos * x - sin * y, self.dy + sin * x + cos * y, turned


def yaw_of(orientation: Any) -> float:
    """Return the angle around z of a quaternion, radians.

    Raises:
        ValueError: It is no rotation: its length is not 1, as of one that was never set.
    """
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    length = math.sqrt(x * x + y * y + z * z + w * w)
    if not abs(length - 1) < LENGTH_OFF:  # NaN, too
        raise ValueError(f"an orientation of length {length:g}, which is no rotation")
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


LENGTH_OFF = 0.01
"""tf2 takes no quaternion whose length is further from 1."""
