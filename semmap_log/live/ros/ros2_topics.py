"""ROS 2's topics as bytes: publishers, readers that ask for what is offered, compiled classes.

It also adds what rclpy's actions lack: who sent a goal, and an answer to one that is sent again.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

from semmap_log.errors import RosError
from semmap_log.interop.formats.bags.bag_protocol import BagTopic

KNOWN_WITHIN_S = 2.0
"""How long a goal waits for its client's node to become known."""


def action_class(action: str) -> Any:
    """Return the class of one of the thesis's actions, such as `AddDoor`; see `installed_class`."""
    return installed_class(f"{PACKAGE}.action", action, f"{PACKAGE}/action/{action}")


ANSWER_TRIES = 10
"""DDS waits 0.1 s for a client whose reader it does not know yet, then it says no."""


def patient_server_class() -> Any:
    """Return rclpy's server, less two of its habits.

    It rejects a goal that is sent again. But its client may have crashed before it had the answer:
    it is accepted, and gets that. What was aborted is rejected as before, until its result is
    forgotten: it may go well then.

    And a goal whose acceptance could not be sent, since its client is not known yet or has gone,
    it keeps, and never runs. Here the acceptance is sent again for a second, and the goal is run.
    """
    from action_msgs.msg import GoalStatus
    from rclpy.action import ActionServer
    from rclpy.impl.implementation_singleton import rclpy_implementation

    def is_same(known: Any, asked: Any) -> bool:
        if known is None or known.status == GoalStatus.STATUS_ABORTED:
            return False
        return repr(known.request) == repr(asked)  # by repr NaN is NaN

    class PatientActionServer(ActionServer):  # type: ignore[misc]
        def register_handle_accepted_callback(self, run: Callable[[Any], None]) -> None:
            def run_once(handle: Any) -> None:
                handle.has_begun = True
                run(handle)

            super().register_handle_accepted_callback(run_once)

        async def _execute_goal_request(self, request_header_and_message: Any) -> None:
            header, asked = request_header_and_message
            goal_id = bytes(asked.goal_id.uuid)
            known = self._goal_handles.get(goal_id)
            if is_same(known, asked.goal):
                self._accept(header)
                return
            await super()._execute_goal_request(request_header_and_message)
            made = self._goal_handles.get(goal_id)
            if made is not None and made is not known and not hasattr(made, "has_begun"):
                self._accept(header)
                self._handle_accepted_callback(made)

        def _accept(self, header: Any) -> None:
            accepted = self._action_type.Impl.SendGoalService.Response(accepted=True)
            self._insist(lambda: self._handle.send_goal_response(header, accepted))

        def _send_result_response(self, header: Any, future: Any) -> None:
            self._insist(lambda: self._handle.send_result_response(header, future.result()))

        async def _execute_get_result_request(self, request_header_and_message: Any) -> None:
            with suppress(rclpy_implementation.RCLError):  # of a goal that is not known
                await super()._execute_get_result_request(request_header_and_message)

        def _insist(self, send: Callable[[], None]) -> None:
            """Send an answer, as soon as its client is known; who has gone gets none."""
            for _ in range(ANSWER_TRIES):
                with suppress(rclpy_implementation.RCLError), self._lock:
                    send()
                    return
            self._logger.warning("an answer could not be sent; its client may have gone away")

    return PatientActionServer


def callers_of(node: Any, action_name: str) -> str:
    """Return the nodes that have a client of an action: ROS 2 does not say who sent a goal.

    A client's goal may come before the word of its node: that is waited for, a little.
    """
    until = time.monotonic() + KNOWN_WITHIN_S
    while not (found := _clients_of(node, action_name)) and time.monotonic() < until:
        time.sleep(0.01)
    return " or ".join(sorted(found))


def _clients_of(node: Any, action_name: str) -> set[str]:
    from rclpy.action import get_action_client_names_and_types_by_node

    found = set()
    for name, namespace in node.get_node_names_and_namespaces():
        try:
            clients = get_action_client_names_and_types_by_node(node, name, namespace)
        except RuntimeError:  # it has gone since
            continue
        if any(theirs == action_name for theirs, _ in clients):
            found.add(f"{namespace.rstrip('/')}/{name}")
    return found


