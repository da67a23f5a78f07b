"""What each ROS that tests run in is made of."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
THESIS = ROOT / "semmap_log" / "live" / "robot_files" / "lta_semantic_map"
INTERFACES = ROOT / "tests" / "live" / "ros" / "interfaces"
BUILDER = [HERE / "package.py", HERE / "ros2_sources.py", HERE / "ros2_build.py",
           ROOT / "tools" / "ros_messages.py",
           ROOT / "semmap_log" / "live" / "ros" / "ros1_messages.py"]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Leg:
    """One ROS, in a virtual environment of its own."""

    name: str
    python: str
    """Makes the environment."""
    apt: tuple[str, ...]
    """Debian packages."""
    interfaces: str
    """The folder of other packages' messages."""
    venv_options: tuple[str, ...] = ()
    wheels: tuple[str, ...] = ()
    """What pip installs beside this package."""

    @property
    def folder(self) -> Path:
        """Return where it is."""
        return Path(os.environ.get("SEMMAP_ROS", ROOT / ".ros")).resolve() / self.name

    @property
    def interpreter(self) -> Path:
        """Return the Python that has this ROS."""
        return self.folder / "bin" / "python"

    @property
    def packages(self) -> list[Path]:
        """Return the folders whose messages are built."""
        return [THESIS, *sorted((INTERFACES / self.interfaces).iterdir())]

    def environment_key(self) -> str:
        """Return a digest that changes with what the environment is made of."""
        made_of = [*self.apt, *self.venv_options, *self.wheels, _our_dependencies()]
        if not self.wheels:
            return _digest([], said="\n".join(made_of))
        made_of += [str(sys.version_info[:2])]  # of the Python that makes it
        return _digest([HERE / f"{self.name}.txt"], said="\n".join(made_of))

    def messages_key(self) -> str:
        """Return a digest that changes with the messages and with what builds them."""
        texts = [path for package in self.packages for path in sorted(package.glob("*/*.*"))]
        return _digest([*BUILDER, *texts], said="")


def _digest(files: Iterable[Path], *, said: str) -> str:
    digest = hashlib.sha256(said.encode())
    for path in files:
        digest.update(f"\n{path.relative_to(ROOT)}\n".encode() + path.read_bytes())
    return digest.hexdigest()


def _our_dependencies() -> str:
    """Return what this package needs, as pyproject.toml says it (Python 3.10 reads no TOML)."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    return text.partition("\ndependencies = [\n")[2].partition("\n]\n")[0]


def _wheels(leg: str) -> tuple[str, ...]:
    """Return what pip is told: the packages we use, and the versions of those and all they need."""
    names = ("rclpy", "rmw-fastrtps-cpp", "rosidl-default-generators", "nav-msgs", "geometry-msgs",
             "visualization-msgs", "std-msgs", "rosgraph-msgs")  # fmt: skip
    return ("-c", str(HERE / f"{leg}.txt"), *(f"ros-{name}" for name in names))


ROS1 = Leg(
    "ros1",
    "/usr/bin/python3",  # which Debian's ROS is for
    ("python3-rospy", "python3-actionlib", "python3-rosbag", "python3-roslaunch",
     "python3-rostopic", "python3-rosmsg", "python3-rosnode", "ros-core", "python3-nav-msgs",
     "python3-geometry-msgs", "python3-visualization-msgs", "python3-map-msgs", "python3-tf2-msgs",
     "python3-venv",
     # what builds a workspace
     "catkin", "ros-message-generation", "ros-std-msgs", "libstd-msgs-dev", "ros-actionlib-msgs",
     "libactionlib-msgs-dev", "g++", "make"),
    "ros1",
    venv_options=("--system-site-packages",),
)  # fmt: skip
JAZZY = Leg("jazzy", sys.executable, ("g++",), "ros2", wheels=_wheels("jazzy"))
KILTED = Leg("kilted", sys.executable, ("g++",), "ros2", wheels=_wheels("kilted"))
