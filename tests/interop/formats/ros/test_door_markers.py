"""Where a door's markers lie: the leaf on the door's line, the name beside it."""

from __future__ import annotations

import math
from typing import Any

import pytest

from semmap_log.core.model.doors import DoorId
from semmap_log.interop.formats.ros.door_messages import DoorLook, DoorMarkers, marker_id_of
from semmap_log.interop.formats.ros.ros_types import MARKERS, ros_types

BLACK = (0, 0, 0)


def markers_of(theta: float, label: str = "front", width: float = 1.0) -> tuple[Any, Any]:
    """Return leaf and name of a door that begins at (1, 2) on a floor at 3 m."""
    builder = DoorMarkers(2)
    look = DoorLook(DoorId(7), (1.0, 2.0), theta, width, 3.0, label, BLACK, BLACK)
    message = ros_types(2).deserialize_cdr(builder.message([builder.encoded(look)]), MARKERS)
    _, leaf, name = message.markers
    return leaf, name


@pytest.mark.parametrize("theta", [0.0, 0.5, -0.7, 3.0])
def test_a_name_stands_south_of_a_door_from_west_to_east(theta: float) -> None:
    """Below the lower of its ends, whatever its length."""
    leaf, name = markers_of(theta, "a long name of a door")

    lower = min(2.0, 2.0 + math.sin(theta))
    assert math.isclose(lower - 0.35, name.pose.position.y)
    assert math.isclose(leaf.pose.position.x, name.pose.position.x)


@pytest.mark.parametrize("theta", [math.pi / 2, -math.pi / 2, 1.2, 2.0])
def test_a_name_stands_east_of_a_door_from_south_to_north(theta: float) -> None:
    """It begins behind the door: its letters are at most 0.6 of its height wide."""
    leaf, name = markers_of(theta, "x" * 10)

    eastern = max(1.0, 1.0 + math.cos(theta))
    begins = name.pose.position.x - 10 * 0.6 * name.scale.z / 2
    assert math.isclose(eastern + 0.35, begins)
    assert math.isclose(leaf.pose.position.y, name.pose.position.y)


def test_a_leaf_stands_on_its_floor() -> None:
    """2 m high, 0.1 m thick; without width a post, since RViz refuses a marker of size 0."""
    leaf, name = markers_of(0.0)
    post, _ = markers_of(0.0, width=0.0)

    assert (1.0, 0.1, 2.0) == (leaf.scale.x, leaf.scale.y, leaf.scale.z)
    assert (1.5, 2.0, 4.0) == (leaf.pose.position.x, leaf.pose.position.y, leaf.pose.position.z)
    assert (0.1, 0.1, 2.0) == (post.scale.x, post.scale.y, post.scale.z)
    assert 5.0 == name.pose.position.z


@pytest.mark.parametrize(
    ("door", "marker"), [(1, 1), (2**31 - 1, 2**31 - 1), (2**31, -(2**31)), (2**32 - 1, -1)]
)
def test_a_marker_has_an_id_for_every_door(door: int, marker: int) -> None:
    """Markers count in int32, doors in uint32: no two doors share one."""
    assert marker == marker_id_of(DoorId(door))
