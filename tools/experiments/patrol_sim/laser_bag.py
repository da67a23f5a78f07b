"""A simulated patrol as a bag of ROS 1 or ROS 2, and the truth beside it.

Topics: /scan, /tf (map -> odom 10 times a second, odom -> base_link), /tf_static
(base_link -> laser), /map, and /amcl_pose with the covariance, where the robot tells it.
"""

from __future__ import annotations

import heapq
import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from patrol_sim.laser_pose import MAP_HZ, Localisation, PoseError
from patrol_sim.laser_surfaces import Floats
from patrol_sim.laser_world import START_NS, Patrol
from semmap_log.core.model.events import DoorAdded, DoorAnnotated, FloorMap
from semmap_log.core.model.moments import SECOND_NS, format_utc
from semmap_log.errors import OutputError
from semmap_log.interop.formats.bags.bag_protocol import BagTopic, NewBag
from semmap_log.interop.formats.bags.bag_reading import new_bag
from semmap_log.interop.formats.json.door_json import event_to_json
from semmap_log.interop.formats.ros.ros_types import (
    GRID,
    POSE_WITH_COVARIANCE,
    TRANSFORMS,
    Messages,
    RosVersion,
    encoded,
    ros_types,
)

SCAN = BagTopic("/scan", "sensor_msgs/msg/LaserScan", is_latched=False)
TF = BagTopic("/tf", TRANSFORMS, is_latched=False)
TF_STATIC = BagTopic("/tf_static", TRANSFORMS, is_latched=True)
MAP = BagTopic("/map", GRID, is_latched=True)
AMCL_POSE = BagTopic("/amcl_pose", POSE_WITH_COVARIANCE, is_latched=False)

LATE_NS = 2_000_000
"""From a moment until its transform is recorded; a scan is recorded when its last beam is in."""
POSE_EVERY_M, POSE_EVERY_RAD, POSE_EVERY_S = 0.2, 0.25, 1.0

Dated = tuple[int, int, BagTopic, Any]
"""When recorded, a number that makes the order certain, topic, message."""


@dataclass(frozen=True, slots=True)
class Told:
    """What the robot says of its pose's error, in /amcl_pose."""

    sd_xy: float
    sd_theta_deg: float


FORMATS = ("ros1", "mcap", "sqlite3")


def write_bag(
    path: Path, patrol: Patrol, where: Localisation, *, form: str, told: Told | None,
    odom_hz: float = 50, progress: Callable[[float], None] = lambda _share: None,
) -> None:  # fmt: skip
    """Write the bag: same patrol, same bytes.

    Args:
        path: A `.bag` for ros1; a folder, or an `.mcap`, else.
        patrol: What took place.
        where: Where the robot believed to be.
        form: One of `FORMATS`.
        told: The error that it tells of its pose; None: it tells none, there is no /amcl_pose.
        odom_hz: How often odom -> base_link is published.
        progress: Told the share that is written.

    Raises:
        OutputError: It cannot be written, or the name does not fit the format.
    """
    topics = [TF_STATIC, MAP, TF, SCAN, *([AMCL_POSE] if told else [])]
    with _opened(path, form, topics) as bag:
        messages = _Stream(patrol, where, Messages(bag.ros_version), progress)
        streams = [messages.start(), messages.odometry(odom_hz), messages.corrections(),
                   messages.scans()]  # fmt: skip
        if told:
            streams.append(messages.poses(told))
        for at_ns, _, topic, message in heapq.merge(*streams, key=lambda dated: dated[:2]):
            bag.write(topic, at_ns, message)


