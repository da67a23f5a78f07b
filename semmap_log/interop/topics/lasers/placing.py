"""A laser's message in, the scan on the map out, once the tree of frames covers its moments.

A sensor_msgs/LaserScan is read in the laser's own frame, or refused with the reason. A
sensor_msgs/PointCloud2, cut at a band of heights, becomes the beams of a planar laser. The robot's
place comes from TF, or from a topic of poses with their uncertainty.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.model.rigid_transform import yaw_of
from semmap_log.interop.topics.topic_reader import deviations
from semmap_log.interop.topics.transforms import (
    LinkPose,
    TransformTree,
    inverse,
    product,
    rotated,
    stamp_ns,
    unit,
    yaw,
)

FARTHEST_TILT = math.radians(45)
LEVEL_TILT = math.radians(1.5)
LOWEST_M, HIGHEST_M = 0.05, 2.0
"""Over the floor a door's leaf is; what a tilted beam meets elsewhere is no door."""
REACH_M = 6.0
"""Distance at which the height of a beam without an echo is checked."""


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
        """Return the standard deviations in the plane, m, and around z, rad; NaN: not given."""
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


MOST_POINTS = 4_000_000
BEAMS = 720
"""Half a degree each: the nearest point in it counts."""
LEAST_RANGE_M = 0.2
"""Nearer points are the robot itself."""
MAX_RANGE_M = 100.0
_FLOATS = {7: "f4", 8: "f8"}
"""sensor_msgs/PointField: FLOAT32, FLOAT64."""


@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """The points of one cloud that are finite."""

    frame: str
    stamp_ns: int
    points: NDArray[np.float64]
    """(n, 3) m, in the sensor's frame."""


def cloud_of(message: Any) -> Cloud | Unusable:
    """Return the points of a PointCloud2."""
    rows, columns = int(message.height), int(message.width)
    count, size = rows * columns, int(message.point_step)
    if not 0 < count <= MOST_POINTS:
        return Unusable("a cloud of no or too many points", f"{count:,}")
    fields = {str(field.name): field for field in message.fields}
    if not all(name in fields and int(fields[name].datatype) in _FLOATS for name in "xyz"):
        return Unusable("a cloud without x, y, z as floats", ", ".join(sorted(fields)))
    order = ">" if message.is_bigendian else "<"
    formats = [order + _FLOATS[int(fields[name].datatype)] for name in "xyz"]
    offsets = [int(fields[name].offset) for name in "xyz"]
    ends = [at + np.dtype(form).itemsize for at, form in zip(offsets, formats, strict=True)]
    row_size, data = int(message.row_step), np.ascontiguousarray(message.data, np.uint8)
    if (
        max(ends) > size
        or row_size < columns * size
        or data.size < row_size * (rows - 1) + (columns * size)
    ):
        return Unusable("a cloud whose sizes disagree", f"{data.size:,} bytes for {count:,} points")
    dtype = np.dtype({"names": list("xyz"), "formats": formats, "offsets": offsets,
                      "itemsize": size})  # fmt: skip
    # The last row may lack what fills the others: nothing is made as long as it says that it is.
    row_strides = (min(row_size, data.size), 1)
    packed = np.lib.stride_tricks.as_strided(data, (rows, columns * size), row_strides)
    found = np.ascontiguousarray(packed).reshape(-1).view(dtype)
    points = np.stack([found[name].astype(np.float64) for name in "xyz"], axis=1)
    return Cloud(
        frame=str(message.header.frame_id).removeprefix("/"),
        stamp_ns=stamp_ns(message.header.stamp),
        points=points[np.isfinite(points).all(1)],
    )


