"""ROS 1 (rospy and actionlib): a node as `ros_node` has it."""

from __future__ import annotations

import hashlib
import os
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from http.client import HTTPException
from types import ModuleType
from typing import Any

from semmap_log.errors import RosError
from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.interop.formats.ros.ros_types import RosVersion, long_name
from semmap_log.live.ros import ros1_topics, ros_node
from semmap_log.live.ros.ros1_messages import message_module

SENT_WITHIN_S = 5.0
"""How long what was published last may take to leave."""


def open_ros1_node(name: str, ros_args: Sequence[str] = ()) -> Ros1Node:
    """Join the network of a master; see `joining.open_node`."""
    for argument in ros_args:
        if argument.startswith("__ns:="):  # rospy looks for it when it is imported, in sys.argv
            os.environ["ROS_NAMESPACE"] = argument.partition(":=")[2]
    try:
        import rosgraph
        import rospy
    except ImportError as error:
        raise RosError(
            f"ROS 1 is not there for this Python ({error}). Source its setup.bash, or install "
            "python3-rospy and python3-actionlib, and run semmap-log with the Python they are for."
        ) from error
    if not rosgraph.is_master_online():
        raise RosError(
            f"no ROS master answers at {rosgraph.get_master_uri()}; start roscore, or set "
            "ROS_MASTER_URI."
        )
    ros1_topics.make_each_link_once()
    try:
        rospy.init_node(name, argv=["semmap-log", *ros_args], disable_signals=True)
        master = rosgraph.Master(name).getPid()
    except (rospy.ROSException, rosgraph.MasterException, OSError, ValueError) as error:
        raise RosError(f"{name}: cannot join ROS: {error}") from error
    return Ros1Node(rospy, master)


