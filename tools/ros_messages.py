"""Build ROS messages for the Python that runs this, without catkin, CMake or colcon.

    .ros/ros1/bin/python tools/ros_messages.py semmap_log/live/robot_files/lta_semantic_map
    .ros/jazzy/bin/python tools/ros_messages.py FOLDER FOLDER …

Each folder is a package, with its definitions in msg, srv and action; they may build on each other
and on what is installed. For ROS 1, genpy writes Python; for ROS 2, rosidl's generators write C,
C++ and Python, which needs gcc and g++. The result is installed into the venv. For people with a
workspace: `semmap-log ros-package` and catkin or colcon do all of this, and more.
"""

from __future__ import annotations

import argparse
import sys
import sysconfig
import time
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path

from ros_interfaces.package import InterfacePackage, in_order

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # semmap_log, wherever this runs


def main(arguments: Sequence[str] | None = None) -> int:
    """Build the packages that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("packages", nargs="+", type=Path, help="folders with msg, srv, action")
    args = parser.parse_args(arguments)
    build = _builder()
    for package in in_order(InterfacePackage(folder.resolve()) for folder in args.packages):
        if not package.definitions:
            parser.error(f"{package.folder}: no msg/*.msg, srv/*.srv or action/*.action in it")
        start = time.monotonic()
        build(package)
        print(f"built {package.name}: {len(package.definitions)} definitions, "
              f"{time.monotonic() - start:.1f} s")  # fmt: skip
    return 0


def _builder() -> Callable[[InterfacePackage], None]:
    """Return what builds for the ROS of this Python."""
    if find_spec("rosidl_generator_py"):
        from ros_interfaces.ros2_build import build

        return build
    if find_spec("genpy"):
        return _build_for_ros1
    raise SystemExit(f"{sys.executable} has neither ROS 1 (genpy) nor ROS 2 (rosidl_generator_py).")


def _build_for_ros1(package: InterfacePackage) -> None:
    from semmap_log.live.ros.ros1_messages import generate

    generate(package.folder, into=Path(sysconfig.get_paths()["purelib"]))


if __name__ == "__main__":
    sys.exit(main())
