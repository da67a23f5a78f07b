"""A robot with a laser drives by a door: what is true is known, and its topics tell of it.

All poses are 4 x 4 matrices; nothing here is taken from what is tested.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from semmap_log.interop.formats.ros.ros_types import (
    LASER_SCAN,
    ODOMETRY,
    POSE_WITH_COVARIANCE,
    TRANSFORMS,
    RosVersion,
)
from tests.analysis.scans.beams import ranges_of
from tests.interop.formats.bags.bags_of_others import Said
from tests.interop.topics.robots import START, Robot, S

Matrix = Any
DOOR = (4.0, 1.2, 0.0, 0.9)
"""In the corridor's upper wall: x, y, theta, width."""
WALLS = [
    (0.0, -1.2, 12.0, -1.2), (0.0, -1.2, 0.0, 1.2), (12.0, -1.2, 12.0, 1.2),
    (0.0, 1.2, 4.0, 1.2), (4.9, 1.2, 12.0, 1.2),
    (2.5, 1.2, 2.5, 4.4), (6.5, 1.2, 6.5, 4.4), (2.5, 4.4, 6.5, 4.4),
]  # fmt: skip
"""A corridor, and a room behind the door."""
SHUT = [(4.0, 1.2, 4.9, 1.2)]
AJAR = [(4.0, 1.2, 4.0, 2.1)]
"""Its leaf stands into the room at a right angle: the door is open."""


def moved(x: float, y: float, z: float = 0.0) -> Matrix:
    made = np.eye(4)
    made[:3, 3] = x, y, z
    return made


def turned(axis: str, angle: float) -> Matrix:
    c, s = math.cos(angle), math.sin(angle)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    made = np.eye(4)
    made[i, i] = made[j, j] = c
    made[i, j], made[j, i] = -s, s
    return made


def quaternion(pose: Matrix) -> tuple[float, float, float, float]:
    """x, y, z, w of a matrix's turn, by its eigenvector: the axis stays where it is."""
    turn = pose[:3, :3]
    angle = math.acos(max(-1.0, min(1.0, (np.trace(turn) - 1) / 2)))
    if angle < 1e-9:
        return 0.0, 0.0, 0.0, 1.0
    values, vectors = np.linalg.eig(turn)
    axis = np.real(vectors[:, np.argmin(abs(values - 1))])
    made = (*(axis * math.sin(angle / 2)), math.cos(angle / 2))
    x, y, z, w = made
    skew = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    sign = -1.0 if np.dot(skew, axis) < 0 else 1.0
    return sign * x, sign * y, sign * z, w


