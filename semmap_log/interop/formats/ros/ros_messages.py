"""Builds ROS messages, of ROS 1's classes or of ROS 2's: what all kinds of messages share."""

from __future__ import annotations

import math
from typing import Any

from semmap_log.errors import OutputError
from semmap_log.interop.formats.ros.ros_types import RosVersion, ros_types

FRAME = "map"

LAST_STAMP_NS = 2**31 * 10**9
"""builtin_interfaces/Time counts its seconds in 31 bits: until January 2038."""


class Messages:
    """A factory of messages."""

    def __init__(self, ros_version: RosVersion) -> None:
        self.ros_version = ros_version
        self._types = ros_types(ros_version).types

    def new(self, ros_type: str, /, **values: Any) -> Any:
        """Return a message of that type, in ROS 2's long form."""
        return self._types[ros_type](**values)

    def header(self, at_ns: int, number: int = 0, frame: str = FRAME) -> Any:
        """Return a header.

        Args:
            at_ns: Its stamp.
            number: How many messages of its topic came before; ROS 1 has a field for it.
            frame: What the message is told in.

        Raises:
            OutputError: The time cannot be a ROS stamp.
        """
        count = {"seq": number % 2**32} if self.ros_version == 1 else {}
        return self.new("std_msgs/msg/Header", stamp=self.stamp(at_ns), frame_id=frame, **count)

    def stamp(self, at_ns: int) -> Any:
        """Return a time.

        Raises:
            OutputError: ROS has no number for it.
        """
        check_stamp(at_ns)
        seconds, nanoseconds = divmod(at_ns, 10**9)
        return self.new("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)

    def pose(self, x: float, y: float, z: float = 0.0, theta: float = 0.0) -> Any:
        """Return a pose: metres, and radians around z."""
        half = theta / 2
        return self.new(
            "geometry_msgs/msg/Pose",
            position=self.new("geometry_msgs/msg/Point", x=x, y=y, z=z),
            orientation=self.new(
                "geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=math.sin(half), w=math.cos(half)
            ),
        )


def check_stamp(at_ns: int) -> None:
    """Return if ROS has a stamp for that time.

    Raises:
        OutputError: It has none.
    """
    if not 0 <= at_ns < LAST_STAMP_NS:
        raise OutputError(
            f"a ROS message's stamp: expected a time from 1970 to January 2038, got @{at_ns}; "
            "choose another range."
        )
