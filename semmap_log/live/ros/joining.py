"""A node of ROS 1 or ROS 2, as requested."""

from __future__ import annotations

from collections.abc import Sequence

from semmap_log.interop.formats.ros.ros_types import RosVersion
from semmap_log.live.ros.ros_node import RosNode


def open_node(ros_version: RosVersion, name: str, ros_args: Sequence[str] = ()) -> RosNode:
    """Join ROS.

    Args:
        ros_version: 1 or 2.
        name: The node's, unless `ros_args` say otherwise.
        ros_args: As ROS's own tools take them: `__ns:=/robot1` and the like for ROS 1, what stands
            after `--ros-args` for ROS 2.

    Raises:
        RosError: That ROS is not installed here, or no master answers (ROS 1).
    """
    if ros_version == 1:
        from semmap_log.live.ros.ros1 import open_ros1_node

        return open_ros1_node(name, ros_args)
    from semmap_log.live.ros.ros2 import open_ros2_node

    return open_ros2_node(name, ros_args)
