"""The ROS messages of foreign bags: the types of noetic and of Jazzy, and those they left out."""

from __future__ import annotations

from functools import cache
from typing import Any, Literal

GRID = "nav_msgs/msg/OccupancyGrid"
GRID_UPDATE = "map_msgs/msg/OccupancyGridUpdate"

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


@cache
def ros_types(version: RosVersion) -> Any:
    """Return rosbags' store of the types of ROS 1 (noetic) or ROS 2 (Jazzy)."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_JAZZY)
    for name, text in _LEFT_OUT.items():
        types.register(get_types_from_msg(text, name))
    return types
