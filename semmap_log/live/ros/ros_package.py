"""The ROS package that comes with this one, copied into somebody's workspace."""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path

from semmap_log.core.io.disk import whole_folder
from semmap_log.core.io.shipped_files import copy_folder
from semmap_log.errors import OutputError
from semmap_log.live.ros.ros1_messages import generate

NAME = "lta_semantic_map"
COMPILED = "__pycache__"
"""What installers put beside launch files."""


def write_ros_package(workspace_src: Path) -> tuple[Path, bool]:
    """Copy the package, whole or not at all.

    Args:
        workspace_src: The `src` folder of a catkin or colcon workspace.

    Returns:
        Where it is, and whether it was written now: the same files are left as they are.

    Raises:
        OutputError: There is no such folder, something else bears the package's name in it, or it
            cannot be written.
    """
    target = workspace_src / NAME
    if not workspace_src.is_dir():
        raise OutputError(f"{workspace_src}: no such folder; expected a workspace's src.")
    with as_file(files("semmap_log") / "live" / "robot_files" / NAME) as package:
        return target, copy_folder(
            package, target, kind="package", made=(COMPILED,), finish=_let_run_scripts
        )


def write_ros1_messages(folder: Path) -> tuple[Path, bool]:
    """Write the package's messages as Python modules, for ROS 1 without a workspace.

    Args:
        folder: Is to be on PYTHONPATH where they are used; made if it is not there.

    Returns:
        Where they are, and whether they were written now: modules that are there are left.

    Raises:
        RosError: genpy is not here.
        OutputError: Something else bears the package's name in the folder.
    """
    target = folder / NAME
    if target.exists():
        if not (target / "msg" / "_DoorMap.py").is_file():
            raise OutputError(f"{target}: is there already, and has no messages of ROS 1 in it.")
        return target, False
    folder.mkdir(parents=True, exist_ok=True)
    with (
        as_file(files("semmap_log") / "live" / "robot_files" / NAME) as package,
        whole_folder(target) as temporary,
    ):
        generate(package, into=temporary.parent)
    return target, True


def _let_run_scripts(package: Path) -> None:
    """Make the scripts programs: an installer may have dropped that they are."""
    for script in (package / "scripts").iterdir():
        script.chmod(0o755)
