"""`ros-package`: the ROS package of messages, actions and launch files, into a workspace."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from semmap_log.cli.common import AsJson, print_json, say


def run(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", help="The src folder of a workspace; it must be there. See --messages."
        ),
    ],
    *,
    messages: Annotated[
        bool,
        typer.Option("--messages", help="ROS 1: its messages as Python modules, without a build."),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Copy the ROS package lta_semantic_map into a workspace.

    The thesis's messages and actions, and launch files for server and recorder: for catkin (ROS 1)
    and colcon (ROS 2) alike, so that nodes in C++ and Python use them as those of any package. What
    is there already under that name stays, and is an error unless it is the same.

    With --messages there need be no workspace: Python nodes and tools of ROS 1, such as rostopic,
    use the messages from DIR, where that is on PYTHONPATH. C++ nodes and roslaunch need the build.

    \b
    Examples:
      semmap-log ros-package ~/catkin_ws/src
      semmap-log ros-package ~/ros2_ws/src
      semmap-log ros-package ~/door_messages --messages
    """
    from semmap_log.live.ros.ros_node import NAME, write_ros1_messages, write_ros_package

    if messages:
        made, is_new = write_ros1_messages(folder)
        say(f"{made}: {'written' if is_new else 'there already'}. To use it:")
        path = shlex.quote(str(folder.absolute()))
        say(f"  export PYTHONPATH={path}${{PYTHONPATH:+:$PYTHONPATH}}")
        return
    package, is_new = write_ros_package(folder)
    if as_json:
        print_json({"package": str(package), "written": is_new})
        return
    say(f"{package}: {'written' if is_new else 'there already, the same'}. To build it:")
    workspace = shlex.quote(str(folder.absolute().parent))
    say(f"  ROS 1: cd {workspace} && catkin_make && . devel/setup.sh")
    say(f"  ROS 2: cd {workspace} && colcon build --packages-select {NAME} && . install/setup.sh")
    say(f"Then: ROS 1 roslaunch {NAME} server.launch log:=LOG; "
        f"ROS 2 ros2 launch {NAME} server.launch.py log:=LOG")  # fmt: skip
