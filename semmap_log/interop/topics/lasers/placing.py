"""A scan whose moments the tree of frames covers in, the scan on the map out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.interop.topics.lasers.laser_sweeps import Sweep, Unusable
from semmap_log.interop.topics.lasers.point_clouds import MAX_RANGE_M, Cloud, cut
from semmap_log.interop.topics.link_history import LinkPose
from semmap_log.interop.topics.rotations import inverse, product, rotated, yaw
from semmap_log.interop.topics.transforms import TransformTree

FARTHEST_TILT = math.radians(45)
LEVEL_TILT = math.radians(1.5)
LOWEST_M, HIGHEST_M = 0.05, 2.0
"""Over the floor a door's leaf is; what a tilted beam meets elsewhere is no door."""
REACH_M = 6.0
"""A beam that did not come back is asked how high it is so far away."""


@dataclass(frozen=True, slots=True)
class Where:
    """The way from a sensor to the map."""

    tree: TransformTree
    chain: tuple[str, ...]
    """From the sensor up to the map."""
    robot_frame: str

    @property
    def _above_robot(self) -> tuple[str, ...]:
        """Return the chain from the robot up; from the sensor, where the robot is not in it."""
        if self.robot_frame in self.chain:
            return self.chain[self.chain.index(self.robot_frame) :]
        return self.chain

    def sensor(self, times: NDArray[np.int64]) -> LinkPose:
        """Return where the sensor was on the map, as arrays (n,)."""
        return self.tree.at(self.chain, times)

    def robot(self, when_ns: int) -> LinkPose:
        """Return where the robot was, as arrays (1,)."""
        return self.tree.at(self._above_robot, np.array([when_ns], np.int64))


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """The beams of a scan on the map, and the robot."""

    origins: NDArray[np.float64]
    """(b, 2) m."""
    bearings: NDArray[np.float64]
    """(b,) rad, unwrapped."""
    ranges: NDArray[np.float64]
    """(b,) m along the floor."""
    max_range: float
    robot: tuple[float, float, float]
    """x, y, theta at the scan's stamp."""


def place_sweep(sweep: Sweep, where: Where) -> Placed | Unusable:
    """Return the beams of a laser, each at its own moment."""
    at = where.sensor(sweep.stamp_ns + sweep.after_ns)
    cos, sin = np.cos(sweep.angles), np.sin(sweep.angles)
    dx, dy, dz = rotated((cos, sin, np.zeros_like(cos)), at.turn)
    level = np.hypot(dx, dy)
    tilt = float(np.arcsin(np.clip(np.abs(dz).max(), 0, 1)))
    if tilt > FARTHEST_TILT:
        return Unusable("a laser that looks up or down", f"by {math.degrees(tilt):.0f} degrees")
    bearings = np.unwrap(np.arctan2(dy, dx))
    steps = np.diff(bearings)
    if not ((steps > 0).all() or (steps < 0).all()):
        return Unusable("a scan during which the robot turned faster than the laser")
    robot, ranges = where.robot(sweep.stamp_ns), sweep.ranges
    if tilt > LEVEL_TILT:
        ranges = _of_doors(ranges, at.shift[2] - robot.shift[2], dz)
    return Placed(
        origins=np.stack([at.shift[0], at.shift[1]], axis=1),
        bearings=bearings,
        ranges=ranges * level,
        max_range=sweep.max_range,
        robot=_flat(robot),
    )


def _of_doors(
    ranges: NDArray[np.float64], height: NDArray[np.float64], rise: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return ranges, NaN where a tilted beam ended, or would have, on the floor or above a door."""
    ends = height + np.where(np.isfinite(ranges), ranges, REACH_M) * rise
    return np.where((ends < LOWEST_M) | (ends > HIGHEST_M), np.nan, ranges)


def place_cloud(cloud: Cloud, where: Where, heights: tuple[float, float]) -> Placed:
    """Return the nearest points at some heights over the robot's floor, as beams."""
    sensor = where.sensor(np.array([cloud.stamp_ns], np.int64))
    robot = where.robot(cloud.stamp_ns)
    back = inverse(robot.turn)
    dx, dy, dz = (a - b for a, b in zip(sensor.shift, robot.shift, strict=True))
    origin = np.concatenate(rotated((dx, dy, dz), back))
    x, y, z = rotated(tuple(cloud.points.T), product(back, sensor.turn))
    points = np.stack([x, y, z], axis=1) + origin
    bearings, ranges = cut(points, origin, heights)
    place = np.array([float(sensor.shift[0][0]), float(sensor.shift[1][0])])
    return Placed(
        origins=np.broadcast_to(place, (len(bearings), 2)),
        bearings=bearings + float(yaw(robot.turn)[0]),
        ranges=ranges,
        max_range=MAX_RANGE_M,
        robot=_flat(robot),
    )


def _flat(pose: LinkPose) -> tuple[float, float, float]:
    x, y, _ = pose.shift
    return float(x[0]), float(y[0]), float(yaw(pose.turn)[0])
