"""Where the robot is, by a topic: instead of TF from the map, and how sure it is of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from semmap_log.interop.topics.link_history import LinkPose
from semmap_log.interop.topics.rotations import inverse, product, rotated, unit
from semmap_log.interop.topics.topic_reader import deviations, yaw_of
from semmap_log.interop.topics.transforms import TransformTree, stamp_ns

SPREAD_HOLDS_NS = 60 * 10**9
"""A covariance counts for scans up to so long before and after it."""
WAIT_NS = 2 * 10**9
"""A pose without odometry when another comes that is so far from it counts for nothing."""


@dataclass(slots=True)
class Spreads:
    """How sure the robot last was of its place."""

    _told: tuple[int, float, float] = (0, math.nan, math.nan)

    def take(self, message: Any) -> None:
        """Take in a pose; one without a covariance says nothing."""
        if hasattr(message.pose, "covariance"):
            self._told = (stamp_ns(message.header.stamp), *deviations(message.pose.covariance))

    def at(self, when_ns: int) -> tuple[float, float]:
        """Return the standard deviations in the plane, m, and around z, rad; NaN: not told."""
        told_ns, sd_xy, sd_theta = self._told
        return (
            (sd_xy, sd_theta) if abs(when_ns - told_ns) <= SPREAD_HOLDS_NS else (math.nan, math.nan)
        )


@dataclass(slots=True)
class MapLink:
    """Puts a robot's tree of frames on the map by poses of the robot.

    Where TF has odometry, each pose says where the odometry's frame stands on the map, and that
    holds until the next: the robot's motion in between is its odometry's. Without, the robot was
    between two poses where the line between them leads.
    """

    tree: TransformTree
    map_frame: str
    robot_frame: str
    _waiting: list[tuple[int, LinkPose, Any, int]] = field(default_factory=list)

    def take(self, message: Any, received_ns: int) -> None:
        """Take in a pose in the map's frame: PoseStamped, PoseWithCovarianceStamped or Odometry.

        Raises:
            ValueError: It cannot be.
        """
        covered = hasattr(message.pose, "covariance")
        pose = message.pose.pose if covered else message.pose
        at, turn = pose.position, pose.orientation
        yaw_of(turn)  # refuses what is no rotation
        shift = (at.x, at.y, at.z)
        if not all(map(math.isfinite, shift)):
            raise ValueError(f"a position that is not finite: {shift}")
        stamp = message.header.stamp
        link = LinkPose(shift, unit((turn.x, turn.y, turn.z, turn.w)))
        self._waiting.append((stamp_ns(stamp), link, stamp, received_ns))
        self.settle()

    def settle(self) -> None:
        """Take in the poses for whose moments the odometry has come."""
        while self._waiting:
            when_ns, pose, stamp, received_ns = self._waiting[0]
            root = self._root()
            if root == self.robot_frame:
                self.tree.put(root, self.map_frame, pose, stamp, received_ns)
            else:
                chain = self.tree.chain(root, self.robot_frame)
                moving = self.tree.moving(chain or ())
                if any(not h.stamps or h.stamps[-1] < when_ns for _, h in moving):
                    if abs(self._waiting[-1][0] - when_ns) <= WAIT_NS:
                        return
                elif all(h.stamps[0] <= when_ns for _, h in moving):
                    self._put(root, chain or (), self._waiting[0])
            del self._waiting[0]

    def _root(self) -> str:
        """Return the uppermost frame of the robot's own, the map not counted."""
        chain = self.tree.chain(self.map_frame, self.robot_frame)
        return chain[-1] if chain else self.tree.root(self.robot_frame)

    def _put(self, root: str, chain: tuple[str, ...], told: tuple[int, LinkPose, Any, int]) -> None:
        when_ns, pose, stamp, received_ns = told
        below = self.tree.at(chain, np.array([when_ns], np.int64))
        back = inverse(tuple(float(each[0]) for each in below.turn))  # type: ignore[arg-type]
        turn = product(pose.turn, back)
        shifted = rotated(tuple(float(each[0]) for each in below.shift), turn)  # type: ignore[arg-type]
        x, y, z = (a - b for a, b in zip(pose.shift, shifted, strict=True))
        link = LinkPose((x, y, z), turn)
        self.tree.put(root, self.map_frame, link, stamp, received_ns, holds=True)
