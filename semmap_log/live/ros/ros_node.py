"""A ROS node as the server, the recorder and the player need it: alike for ROS 1 and ROS 2.

Messages cross this line as the bytes that ROS sends, so that `formats` reads and writes live topics
as it does bags. Goals and results cross it as plain values, by the names in the .action files.

The thesis does not name its four action servers. Each name here is relative, so that it follows the
node's namespace, and a private parameter of server and client, so that both fit a robot on which
they are called otherwise.

The ROS package with the messages is copied into a user's workspace from here.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, Protocol

from semmap_log.core.io.disk import atomic_folder, copy_folder
from semmap_log.errors import OutputError
from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.interop.formats.ros.ros_types import RosVersion
from semmap_log.live.ros.ros1_messages import generate

DEFAULTS = {
    "AddDoor": "lta_semantic_map/add_door",
    "UpdateDoor": "lta_semantic_map/update_door",
    "RemoveDoor": "lta_semantic_map/remove_door",
    "SaveDoorDB": "lta_semantic_map/save_door_db",
}
"""Action -> its server's name."""

PARAMETERS = {
    "AddDoor": "add_door",
    "UpdateDoor": "update_door",
    "RemoveDoor": "remove_door",
    "SaveDoorDB": "save_door_db",
}
"""Action -> the parameter that says another: `_add_door:=doors/add`, `-p add_door:=doors/add`."""


def action_name(node: RosNode, action: str) -> str:
    """Return the name of an action's server, as the node's parameters have it."""
    return str(node.parameter(PARAMETERS[action], DEFAULTS[action]))


NAME = "lta_semantic_map"
COMPILED = "__pycache__"
"""What installers put next to launch files."""


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
        atomic_folder(target) as temporary,
    ):
        generate(package, into=temporary.parent)
    return target, True


def _let_run_scripts(package: Path) -> None:
    """Make the scripts programs: an installer may have dropped that they are."""
    for script in (package / "scripts").iterdir():
        script.chmod(0o755)


GOALS_AT_ONCE = 8
"""Goals that run at the same time share the syncs of their commits."""

TICK_S = 0.05
"""How often a node that runs asks whether to stop."""

Values = Mapping[str, Any]
"""Field -> value, as a .action file names them; what is left out has ROS's default."""


@dataclass(frozen=True, slots=True)
class Received:
    """A message of a topic, as it came."""

    topic: str
    """Its full name, such as `/door_states`."""
    ros_type: str
    """In ROS 2's long form, such as `std_msgs/msg/Bool`; for ROS 1, too."""
    data: bytes
    """CDR with its four bytes of header (ROS 2), or as ROS 1 serializes."""
    received_ns: int
    """By the node's clock: the wall, or `/clock` where `use_sim_time` is set."""
    definition: str = ""
    """ROS 1: the text of the type and of all it is made of, as the publisher sent it."""
    sender: str = ""
    """ROS 1: the publisher's node."""


@dataclass(frozen=True, slots=True)
class Goal:
    """A goal as an action server got it."""

    action: str
    """Its type without the package, such as `AddDoor`."""
    goal_id: bytes
    """16 bytes: ROS 2's own; of ROS 1's text the first half of its sha256."""
    raw_goal_id: str
    """As people and tools of that ROS write it."""
    caller: str
    """The client's node; for ROS 2, which does not report it, all nodes with such a client."""
    values: Values
    feedback: Callable[[float], None] = field(compare=False)
    """Sends `percent_complete`, 0 to 100."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a goal: it succeeded, or was aborted."""

    succeeded: bool
    result: Values
    text: str = ""
    """Why, or a warning: a line of /rosout that names the goal; in ROS 1 the status' text, too."""


@dataclass(frozen=True, slots=True)
class GoalAnswer:
    """What an action server answered to a goal of ours."""

    status: str
    """`SUCCEEDED`, `ABORTED`, `CANCELED` or `REJECTED`."""
    result: Values
    text: str = ""
    """See `Outcome.text`."""