def write_truth(path: Path, patrol: Patrol, where: Localisation, error: PoseError) -> None:
    """Write what is true as JSON: each door with its states over time, and when it was passed."""
    length_s = patrol.length_s
    doors = []
    for door_id, life in patrol.lives.items():
        body, drawn = life.body, life.body.drawn
        start, end = body.ends
        doors.append({
            "door_id": door_id, "name": drawn.name, "level": patrol.plan.level,
            "kind": drawn.kind, "glass": body.glass,
            "x": drawn.x, "y": drawn.y, "theta": drawn.theta, "width": drawn.width,
            "built": [round(float(v), 4) for v in (*start, *end)],
            "recess_m": round(body.recess_m * body.side, 4),
            "states": life.told(0.0, length_s),
            "driven_through_s": [round(s, 2) for s in patrol.passages.get(door_id, [])],
        })  # fmt: skip
    document = {
        "about": "What was true while the bag of this name was recorded. Seconds count from "
        "`start`; CLOSED, AJAR and OPEN are the clear share `opening` of the door's width; "
        "`built`: where the doorway really is.",
        "start": format_utc(START_NS), "start_ns": START_NS, "length_s": round(length_s, 3),
        "seed": patrol.seed, "laser": asdict(patrol.laser), "pose_error": asdict(error),
        "localised_anew_s": [round(s, 2) for s in where.jumps_s], "doors": doors,
    }  # fmt: skip
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def write_doors(path: Path, patrol: Patrol, *, tell_glass: bool = True) -> None:
    """Write the doors as JSON lines for `import`, an hour before the patrol."""
    at = format_utc(START_NS - 3600 * SECOND_NS)
    events = [event for event in patrol.plan.events if not isinstance(event, FloorMap)]
    if tell_glass:
        events += [
            DoorAnnotated(door_id=door_id, key="glass", value="true")
            for door_id, life in patrol.lives.items()
            if life.body.glass
        ]
    here = {door.door_id for door in patrol.plan.doors}
    lines = [
        json.dumps({**event_to_json(event), "happened": at})
        for event in events
        if not isinstance(event, DoorAdded | DoorAnnotated) or event.door_id in here
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


class _Stream:
    """Yields messages, each kind in the order of their times."""

    def __init__(
        self, patrol: Patrol, where: Localisation, new: Messages, progress: Callable[[float], None]
    ) -> None:
        self._patrol, self._where, self._new = patrol, where, new
        self._progress = progress

    def start(self) -> Iterator[Dated]:
        laser = self._patrol.laser
        mounted = self._transform(
            START_NS, 0, ("base_link", "laser"), (laser.x, laser.y, laser.z),
            _quaternion(laser.yaw, upside_down=laser.upside_down),
        )  # fmt: skip
        yield START_NS, 0, TF_STATIC, self._new.new(TRANSFORMS, transforms=[mounted])
        yield START_NS, 1, MAP, self._map(self._patrol.plan.floor)

    def odometry(self, hz: float) -> Iterator[Dated]:
        times_s = np.arange(int(self._patrol.length_s * hz) + 1) / hz
        poses = _at(times_s, self._where.times_s, self._where.odometry)
        yield from self._moving(times_s, poses, ("odom", "base_link"), 2)

    def corrections(self) -> Iterator[Dated]:
        times_s = np.arange(int(self._patrol.length_s * MAP_HZ) + 1) / MAP_HZ
        poses = _at(times_s, self._where.times_s, self._where.map_to_odom())
        yield from self._moving(times_s, poses, ("map", "odom"), 3)

    def scans(self) -> Iterator[Dated]:
        laser = self._patrol.laser
        angles = laser.angles
        turn_ns = round(laser.time_increment_s * (laser.beams - 1) * SECOND_NS)
        for number, scan in enumerate(self._patrol.scanned(self._progress)):
            stamp_ns = _ns(scan.at_s)
            message = self._new.new(
                SCAN.ros_type, header=self._header(stamp_ns, number, "laser"),
                angle_min=float(angles[0]), angle_max=float(angles[-1]),
                angle_increment=laser.increment, time_increment=laser.time_increment_s,
                scan_time=1 / laser.hz, range_min=laser.range_min, range_max=laser.range_max,
                ranges=scan.ranges.astype(np.float32), intensities=np.empty(0, np.float32),
            )  # fmt: skip
            yield stamp_ns + turn_ns + LATE_NS, 4, SCAN, message

    def poses(self, told: Told) -> Iterator[Dated]:
        covariance = np.zeros(36)
        covariance[[0, 7]] = told.sd_xy**2
        covariance[35] = math.radians(told.sd_theta_deg) ** 2
        times_s = np.arange(int(self._patrol.length_s * MAP_HZ) + 1) / MAP_HZ
        poses = self._where.believed_at(times_s)
        before, before_s, number = poses[0], -math.inf, 0
        for at_s, pose in zip(times_s.tolist(), poses, strict=True):
            if (
                math.dist(pose[:2], before[:2]) < POSE_EVERY_M
                and abs(pose[2] - before[2]) < POSE_EVERY_RAD
                and at_s - before_s < POSE_EVERY_S
            ):
                continue
            before, before_s = pose, at_s
            posed = self._new.pose(float(pose[0]), float(pose[1]), theta=float(pose[2]))
            message = self._new.new(
                AMCL_POSE.ros_type, header=self._header(_ns(at_s), number, "map"),
                pose=self._new.new("geometry_msgs/msg/PoseWithCovariance", pose=posed,
                                   covariance=covariance),
            )  # fmt: skip
            number += 1
            yield _ns(at_s) + LATE_NS, 5, AMCL_POSE, message

    def _moving(
        self, times_s: Floats, poses: Floats, frames: tuple[str, str], order: int
    ) -> Iterator[Dated]:
        for number, (at_s, (x, y, theta)) in enumerate(
            zip(times_s.tolist(), poses.tolist(), strict=True)
        ):
            moved = self._transform(_ns(at_s), number, frames, (x, y, 0.0), _quaternion(theta))
            message = self._new.new(TRANSFORMS, transforms=[moved])
            yield _ns(at_s) + LATE_NS, order, TF, message

    def _transform(
        self, at_ns: int, number: int, frames: tuple[str, str],
        place: tuple[float, float, float], turn: tuple[float, float, float, float],
    ) -> Any:  # fmt: skip
        new = self._new.new
        x, y, z = place
        quaternion = dict(zip("xyzw", turn, strict=True))
        return new(
            "geometry_msgs/msg/TransformStamped",
            header=self._header(at_ns, number, frames[0]), child_frame_id=frames[1],
            transform=new(
                "geometry_msgs/msg/Transform",
                translation=new("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
                rotation=new("geometry_msgs/msg/Quaternion", **quaternion),
            ),
        )  # fmt: skip

    def _map(self, floor: FloorMap) -> Any:
        cells = np.asarray(floor.cells, np.int8)
        info = self._new.new(
            "nav_msgs/msg/MapMetaData", map_load_time=self._new.stamp(START_NS),
            resolution=floor.resolution, width=cells.shape[1], height=cells.shape[0],
            origin=self._new.pose(floor.origin_x, floor.origin_y, theta=floor.origin_theta),
        )  # fmt: skip
        header = self._header(START_NS, 0, "map")
        return self._new.new(GRID, header=header, info=info, data=cells.ravel())

    def _header(self, at_ns: int, number: int, frame: str) -> Any:
        header = self._new.header(at_ns, number)
        return replace(header, frame_id=frame)


def _ns(at_s: float) -> int:
    """Return a moment of the patrol, ns since 1970, on whole microseconds."""
    return START_NS + round(at_s * 1e6) * 1000


def _quaternion(yaw: float, *, upside_down: bool = False) -> tuple[float, float, float, float]:
    """Return x, y, z, w of a turn about z, after half a turn about x for what hangs upside down."""
    if upside_down:
        return math.cos(yaw / 2), math.sin(yaw / 2), 0.0, 0.0
    return 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)


def _at(at_s: Floats, times_s: Floats, rows: Floats) -> Floats:
    return np.stack([np.interp(at_s, times_s, column) for column in rows.T], axis=-1)


@contextmanager
def _opened(path: Path, form: str, topics: Sequence[BagTopic]) -> Iterator[NewBag]:
    suffixes = {"ros1": {".bag"}, "mcap": {"", ".mcap"}, "sqlite3": {""}}[form]
    if path.suffix not in suffixes:
        wanted = " or ".join(suffix or "no ending (a folder)" for suffix in sorted(suffixes))
        raise OutputError(f"{path}: for {form} expected a name with {wanted}.")
    opening: AbstractContextManager[NewBag] = (
        _sqlite3_bag(path, topics) if form == "sqlite3" else new_bag(path, topics)
    )
    with opening as bag:
        yield bag


@contextmanager
def _sqlite3_bag(path: Path, topics: Sequence[BagTopic]) -> Iterator[NewBag]:
    """Write a rosbag2 folder with a .db3, as ROS 2 wrote them by default until Humble."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    if path.exists():
        raise OutputError(f"{path}: there is something of that name; choose another.")
    with Writer(path, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        yield _Sqlite3Bag(writer, topics)


class _Sqlite3Bag:
    ros_version: RosVersion = 2

    def __init__(self, writer: Any, topics: Sequence[BagTopic]) -> None:
        self._writer = writer
        self._connections = {
            topic: writer.add_connection(topic.name, topic.ros_type, typestore=ros_types(2),
                                         offered_qos_profiles=_qos(topic))
            for topic in topics
        }  # fmt: skip

    def write(self, topic: BagTopic, at_ns: int, message: Any) -> None:
        self.write_encoded(topic, at_ns, encoded(2, message, topic.ros_type))

    def write_encoded(self, topic: BagTopic, at_ns: int, data: bytes) -> None:
        self._writer.write(self._connections[topic], at_ns, data)


def _qos(topic: BagTopic) -> list[Any]:
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    durability = QosDurability.TRANSIENT_LOCAL if topic.is_latched else QosDurability.VOLATILE
    forever = QosTime(0, 0)
    return [
        Qos(
            QosHistory.KEEP_LAST, 10, QosReliability.RELIABLE, durability, forever, forever,
            QosLiveliness.AUTOMATIC, forever, avoid_ros_namespace_conventions=False,
        )
    ]  # fmt: skip