class Ros1Node:
    """The one node of this process: rospy knows no more."""

    ros_version: RosVersion = 1

    def __init__(self, rospy: ModuleType, master: int) -> None:
        """Take over what rospy has made of this process.

        Args:
            rospy: The module, initialized.
            master: The process of the master that it is registered with.
        """
        self._rospy = rospy
        self._master = master
        self._servers: list[Any] = []
        self._reason = ""
        """Why ROS has ended us."""
        rospy.core.add_preshutdown_hook(self._ending)
        self._clients: dict[str, Any] = {}
        self._goals = ThreadPoolExecutor(ros_node.GOALS_AT_ONCE, thread_name_prefix="goal")

    @property
    def name(self) -> str:
        """Its full name, namespace and remapping included."""
        return str(self._rospy.get_name())

    def parameter(self, name: str, default: Any) -> Any:
        """Return a private parameter, as `_name:=value` and launch files set it."""
        return self._rospy.get_param(f"~{name}", default)

    def now_ns(self) -> int:
        """Return ROS's time."""
        return int(self._rospy.get_rostime().to_nsec())

    def log(self, text: str, *, is_warning: bool = False) -> None:
        """Say something, on the terminal and on /rosout."""
        say = self._rospy.logwarn if is_warning else self._rospy.loginfo
        say("%s", text)

    def topics(self) -> dict[str, str]:
        """Return the topics that somebody publishes now, with their types."""
        try:
            found = self._rospy.get_published_topics()
        except (OSError, HTTPException, self._rospy.ROSException) as error:
            raise RosError(
                f"the ROS master does not answer ({error}); nodes that are connected stay so, "
                "others cannot be found."
            ) from error
        return {name: long_name(kind) for name, kind in found}

    def topics_of_server(self, name: str) -> set[str]:
        """Return what the node publishes which publishes the results of an action."""
        import rosgraph

        try:
            published, _, _ = rosgraph.Master(self.name).getSystemState()
        except (OSError, HTTPException, rosgraph.MasterException) as error:
            raise RosError(f"the ROS master does not answer ({error}).") from error
        by_topic = {topic: set(nodes) for topic, nodes in published}
        servers = by_topic.get(f"{self._rospy.resolve_name(name)}/result", set())
        return {topic for topic, nodes in by_topic.items() if nodes & servers}

    def publisher(self, topic: BagTopic) -> ros_node.Publisher:
        """Offer a topic; its type need not be installed."""
        return ros1_topics.Ros1Publisher(self._rospy, topic)

    def subscribe(
        self, topic: str, ros_type: str, take: Callable[[ros_node.Received], None]
    ) -> None:
        """Receive each message of a topic; its publisher describes the type."""

        def received(message: Any) -> None:
            said = message._connection_header  # noqa: SLF001  rospy has no other way to them
            kind = long_name(said["type"])
            if ros_type not in ("", kind):
                warn(kind, said["callerid"])
                return
            take(ros_node.Received(name, kind, message._buff, self.now_ns(),  # noqa: SLF001
                          said.get("message_definition", ""), said["callerid"]))  # fmt: skip

        @cache
        def warn(kind: str, sender: str) -> None:
            self.log(f"{name}: expected {ros_type}, got {kind} from {sender}; passed over.",
                     is_warning=True)  # fmt: skip

        name = self._rospy.resolve_name(topic)
        self._rospy.Subscriber(name, self._rospy.AnyMsg, received, tcp_nodelay=True)

    def serve_action(
        self, action: str, name: str, run: Callable[[ros_node.Goal], ros_node.Outcome]
    ) -> None:
        """Offer an action of the thesis; each goal runs in a thread of its own."""
        messages = message_module()
        server_class = ros1_topics.patient_server_class()

        def got(handle: Any) -> None:
            handle.set_accepted()
            self._goals.submit(self._run, server, handle, action, messages, run)

        server = server_class(
            self._rospy.resolve_name(name), getattr(messages, f"{action}Action"), got,
            auto_start=False,
        )  # fmt: skip
        self._servers.append(server)
        server.start()

    def _run(
        self, server: Any, handle: Any, action: str, messages: ModuleType,
        run: Callable[[ros_node.Goal], ros_node.Outcome],
    ) -> None:  # fmt: skip
        """Run a goal and send what becomes of it; one that was cancelled meanwhile has happened."""
        feedback = getattr(messages, f"{action}Feedback")
        result = getattr(messages, f"{action}Result")
        raw_goal_id = handle.get_goal_id().id
        goal = ros_node.Goal(
            action,
            hashlib.sha256(raw_goal_id.encode()).digest()[:16],
            raw_goal_id,
            ros1_topics.caller_of(handle),
            _values(handle.get_goal()),
            lambda percent: handle.publish_feedback(feedback(percent_complete=percent)),
        )
        outcome = ros_node.outcome_of(run, goal, lambda text: self.log(text, is_warning=True))
        ros1_topics.wait_for_listener(server, goal.caller)
        answer = handle.set_succeeded if outcome.succeeded else handle.set_aborted
        answer(result(**outcome.result), outcome.text)

    def call_action(
        self, action: str, name: str, values: ros_node.Values, *,
        goal_id: bytes | None = None, timeout_s: float = 10.0,
    ) -> ros_node.GoalAnswer:  # fmt: skip
        """Send a goal and return what becomes of it."""
        import actionlib

        messages, name = message_module(), self._rospy.resolve_name(name)
        if name not in self._clients:
            spec = getattr(messages, f"{action}Action")
            self._clients[name] = actionlib.ActionClient(name, spec)
        client = self._clients[name]
        if not ros1_topics.wait_for_server(client, timeout_s):
            raise RosError(
                f"no action server {name} answered within {timeout_s:g} s; is it running? "
                f"Check with `rostopic info {name}/goal`."
            )
        ros1_topics.wait_to_be_sent_results(client)
        done = threading.Event()

        def changed(handle: Any) -> None:
            if handle.get_comm_state() == actionlib.CommState.DONE:
                done.set()

        with ros1_topics.given_id(client, goal_id):
            handle = client.send_goal(getattr(messages, f"{action}Goal")(**values), changed)
        if not done.wait(timeout_s):
            raise RosError(
                f"{name}: no result within {timeout_s:g} s; what became of it is not known."
            )
        status = actionlib.TerminalState.to_string(handle.get_terminal_state())
        result = handle.get_result()
        return ros_node.GoalAnswer(
            {"PREEMPTED": "CANCELED", "RECALLED": "CANCELED"}.get(status, status),
            {} if result is None else _values(result),
            handle.get_goal_status_text(),
        )

    def run(self, stop: Callable[[], bool], *, tick: Callable[[], None] | None = None) -> None:
        """Wait while callbacks come.

        Raises:
            RosError: Another node has taken this one's name.
        """
        ended, watch = threading.Event(), (self.name, self._master)
        threading.Thread(target=ros1_topics.stay_known, args=[*watch, ended], daemon=True).start()
        try:
            while not self._rospy.is_shutdown() and not stop():
                if tick is not None:
                    tick()
                time.sleep(ros_node.TICK_S)
        finally:
            ended.set()
        if _SAME_NAME in self._reason:
            raise RosError(
                f"{self.name} was ended by ROS: another node has taken its name. Start one of them "
                "with another: __name:=…"
            )

    def _ending(self, reason: str) -> None:
        self._reason = reason

    def close(self) -> None:
        """Finish the goals that run, send what was published, and leave."""
        self._goals.shutdown(wait=True)
        deadline = time.monotonic() + SENT_WITHIN_S
        while ros1_topics.is_sending() and time.monotonic() < deadline:
            time.sleep(0.01)
        self._rospy.signal_shutdown("done")


_SAME_NAME = "new node registered with same name"
"""The master's message to a node that has lost its name: rosmaster/registrations.py."""


def _values(message: Any) -> ros_node.Values:
    return {name: getattr(message, name) for name in message.__slots__}