class Publisher(Protocol):
    """A topic that is published."""

    def publish(self, data: bytes) -> None:
        """Send a message; one that is latched is sent to later subscribers, too."""

    def subscribers(self) -> int:
        """Return how many listen now."""

    def wait(self, timeout_s: float) -> None:
        """Return once all that listen have what was published, or that time is over."""


class RosNode(Protocol):
    """A node; its callbacks come from threads of its own."""

    ros_version: RosVersion

    @property
    def name(self) -> str:
        """Its full name, namespace and remapping included."""

    def parameter(self, name: str, default: Any) -> Any:
        """Return a private parameter, as launch files and `-p name:=value` set it."""

    def now_ns(self) -> int:
        """Return ROS's time: the wall clock, or `/clock` where `use_sim_time` is set."""

    def log(self, text: str, *, is_warning: bool = False) -> None:
        """Say something, on the terminal and on /rosout."""

    def topics(self) -> dict[str, str]:
        """Return the topics that somebody publishes now, with their types (ROS 2's long form)."""

    def publisher(self, topic: BagTopic) -> Publisher:
        """Offer a topic.

        Raises:
            RosError: Its type is not installed.
        """

    def subscribe(self, topic: str, ros_type: str, take: Callable[[Received], None]) -> None:
        """Have each message of a topic from now on, the latched ones first.

        Args:
            topic: Its name; relative to the node's namespace unless it begins with a slash.
            ros_type: In the long form; "": whatever it is (ROS 1 only).
            take: Called from a thread of the node's; it must not take long.

        Raises:
            RosError: Its type is not installed (ROS 2; ROS 1 needs none).
        """

    def serve_action(self, action: str, name: str, run: Callable[[Goal], Outcome]) -> None:
        """Offer an action of the thesis.

        Args:
            action: Its type without the package, such as `AddDoor`.
            name: The server's name.
            run: Called for each goal, by several threads at once.
        """

    def call_action(
        self, action: str, name: str, values: Values, *,
        goal_id: bytes | None = None, timeout_s: float = 10.0,
    ) -> GoalAnswer:  # fmt: skip
        """Send a goal and return what becomes of it; the node need not be running.

        Args:
            action: As for `serve_action`.
            name: The server's name.
            values: The goal.
            goal_id: 16 bytes; None: a new one.
            timeout_s: How long to wait for a server, and then for its answer.

        Raises:
            RosError: No server, or no answer, within that time.
        """

    def topics_of_server(self, name: str) -> set[str]:
        """Return the topics that the node publishes which serves an action; none: nobody does yet.

        Args:
            name: The server's name.

        Raises:
            RosError: The master does not answer (ROS 1).
        """

    def run(self, stop: Callable[[], bool], *, tick: Callable[[], None] | None = None) -> None:
        """Run callbacks until stopped, or until ROS ends.

        Args:
            stop: Called some twenty times a second.
            tick: Called as often, by the calling thread.
        """

    def close(self) -> None:
        """Leave the network of nodes; messages that were published are sent first."""


def outcome_of(run: Callable[[Goal], Outcome], goal: Goal, log: Callable[[str], None]) -> Outcome:
    """Run a goal; its client waits for an answer, whatever is raised.

    Why a goal was refused is logged, and what is odd about one that was not: whoever runs the
    server sees it, too, not the client alone. So is the trace of an error of our own.
    """
    try:
        outcome = run(goal)
    except Exception as error:  # noqa: BLE001  see above
        log(f"{goal.action} {goal.raw_goal_id}: {traceback.format_exc()}")
        outcome = Outcome(succeeded=False, result={}, text=f"{type(error).__name__}: {error}")
    if outcome.text:
        what = "warning about goal" if outcome.succeeded else "refused goal"
        log(f"{goal.action}: {what} {goal.raw_goal_id}: {outcome.text}")
    return outcome