def cut(
    points: NDArray[np.float64], origin: NDArray[np.float64], heights: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return bearings and ranges (b,) of the nearest points of a band, as seen from an origin.

    Args:
        points: (n, 3) m, z up from the floor.
        origin: (3,) where the sensor is.
        heights: The band, m.

    Returns:
        The middles of equal parts of a turn, rad; NaN where no point of the band lies: nothing may
        be there, or something of another height.
    """
    low, high = heights
    band = points[(points[:, 2] >= low) & (points[:, 2] <= high)]
    dx, dy = (band[:, :2] - origin[:2]).T
    away = np.hypot(dx, dy)
    keep = (away >= LEAST_RANGE_M) & (away <= MAX_RANGE_M)
    away, angle = away[keep], np.arctan2(dy[keep], dx[keep])
    part = np.floor((angle + math.pi) / math.tau * BEAMS).astype(np.int64) % BEAMS
    nearest = np.full(BEAMS, np.inf)
    np.minimum.at(nearest, part, away)
    bearings = (np.arange(BEAMS) + 0.5) / BEAMS * math.tau - math.pi
    return bearings, np.where(np.isinf(nearest), np.nan, nearest)


MOST_BEAMS = 4096
"""Of more, every second, third … is taken: 0.1 degrees apart, four of them share a centimetre."""
LONGEST_S = 1.0
"""A scan that takes longer is none of a laser that turns; or its `time_increment` is wrong."""
ANGLES_OFF = 0.02
"""By how much `angle_max` may differ from where the last beam points, rad; or 2.5 increments."""
UNLIMITED_M = 100.0
"""`range_max` of a laser that reports none (infinity)."""


@dataclass(frozen=True, slots=True)
class Unusable:
    """Why a scan is dropped."""

    kind: str
    """Without values."""
    example: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """The beams of one scan; all arrays (b,)."""

    frame: str
    stamp_ns: int
    """Of the first beam."""
    angles: NDArray[np.float64]
    """Around the laser's z, rad; they rise or fall."""
    after_ns: NDArray[np.int64]
    """How long after the stamp each was measured."""
    ranges: NDArray[np.float64]
    """m; inf: it did not come back; NaN: it says nothing."""
    max_range: float


def sweep_of(message: Any) -> Sweep | Unusable:
    """Return the beams of a LaserScan."""
    ranges = np.asarray(message.ranges, np.float64)
    problem = _problem(message, len(ranges))
    if problem is not None:
        return problem
    every = -(-len(ranges) // MOST_BEAMS)
    numbers = np.arange(0, len(ranges), every)
    most = min(float(message.range_max), UNLIMITED_M)
    return Sweep(
        frame=str(message.header.frame_id).removeprefix("/"),
        stamp_ns=stamp_ns(message.header.stamp),
        angles=float(message.angle_min) + float(message.angle_increment) * numbers.astype(float),
        after_ns=np.rint(float(message.time_increment) * 1e9 * numbers).astype(np.int64),
        ranges=meant(ranges[numbers], float(message.range_min), most),
        max_range=most,
    )


def meant(ranges: NDArray[np.float64], least: float, most: float) -> NDArray[np.float64]:
    """Return ranges, inf where a beam did not come back, NaN where it says nothing.

    Zero, infinity and what is beyond the laser's range are beams that did not come back: drivers
    have different words for it. NaN, minus infinity, negative ones, and what is nearer than the
    laser can measure (its own housing) say nothing.
    """
    with np.errstate(invalid="ignore"):
        lost = (ranges == 0) | (ranges > most)
        bad = np.isnan(ranges) | (ranges < max(least, 0.0))
    return np.where(lost, np.inf, np.where(bad, np.nan, ranges))


def _problem(message: Any, beams: int) -> Unusable | None:
    """Return what is wrong with the form of a scan; None: nothing."""
    first, last, step = (
        float(getattr(message, name)) for name in ("angle_min", "angle_max", "angle_increment")
    )
    after_s = float(message.time_increment) * beams
    if beams < 2:
        return Unusable("a scan without beams", f"{beams} ranges")
    if not all(map(math.isfinite, (first, last, step, after_s))):
        return Unusable("a scan whose angles or times are not finite", f"{first} .. {last}")
    if step == 0 or abs(step) >= math.pi:
        return Unusable("a scan whose angle_increment cannot be", f"{step:g}")
    span = step * (beams - 1)
    if abs(span) > math.tau + 2 * abs(step):
        return Unusable("a scan of more than a whole turn", f"{beams:,} beams of {step:g} rad")
    if abs(first + span - last) > max(2.5 * abs(step), ANGLES_OFF):
        told = f"{beams:,} ranges end at {first + span:.3f}, angle_max {last:.3f}"
        return Unusable("a scan whose ranges and angles disagree", told)
    if abs(after_s) > LONGEST_S:
        return Unusable(f"a scan that takes more than {LONGEST_S:g} s", f"{after_s:.1f} s")
    if not float(message.range_max) > 0:
        return Unusable("a scan whose range_max is not above 0", f"{message.range_max:g}")
    return None
