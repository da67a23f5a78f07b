"""Placed scans as ROS messages, visits as JSON text, and both back.

A LaserScan has one origin, and the same angle between its beams. Where a scan differs from that by
more than `EXACT_M` at any beam's end, the beams themselves are stored as well.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from math import isnan, nan
from types import NoneType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.visit import DoorLine, PlacedScan, Visit
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.interop.formats.ros import ros_types

SCAN = "sensor_msgs/msg/LaserScan"
CLOUD = "sensor_msgs/msg/PointCloud2"
TEXT = "std_msgs/msg/String"
EXACT_M = 0.002
NOT_TOLD = -1.0
"""In a covariance: as ROS's drivers say that they do not know it."""
FLOAT32 = 7
"""sensor_msgs/PointField."""
BEAM = np.dtype([
    ("x", "<f4"), ("y", "<f4"), ("z", "<f4"),
    ("from_x", "<f4"), ("from_y", "<f4"), ("bearing", "<f4"), ("range", "<f4"),
])  # fmt: skip
"""Of a beam: where it ended (NaN: nowhere), where it began, m; where it points, rad; how far, m."""


@dataclass(frozen=True, slots=True)
class ScanBytes:
    """The messages of one scan."""

    transform: bytes
    pose: bytes
    scan: bytes
    beams: bytes | None
    """None: the LaserScan is exact enough."""


