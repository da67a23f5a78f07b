"""PointCloud2, cut at a band of heights: the nearest in each direction counts."""

from __future__ import annotations

import math
import tracemalloc
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.interop.formats.ros.ros_types import POINT_CLOUD
from semmap_log.interop.topics.lasers.placing import Cloud, Unusable, cloud_of, cut
from semmap_log.interop.topics.topic_rules import ReadScan, RosMapping, TopicRule
from tests.interop.formats.bags.bags_of_others import Said
from tests.interop.topics.laser_room import LaserRoom, moved, turned
from tests.interop.topics.robots import Robot
from tests.interop.topics.test_scans_placed import Hearing

ROOM = LaserRoom(seconds=3.0)


def _message(points: Any, robot: Robot = ROOM.robot, **values: Any) -> Any:
    """A cloud with a field between those that count, and bytes behind each row."""
    points = np.asarray(points, np.float32).reshape(-1, 3)
    dtype = np.dtype([("x", "<f4"), ("i", "<u2"), ("y", "<f4"), ("z", "<f4")])
    data = np.zeros(len(points), dtype)
    data["x"], data["y"], data["z"] = points.T
    fields = [
        robot.new("sensor_msgs/msg/PointField", name=name, offset=int(dtype.fields[name][1]),
                  datatype=7 if name != "i" else 4, count=1)
        for name in dtype.names
    ]  # fmt: skip
    true = {
        "header": robot.header(ROOM.ns(1.0), "laser"), "height": 1, "width": len(points),
        "fields": fields, "is_bigendian": False, "point_step": dtype.itemsize,
        "row_step": dtype.itemsize * len(points), "is_dense": True,
        "data": np.frombuffer(data.tobytes(), np.uint8),
    }  # fmt: skip
    return robot.new(POINT_CLOUD, **true | values)


def test_the_points_of_a_cloud_are_found_wherever_its_fields_lie() -> None:
    """Those that are not finite are left out."""
    points = [(1.0, 2.0, 3.0), (math.nan, 0, 0), (4.0, 5.0, math.inf), (-1.0, 0.5, 0.25)]

    found = cloud_of(_message(points))

    assert isinstance(found, Cloud)
    assert [[1.0, 2.0, 3.0], [-1.0, 0.5, 0.25]] == found.points.tolist()


def test_a_row_that_says_it_is_long_takes_no_memory() -> None:
    """The last row, or the only one, may lack what lies between rows; 4 GB are not made for it."""
    message = _message([(1.0, 2.0, 3.0)], row_step=2**32 - 1)
    tracemalloc.start()

    found = cloud_of(message)

    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert isinstance(found, Cloud)
    assert [[1.0, 2.0, 3.0]] == found.points.tolist()
    assert most < 10**6


def test_rows_of_a_cloud_may_be_longer_than_their_points() -> None:
    """An organised cloud of a camera, with bytes behind each row."""
    points = np.arange(12, dtype=np.float32).reshape(4, 3)
    plain = _message(points)
    rows = np.concatenate([plain.data.reshape(2, -1), np.full((2, 5), 9, np.uint8)], axis=1)

    found = cloud_of(
        _message(points, height=2, width=2, row_step=rows.shape[1], data=rows.reshape(-1))
    )

    assert isinstance(found, Cloud)
    np.testing.assert_array_equal(points, found.points)


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ({"width": 0}, "no or too many points"),
        ({"width": 2**31, "height": 2**31}, "no or too many points"),
        ({"fields": []}, "without x, y, z"),
        ({"point_step": 4}, "sizes disagree"),
        ({"row_step": 7}, "sizes disagree"),
        ({"data": np.zeros(3, np.uint8)}, "sizes disagree"),
    ],
)
def test_a_cloud_that_cannot_be_is_refused(values: dict[str, Any], kind: str) -> None:
    """By what is wrong, not by an exception."""
    found = cloud_of(_message([(1, 2, 3)] * 3, **values))

    assert isinstance(found, Unusable)
    assert kind in found.kind


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(-8, 8), st.floats(-8, 8), st.floats(-1, 3)), max_size=40))
def test_in_each_direction_the_nearest_point_of_the_band_counts(points: Any) -> None:
    """As a loop over the points finds it; where none is, nothing is said."""
    origin = np.array([0.5, -0.25, 1.0])
    bearings, ranges = cut(np.array(points, float).reshape(-1, 3), origin, (0.3, 1.5))

    expected = np.full(len(bearings), np.nan)
    width = math.tau / len(bearings)
    for x, y, z in points:
        away = math.hypot(x - origin[0], y - origin[1])
        if 0.3 <= z <= 1.5 and away >= 0.2:
            turn = math.atan2(y - origin[1], x - origin[0]) % math.tau
            place = int(((turn + math.pi) % math.tau) / width) % len(bearings)
            expected[place] = np.nanmin([expected[place], away])
    np.testing.assert_allclose(expected, ranges)


@pytest.mark.parametrize("version", [1, 2])
def test_a_cloud_of_a_tilted_sensor_is_cut_level_on_the_map(version: Any) -> None:
    """A wall from the floor to the ceiling, seen by a sensor that looks ten degrees down."""
    mount = moved(0.1, 0.0, 1.2) @ turned("z", 0.3) @ turned("y", math.radians(10))
    room = LaserRoom(version=version, seconds=3.0, mount=mount)
    wall = np.array([
        (x, 1.2, z, 1.0) for x in np.arange(3.0, 4.0, 0.01) for z in np.arange(-0.1, 2.6, 0.1)
    ])  # fmt: skip
    clutter = np.array([(x, 0.9, 0.1, 1.0) for x in np.arange(3.0, 4.0, 0.01)])
    seen = (np.linalg.inv(room.laser(1.0)) @ np.concatenate([wall, clutter]).T).T[:, :3]
    message = _message(seen, room.robot)
    data = room.robot.encoded(POINT_CLOUD, message)
    said = [*room.statics(), *room.tf(), Said("/velo", POINT_CLOUD, data, room.ns(1.2))]
    hearing = Hearing(RosMapping({"/velo": TopicRule(ReadScan(heights=(0.3, 1.5)))}), version)

    (each,) = hearing.hear(sorted(said, key=lambda each: each.at_ns))

    scan = each.scan
    ends = scan.origins + scan.ranges[:, None] * np.stack(
        [np.cos(scan.bearings), np.sin(scan.bearings)], axis=1
    )
    there = ends[np.isfinite(scan.ranges)]
    assert 20 < len(there) < 200
    np.testing.assert_allclose(np.full(len(there), 1.2), there[:, 1], atol=0.02)
    assert 2.95 < there[:, 0].min() < there[:, 0].max() < 4.05
    np.testing.assert_allclose(room.laser(1.0)[:2, 3], scan.origins[0], atol=1e-3)
    assert "laser" == scan.laser
    assert replace(each.pose, happened_ns=None).level == 0
