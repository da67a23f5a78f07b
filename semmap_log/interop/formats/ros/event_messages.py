"""Single events as messages: where the robot was, and lines for a log panel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from semmap_log.core.model.events import RobotPose
from semmap_log.interop.formats.ros.ros_messages import Messages
from semmap_log.interop.formats.ros.ros_types import POSE_STAMPED, log_type

_INFO = {1: 2, 2: 20}
"""By the version of ROS."""


def pose_message(messages: Messages, at_ns: int, number: int, pose: RobotPose, z: float) -> Any:
    """Return a geometry_msgs/PoseStamped.

    Args:
        messages: Of which ROS.
        at_ns: Its stamp.
        number: How many came before on its topic.
        pose: Where the robot was.
        z: The floor's height, metres.
    """
    header = messages.header(at_ns, number)
    return messages.new(
        POSE_STAMPED, header=header, pose=messages.pose(pose.x, pose.y, z, pose.theta)
    )


@dataclass(frozen=True, slots=True)
class LogLine:
    """A line of a log panel, in the words of ROS."""

    name: str
    """Of the node: panels choose by it."""
    msg: str
    file: str
    function: str
    line: int


def log_message(messages: Messages, at_ns: int, number: int, said: LogLine) -> Any:
    """Return an rcl_interfaces/Log, or of ROS 1 a rosgraph_msgs/Log, of level INFO."""
    version = messages.ros_version
    values: dict[str, Any] = {"name": said.name, "msg": said.msg, "file": said.file,
                              "function": said.function, "line": said.line % 2**32}  # fmt: skip
    if version == 1:
        values |= {"header": messages.header(at_ns, number), "topics": []}
    else:
        values |= {"stamp": messages.stamp(at_ns)}
    return messages.new(log_type(version), level=_INFO[version], **values)