@dataclass
class LaserRoom:
    """A drive of some seconds past the door; times are seconds from `START`."""

    version: RosVersion = 2
    seconds: float = 12.0
    begins_s: float = 0.0
    mount: Matrix = None
    """base_link -> laser."""
    map_to_odom: Matrix = None
    state: Callable[[float], list[Any]] = lambda _: AJAR
    """Time -> the door's leaf."""
    drive: Callable[[float], Matrix] | None = None
    """Time -> where the base is on the map."""
    beams: int = 360
    turn_s: float = 0.1
    """From a scan's first beam to its last."""
    scan_hz: float = 8.0
    tf_hz: float = 25.0
    first_angle: float = -math.pi
    laser_frame: str = "laser"
    prefix: str = ""
    """Of the frames of the robot."""
    namespace: str = ""
    """Of its topics."""

    def __post_init__(self) -> None:
        self.robot = Robot(self.version)
        if self.mount is None:
            self.mount = moved(0.2, 0.05, 0.3) @ turned("z", 0.4)
        if self.map_to_odom is None:
            self.map_to_odom = moved(-3.0, 2.0) @ turned("z", 0.7)

    def base(self, t: float) -> Matrix:
        """Where the robot is: along the corridor, with a slow turn to and fro."""
        if self.drive is not None:
            return self.drive(t)
        wave = 0.5 * math.sin(1.3 * t)
        made = turned("z", wave)
        made[:2, 3] = 1.0 + 0.6 * t, 0.15 * math.sin(t)
        return made

    def laser(self, t: float) -> Matrix:
        return self.base(t) @ self.mount

    def lasers(self, times: Any) -> Any:
        """Where the laser is at each time."""
        return np.array([self.base(each) for each in times]) @ self.mount

    def frame(self, name: str) -> str:
        return f"{self.prefix}{name}"

    def topic(self, name: str) -> str:
        return f"{self.namespace}/{name}"

    def said(self) -> list[Said]:
        """All that its topics say, in the order of time."""
        return sorted([*self.statics(), *self.tf(), *self.scans()], key=lambda each: each.at_ns)

    def statics(self) -> Iterator[Said]:
        link = self.link("base_link", self.laser_frame, self.mount, 0.0)
        yield self.transforms("tf_static", 0.0, [link])

    def tf(self, *, localised: bool = True) -> Iterator[Said]:
        for i in range(int(self.seconds * self.tf_hz) + 1):
            t = i / self.tf_hz
            odom = np.linalg.inv(self.map_to_odom) @ self.base(t)
            links = [self.link("odom", "base_link", odom, t)]
            if localised:
                links.append(self.link("map", "odom", self.map_to_odom, t))
            yield self.transforms("tf", t, links)

    def poses(self, hz: float = 3.0, kind: str = POSE_WITH_COVARIANCE) -> Iterator[Said]:
        """Where the base is on the map: /amcl_pose, with 0.2 m and 0.1 rad; or as Odometry."""
        for i in range(int(self.seconds * hz) + 1):
            t = i / hz
            covariance = np.zeros(36)
            covariance[[0, 7, 35]] = 0.04, 0.04, 0.01
            header = self.robot.header(self.ns(t), "map")
            inner = self.robot.new(
                "geometry_msgs/msg/PoseWithCovariance", pose=self.pose(self.base(t)),
                covariance=covariance,
            )  # fmt: skip
            if kind == ODOMETRY:
                zero = self.robot.new("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
                twist = self.robot.new(
                    "geometry_msgs/msg/TwistWithCovariance", covariance=np.zeros(36),
                    twist=self.robot.new("geometry_msgs/msg/Twist", linear=zero, angular=zero),
                )  # fmt: skip
                made = self.robot.new(kind, header=header, child_frame_id="base_link", pose=inner,
                                      twist=twist)  # fmt: skip
            else:
                made = self.robot.new(kind, header=header, pose=inner)
            yield Said("/amcl_pose", kind, self.robot.encoded(kind, made), self.ns(t) + S // 50)

    def scans(self) -> Iterator[Said]:
        for i in range(int(self.seconds * self.scan_hz)):
            t = i / self.scan_hz
            yield self.sent(self.scan(t), t + self.turn_s)

    def scan(self, t: float, **values: Any) -> Any:
        """The LaserScan whose first beam is of that time; values take the place of true ones."""
        angles = self.first_angle + np.arange(self.beams) * math.tau / self.beams
        times = t + np.arange(self.beams) * self.turn_s / self.beams
        poses = self.lasers(times)
        local = np.stack([np.cos(angles), np.sin(angles), 0 * angles, 0 * angles], axis=1)
        directions = np.einsum("nij,nj->ni", poses, local)[:, :2]
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        found = ranges_of(poses[:, :2, 3], directions, [*WALLS, *self.state(t)])
        true = {
            "header": self.robot.header(self.ns(t), self.frame(self.laser_frame)),
            "angle_min": float(angles[0]), "angle_max": float(angles[-1]),
            "angle_increment": math.tau / self.beams,
            "time_increment": self.turn_s / self.beams, "scan_time": self.turn_s,
            "range_min": 0.05, "range_max": 12.0, "ranges": found.astype(np.float32),
            "intensities": np.zeros(0, np.float32),
        }  # fmt: skip
        return self.robot.new(LASER_SCAN, **true | values)

    def sent(self, message: Any, t: float, topic: str = "scan") -> Said:
        data = self.robot.encoded(LASER_SCAN, message)
        return Said(self.topic(topic), LASER_SCAN, data, self.ns(t))

    def link(self, parent: str, child: str, pose: Matrix, t: float) -> Any:
        x, y, z = pose[:3, 3]
        parent = parent if parent == "map" else self.frame(parent)
        made = self.pose(pose)
        return self.robot.new(
            "geometry_msgs/msg/TransformStamped",
            header=self.robot.header(self.ns(t), parent), child_frame_id=self.frame(child),
            transform=self.robot.new(
                "geometry_msgs/msg/Transform", rotation=made.orientation,
                translation=self.robot.new("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
            ),
        )  # fmt: skip

    def transforms(self, topic: str, t: float, links: list[Any]) -> Said:
        message = self.robot.new(TRANSFORMS, transforms=links)
        data = self.robot.encoded(TRANSFORMS, message)
        return Said(self.topic(topic), TRANSFORMS, data, self.ns(t) + S // 100)

    def pose(self, pose: Matrix) -> Any:
        position, turn = pose[:3, 3], quaternion(pose)
        new = self.robot.new
        return new(
            "geometry_msgs/msg/Pose",
            position=new("geometry_msgs/msg/Point", **dict(zip("xyz", position, strict=True))),
            orientation=new("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", turn, strict=True))),
        )

    def ns(self, t: float) -> int:
        return START + round((self.begins_s + t) * S)


@cache
def drives_by(version: RosVersion = 2) -> list[Said]:
    """The robot drives by the open door, and a minute later by the shut one."""
    first = LaserRoom(version=version, state=lambda _: AJAR)
    second = LaserRoom(version=version, state=lambda _: SHUT, begins_s=60.0)
    return [*first.said(), *second.said()]