PACKAGE = "lta_semantic_map"

QUEUED = 1000
"""Messages of a topic that wait for a slow reader."""


@dataclass(slots=True)
class MatchedReader:
    """A subscription that asks for no more than its publishers offer; else DDS gives nothing."""

    node: Any
    topic: str
    ros_type: str
    received: Callable[[bytes], None]
    warn: Callable[[str], None]
    subscription: Any = None
    asks: tuple[bool, bool] | None = None
    """For what was sent before, and that nothing is lost."""
    strangers: set[str] = field(default_factory=set)
    """Other types that are published on the topic, and were reported."""

    def look(self) -> None:
        """Subscribe once there is a publisher; resubscribe for less if one offers less."""
        from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

        offers = self._offers()
        if not offers:
            return
        all_latched = all(each.durability == DurabilityPolicy.TRANSIENT_LOCAL for each in offers)
        all_reliable = all(each.reliability == ReliabilityPolicy.RELIABLE for each in offers)
        if self.asks is not None:
            all_latched, all_reliable = self.asks[0] & all_latched, self.asks[1] & all_reliable
        if self.asks == (all_latched, all_reliable):
            return
        if self.subscription is not None:
            self.node.destroy_subscription(self.subscription)
        profile = QoSProfile(
            depth=QUEUED,
            durability=(
                DurabilityPolicy.TRANSIENT_LOCAL if all_latched else DurabilityPolicy.VOLATILE
            ),
            reliability=(
                ReliabilityPolicy.RELIABLE if all_reliable else ReliabilityPolicy.BEST_EFFORT
            ),
        )
        self.asks = (all_latched, all_reliable)
        self.subscription = self.node.create_subscription(
            message_class(self.ros_type), self.topic, self.received, profile, raw=True
        )

    def _offers(self) -> list[Any]:
        """Return the QoS of all publishers; one of another type is passed over, aloud."""
        publishers = self.node.get_publishers_info_by_topic(self.topic)
        for kind in {each.topic_type for each in publishers} - {self.ros_type} - self.strangers:
            self.strangers.add(kind)
            self.warn(f"{self.topic}: expected {self.ros_type}, got {kind}; passed over.")
        return [each.qos_profile for each in publishers if each.topic_type == self.ros_type]


class Ros2Publisher:
    """A publisher of bytes; a latched one is `transient_local`, with its last message."""

    def __init__(self, node: Any, topic: BagTopic) -> None:
        from rclpy.qos import DurabilityPolicy, QoSProfile

        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        profile = latched if topic.is_latched else QoSProfile(depth=QUEUED)
        self._publisher = node.create_publisher(message_class(topic.ros_type), topic.name, profile)

    def publish(self, data: bytes) -> None:
        """Send a message."""
        self._publisher.publish(data)

    def subscribers(self) -> int:
        """Return how many listen now."""
        return int(self._publisher.get_subscription_count())

    def wait(self, timeout_s: float) -> None:
        """Return once reliable readers have it all, or that time is over."""
        from rclpy.duration import Duration

        self._publisher.wait_for_all_acked(Duration(seconds=timeout_s))


def message_class(ros_type: str) -> Any:
    """Return a message's class; see `installed_class`."""
    package, _, name = ros_type.partition("/msg/")
    return installed_class(f"{package}.msg", name, ros_type)


def installed_class(module: str, name: str, ros_type: str) -> Any:
    """Return a class that ROS has compiled.

    Raises:
        RosError: It has not.
    """
    try:
        return getattr(import_module(module), name)
    except (ImportError, AttributeError) as error:
        package = module.partition(".")[0]
        how = (
            "build it with colcon (`semmap-log ros-package` has its source)"
            if package == PACKAGE
            else f"install it: ros-$ROS_DISTRO-{package.replace('_', '-')}"
        )
        raise RosError(
            f"{ros_type}: the package {package} is not there for this Python; {how}, and source "
            "the workspace."
        ) from error
