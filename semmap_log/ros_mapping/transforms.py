"""The tree of frames that TF tells: each link as it came last.

tf2 interpolates between two moments; here the latest of each link counts, which is behind by no
more than the time between two messages.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from semmap_log.ros_mapping.topic_reader import yaw_of

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
"""x, y, z, w."""

LONGEST_CHAIN = 100


@dataclass(frozen=True, slots=True)
class _Link:
    parent: str
    translation: Vector
    rotation: Quaternion
    stamp: Any
    received_ns: int
    is_static: bool


@dataclass(frozen=True, slots=True)
class _Rotation:
    x: float
    y: float
    z: float
    w: float


class TransformTree:
    """Child frame -> its latest transform to its parent."""

    def __init__(self) -> None:
        self._links: dict[str, _Link] = {}

    def take(self, transform: Any, received_ns: int, *, is_static: bool) -> str:
        """Take in a geometry_msgs/TransformStamped; return its child frame.

        Raises:
            ValueError: It is no transform.
        """
        child = transform.child_frame_id.removeprefix("/")
        shift, turn = transform.transform.translation, transform.transform.rotation
        translation = (shift.x, shift.y, shift.z)
        yaw_of(turn)  # refuses what is no rotation
        if not all(math.isfinite(value) for value in translation):
            raise ValueError(f"a translation that is not finite: {translation}")
        self._links[child] = _Link(
            transform.header.frame_id.removeprefix("/"),
            translation,
            (turn.x, turn.y, turn.z, turn.w),
            transform.header.stamp,
            received_ns,
            is_static,
        )
        return str(child)

    def chain(self, top: str, frame: str) -> tuple[str, ...] | None:
        """Return the children on the way from a frame up to another; None: there is no way."""
        frames: list[str] = []
        while frame != top:
            link = self._links.get(frame)
            if link is None or len(frames) > LONGEST_CHAIN:  # or a circle
                return None
            frames.append(frame)
            frame = link.parent
        return tuple(frames)

    def pose(self, chain: Sequence[str]) -> tuple[float, float, float]:
        """Return x, y and the angle around z of the chain's lowest frame in its uppermost."""
        at: Vector = (0.0, 0.0, 0.0)
        turn: Quaternion = (0.0, 0.0, 0.0, 1.0)
        for frame in chain:
            link = self._links[frame]
            rotated = _rotated(at, link.rotation)
            at = (
                rotated[0] + link.translation[0],
                rotated[1] + link.translation[1],
                rotated[2] + link.translation[2],
            )
            turn = _product(link.rotation, turn)
        return at[0], at[1], yaw_of(_Rotation(*turn))

    def stamp(self, chain: Sequence[str]) -> Any:
        """Return the stamp of the link that came last: of a robot that drives, its odometry's."""
        moving = [self._links[frame] for frame in chain if not self._links[frame].is_static]
        return max(moving, key=lambda link: link.received_ns).stamp if moving else None

    def late_s(self, chain: Sequence[str]) -> float:
        """Return how long before the last of the links the first of them came, seconds."""
        came = [
            self._links[frame].received_ns for frame in chain if not self._links[frame].is_static
        ]
        return (max(came) - min(came)) / 1e9 if came else 0.0


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the rotation by b, then by a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _rotated(vector: Vector, turn: Quaternion) -> Vector:
    x, y, z, w = turn
    rotated = _product(_product(turn, (*vector, 0.0)), (-x, -y, -z, w))
    return rotated[:3]
