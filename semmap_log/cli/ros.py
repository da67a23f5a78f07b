"""What the verbs share that join ROS: which one, and the arguments that are ROS's own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from semmap_log.interop.formats.ros.ros_types import RosVersion
    from semmap_log.live.ros.ros_node import RosNode

VERBS = ("serve", "record", "play", "call")

Ros1 = Annotated[bool, typer.Option("--ros1", help="Join ROS 1, by ROS_MASTER_URI.")]
Ros2 = Annotated[bool, typer.Option("--ros2", help="Join ROS 2, by ROS_DOMAIN_ID.")]


def split_ros_args(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return our arguments, and those that launch files and people give to any ROS node.

    These are, for the verbs that join ROS, all that contain `:=` (ROS 1: `__ns:=/robot1`,
    `/map:=/floor`, `_param:=1`), and what stands from `--ros-args` to `--` or the end (ROS 2).
    """
    verb = next((each for each in arguments if not each.startswith("-")), "")
    if verb not in VERBS:
        return list(arguments), []
    ours: list[str] = []
    theirs: list[str] = []
    in_ros_args = False
    for each in arguments:
        if each == "--ros-args":
            in_ros_args = True
        if in_ros_args or ":=" in each:
            theirs.append(each)
        else:
            ours.append(each)
        if each == "--":
            in_ros_args = False
    return ours, theirs


def chosen_ros(*, ros1: bool, ros2: bool) -> RosVersion:
    """Return which ROS was requested.

    Raises:
        BadParameter: None, or both.
    """
    if ros1 == ros2:
        raise typer.BadParameter("say which ROS: --ros1 or --ros2", param_hint="--ros1, --ros2")
    return 1 if ros1 else 2


def open_node(context: typer.Context, version: RosVersion, name: str) -> RosNode:
    """Join ROS with the arguments that were given for it.

    Args:
        context: Of the verb.
        version: Which ROS.
        name: The node's, unless the arguments say otherwise.

    Raises:
        RosError: It is not installed, or does not answer.
    """
    from semmap_log.live.ros import joining

    return joining.open_node(version, name, context.obj or [])