def scan_to_messages(scan: PlacedScan, frame: str) -> ScanBytes:
    """Return a scan as messages.

    Args:
        scan: With at least one beam.
        frame: What its laser's frame is called in the file.

    Raises:
        OutputError: ROS has no stamp for its time.
    """
    origin, theta = scan.origins.mean(axis=0), float(scan.bearings[len(scan.bearings) // 2])
    new = ros_types.Messages(2).new
    return ScanBytes(
        ros_types.encoded(
            2,
            new(ros_types.TRANSFORMS, transforms=[_transform(scan, frame, origin, theta)]),
            ros_types.TRANSFORMS,
        ),
        ros_types.encoded(2, _pose(scan, origin, theta), ros_types.POSE_WITH_COVARIANCE),
        ros_types.encoded(2, _laser_scan(scan, frame, theta), SCAN),
        None if _is_even(scan, origin) else ros_types.encoded(2, _cloud(scan), CLOUD),
    )


def scan_from_messages(told: ScanBytes, *, level: int, laser: str, robot: str) -> PlacedScan:
    """Return the scan in these messages.

    Raises:
        ValueError: They do not fit each other, or are something else.
    """
    try:
        return _read(told, level, laser, robot)
    except Exception as error:  # of rosbags, which raises whatever its damaged bytes lead to
        raise ValueError(f"a scan of {laser}: {error}") from error


def _read(told: ScanBytes, level: int, laser: str, robot: str) -> PlacedScan:
    pose = ros_types.decoded(2, told.pose, ros_types.POSE_WITH_COVARIANCE)
    scan = ros_types.decoded(2, told.scan, SCAN)
    stamp = scan.header.stamp
    ranges = scan.ranges.astype(np.float64)
    if told.beams is None:
        place, turned = pose.pose.pose.position, pose.pose.pose.orientation
        theta = 2 * math.atan2(turned.z, turned.w)
        origins = np.tile([place.x, place.y], (len(ranges), 1))
        bearings = theta + scan.angle_min + scan.angle_increment * np.arange(len(ranges))
    else:
        beams = np.frombuffer(ros_types.decoded(2, told.beams, CLOUD).data.tobytes(), BEAM)
        origins = np.column_stack([beams["from_x"], beams["from_y"]]).astype(np.float64)
        bearings = beams["bearing"].astype(np.float64)
    if len(bearings) != len(ranges):
        raise ValueError(f"expected {len(bearings):,} ranges, got {len(ranges):,}")
    covariance = pose.pose.covariance
    return PlacedScan(
        stamp_ns=stamp.sec * 10**9 + stamp.nanosec, level=level, laser=laser, origins=origins,
        bearings=bearings, ranges=ranges, max_range=float(scan.range_max),
        sd_xy=_sd(covariance[0]), sd_theta=_sd(covariance[35]), robot=robot,
    )  # fmt: skip


def _transform(scan: PlacedScan, frame: str, origin: NDArray[np.float64], theta: float) -> Any:
    messages = ros_types.Messages(2)
    pose = messages.pose(float(origin[0]), float(origin[1]), 0.0, theta)
    return messages.new(
        "geometry_msgs/msg/TransformStamped",
        header=messages.header(scan.stamp_ns),
        child_frame_id=frame,
        transform=messages.new(
            "geometry_msgs/msg/Transform",
            translation=messages.new(
                "geometry_msgs/msg/Vector3", x=pose.position.x, y=pose.position.y, z=0.0
            ),
            rotation=pose.orientation,
        ),
    )


def _pose(scan: PlacedScan, origin: NDArray[np.float64], theta: float) -> Any:
    messages = ros_types.Messages(2)
    covariance = np.zeros(36)
    covariance[[0, 7]], covariance[35] = _variance(scan.sd_xy), _variance(scan.sd_theta)
    return messages.new(
        ros_types.POSE_WITH_COVARIANCE,
        header=messages.header(scan.stamp_ns),
        pose=messages.new(
            "geometry_msgs/msg/PoseWithCovariance",
            pose=messages.pose(float(origin[0]), float(origin[1]), 0.0, theta),
            covariance=covariance,
        ),
    )


def _laser_scan(scan: PlacedScan, frame: str, theta: float) -> Any:
    messages = ros_types.Messages(2)
    first, increment = float(scan.bearings[0]), _increment(scan)
    return messages.new(
        SCAN,
        header=messages.header(scan.stamp_ns, frame=frame),
        angle_min=first - theta,
        angle_max=first - theta + increment * (len(scan.bearings) - 1),
        angle_increment=increment,
        time_increment=0.0,
        scan_time=0.0,
        range_min=0.0,
        range_max=scan.max_range,
        ranges=scan.ranges.astype(np.float32),
        intensities=np.zeros(0, np.float32),
    )


def _increment(scan: PlacedScan) -> float:
    beams = len(scan.bearings)
    return float(scan.bearings[-1] - scan.bearings[0]) / max(beams - 1, 1)


def _is_even(scan: PlacedScan, origin: NDArray[np.float64]) -> bool:
    """Return whether one origin and one increment describe all beams."""
    even = scan.bearings[0] + _increment(scan) * np.arange(len(scan.bearings))
    far = np.where(np.isfinite(scan.ranges), scan.ranges, scan.max_range)
    moved = np.hypot(*(scan.origins - origin).T)
    return bool((moved + np.abs(scan.bearings - even) * far <= EXACT_M).all())


def _cloud(scan: PlacedScan) -> Any:
    messages = ros_types.Messages(2)
    names = BEAM.names or ()
    points = np.zeros(len(scan.ranges), BEAM)
    came_back = np.where(np.isfinite(scan.ranges), scan.ranges, np.nan)
    points["from_x"], points["from_y"] = scan.origins.T
    points["bearing"], points["range"] = scan.bearings, scan.ranges
    points["x"] = scan.origins[:, 0] + came_back * np.cos(scan.bearings)
    points["y"] = scan.origins[:, 1] + came_back * np.sin(scan.bearings)
    return messages.new(
        CLOUD,
        header=messages.header(scan.stamp_ns),
        height=1,
        width=len(points),
        fields=[
            messages.new("sensor_msgs/msg/PointField", name=name, offset=4 * at,
                         datatype=FLOAT32, count=1)
            for at, name in enumerate(names)
        ],
        is_bigendian=False,
        point_step=BEAM.itemsize,
        row_step=BEAM.itemsize * len(points),
        data=np.frombuffer(points.tobytes(), np.uint8),
        is_dense=False,
    )  # fmt: skip


def _variance(sd: float) -> float:
    return NOT_TOLD if math.isnan(sd) else sd**2


def _sd(variance: float) -> float:
    return math.nan if variance < 0 else math.sqrt(variance)


_OF_VISIT = {field.name for field in fields(Visit)}
_TYPES: Mapping[object, type | tuple[type, ...]] = {
    "int": int, "float": (int, float, NoneType), "bool": bool, "str": str,
}  # fmt: skip
"""What a field may be of, where its type is called so."""
_EXPECTED = {f.name: _TYPES[f.type] for f in fields(Visit) if f.type in _TYPES}


@dataclass(frozen=True, slots=True)
class VisitRecord:
    """The contents of a visit's text."""

    visit: Visit
    level: int
    line: DoorLine
    stamps_ns: tuple[int, ...]
    """Of its scans."""
    event: int | None


def text_of(told: VisitRecord) -> str:
    """Return the text of a visit."""
    visit = told.visit
    values = {name: getattr(visit, name) for name in sorted(_OF_VISIT)}
    return json.dumps({
        **{name: _null_for_nan(value) for name, value in values.items()},
        "state": visit.state.name,
        "level": told.level,
        "line": told.line,
        "event": told.event,
        "scans_after_ns": [stamp - visit.first_ns for stamp in told.stamps_ns],
    })  # fmt: skip


def read_text(text: str) -> VisitRecord:
    """Return the contents of a text; keys that a later version added are ignored.

    Raises:
        ValueError: It is not the text of a visit.
    """
    try:
        found: Any = json.loads(text)
        given = {name: _given(found, name) for name in _OF_VISIT & found.keys()}
        visit = Visit(**{
            **given,
            "door_id": DoorId(int(found["door_id"])),
            "state": DoorState[found["state"]],
            "leaves": tuple(_numbers(leaf) for leaf in found.get("leaves", ())),
        })  # fmt: skip
        x, y, theta, width = _numbers(found["line"])
        event = found.get("event")
        return VisitRecord(
            visit,
            int(found["level"]),
            (x, y, theta, width),
            tuple(visit.first_ns + int(after) for after in found["scans_after_ns"]),
            None if event is None else int(event),
        )
    except (
        AttributeError,
        KeyError,
        TypeError,
        ValueError,
        ArithmeticError,
        RecursionError,
    ) as error:
        raise ValueError(f"expected the text of a visit, got {text[:60]!r}") from error


def _null_for_nan(value: Any) -> Any:
    return None if isinstance(value, float) and isnan(value) else value


def _given(found: Mapping[str, Any], name: str) -> Any:
    """Return the value of a field.

    Raises:
        TypeError: It cannot be of the field.
    """
    value, expected = found[name], _EXPECTED.get(name, object)
    if not isinstance(value, expected) or (isinstance(value, bool) and expected is not bool):
        raise TypeError(f"{name}: {value!r}")
    return nan if value is None else value


def _numbers(values: Sequence[Any]) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
