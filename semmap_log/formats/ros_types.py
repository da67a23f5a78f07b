"""The ROS messages of foreign bags: the types of noetic and of Jazzy, and those they left out."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from importlib.resources import files
from typing import Any, Literal

GRID = "nav_msgs/msg/OccupancyGrid"
GRID_UPDATE = "map_msgs/msg/OccupancyGridUpdate"
MARKER = "visualization_msgs/msg/Marker"
MARKERS = "visualization_msgs/msg/MarkerArray"
POSE_STAMPED = "geometry_msgs/msg/PoseStamped"
DOOR_ENTRY = "lta_semantic_map/msg/DoorEntry"
DOOR_MAP = "lta_semantic_map/msg/DoorMap"

RosVersion = Literal[1, 2]

_LEFT_OUT = {
    GRID_UPDATE: """\
std_msgs/Header header
int32 x
int32 y
uint32 width
uint32 height
int8[] data
""",
}
"""Types that rosbags does not know; the texts are those of ros-planning/navigation_msgs."""


def log_type(version: RosVersion) -> str:
    """Return the type of a line of log, which ROS 2 has renamed."""
    return "rosgraph_msgs/msg/Log" if version == 1 else "rcl_interfaces/msg/Log"


@cache
def ros_types(version: RosVersion) -> Any:
    """Return rosbags' store of the types of ROS 1 (noetic) or ROS 2 (Jazzy)."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_JAZZY)
    for name, text in _LEFT_OUT.items():
        types.register(get_types_from_msg(text, name))
    for name, text in _thesis_texts():
        types.register(get_types_from_msg(text, name))
    return types


def _thesis_texts() -> Iterator[tuple[str, str]]:
    """Yield name and text of each message of the thesis's package."""
    package = "lta_semantic_map"
    for file in (files("semmap_log") / "ros" / package / "msg").iterdir():
        name = file.name.removesuffix(".msg")
        yield f"{package}/msg/{name}", file.read_text(encoding="utf-8")
