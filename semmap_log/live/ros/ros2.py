"""ROS 2 (rclpy): a node as `ros_node` has it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any

from semmap_log.errors import RosError
from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.interop.formats.ros.ros_types import RosVersion
from semmap_log.live.ros import ros2_topics, ros_node

LOOK_S = 0.1
"""How often it is looked who publishes what we want; rosbag2's recorder does it so, too."""

RESULT_KEPT_S = 10
"""How long the result of a goal can be fetched. Each message of an action's status lists all
goals of that time."""

ACKNOWLEDGED_WITHIN_S = 5.0
"""How long what was published last may take to arrive."""


def open_ros2_node(name: str, ros_args: Sequence[str] = ()) -> Ros2Node:
    """Join the domain of the environment; see `joining.open_node`."""
    try:
        import rclpy
        from rclpy.context import Context
        from rclpy.signals import SignalHandlerOptions
    except ImportError as error:
        raise RosError(
            f"ROS 2 is not there for this Python ({error}). Source its setup.bash, and run "
            "semmap-log with the Python it is for."
        ) from error
    context = Context()
    try:
        rclpy.init(
            args=["semmap-log", *ros_args],
            context=context,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        return Ros2Node(rclpy.create_node(name, context=context), context)
    except Exception as error:
        context.try_shutdown()
        raise RosError(f"{name}: cannot join ROS: {error}") from error


class Ros2Node:
    """A node with an executor of its own, which works while `run` does."""

    ros_version: RosVersion = 2

    def __init__(self, node: Any, context: Any) -> None:
        from rclpy.executors import SingleThreadedExecutor

        self._node = node
        self._context = context
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(node)
        self._publishers: list[ros2_topics.Ros2Publisher] = []
        self._readers: list[ros2_topics.MatchedReader] = []
        self._goals = ThreadPoolExecutor(ros_node.GOALS_AT_ONCE, thread_name_prefix="goal")

    @property
    def name(self) -> str:
        """Its full name, namespace and remapping included."""
        return str(self._node.get_fully_qualified_name())

    def parameter(self, name: str, default: Any) -> Any:
        """Return a parameter, as `-p name:=value` and launch files set it."""
        from rcl_interfaces.msg import ParameterDescriptor

        if not self._node.has_parameter(name):
            any_type = ParameterDescriptor(dynamic_typing=True)
            self._node.declare_parameter(name, default, any_type)
        return self._node.get_parameter(name).value

    def now_ns(self) -> int:
        """Return ROS's time."""
        return int(self._node.get_clock().now().nanoseconds)

    def log(self, text: str, *, is_warning: bool = False) -> None:
        """Say something, on the terminal and on /rosout."""
        logger = self._node.get_logger()
        if is_warning:  # rclpy refuses one place in the code that logs with two severities
            logger.warning(text)
        else:
            logger.info(text)

    def topics(self) -> dict[str, str]:
        """Return the topics that somebody publishes now, with their types."""
        known = self._node.get_topic_names_and_types()
        return {name: kinds[0] for name, kinds in known if self._node.count_publishers(name)}

    def topics_of_server(self, name: str) -> set[str]:
        """Return what the node publishes which publishes the feedback of an action."""
        feedback = f"{self._node.resolve_topic_name(name)}/_action/feedback"
        found: set[str] = set()
        for each in self._node.get_publishers_info_by_topic(feedback):
            of_node = self._node.get_publisher_names_and_types_by_node
            with suppress(RuntimeError):  # its name is not known yet, or it has gone since
                found |= {topic for topic, _ in of_node(each.node_name, each.node_namespace)}
        return found

    def publisher(self, topic: BagTopic) -> ros_node.Publisher:
        """Offer a topic."""
        made = ros2_topics.Ros2Publisher(self._node, topic)
        self._publishers.append(made)
        return made

    def subscribe(
        self, topic: str, ros_type: str, take: Callable[[ros_node.Received], None]
    ) -> None:
        """Have each message of a topic, as soon as somebody publishes it."""
        ros2_topics.message_class(ros_type)  # fails at once if it is not installed
        name = self._node.resolve_topic_name(topic)

        def received(data: bytes) -> None:
            take(ros_node.Received(name, ros_type, bytes(data), self.now_ns()))

        def warn(text: str) -> None:
            self.log(text, is_warning=True)

        self._readers.append(ros2_topics.MatchedReader(self._node, name, ros_type, received, warn))
        if len(self._readers) == 1:
            self._node.create_timer(LOOK_S, self._look, clock=_steady_clock())
        self._look()

    def _look(self) -> None:
        for reader in self._readers:
            reader.look()

    def serve_action(
        self, action: str, name: str, run: Callable[[ros_node.Goal], ros_node.Outcome]
    ) -> None:
        """Offer an action of the thesis; each goal runs in a thread of its own."""
        kind = ros2_topics.action_class(action)
        name = self._node.resolve_topic_name(name)

        def accepted(handle: Any) -> None:
            self._goals.submit(self._run, handle, action, name, kind, run)

        # A cancel is refused, as rclpy does by default: the goal has happened, or is about to.
        ros2_topics.patient_server_class()(
            self._node, kind, name, _refuse_to_run,
            handle_accepted_callback=accepted, result_timeout=RESULT_KEPT_S,
        )  # fmt: skip

    def _run(
        self,
        handle: Any,
        action: str,
        name: str,
        kind: Any,
        run: Callable[[ros_node.Goal], ros_node.Outcome],
    ) -> None:
        """Run a goal in this thread, then let the executor send what became of it."""
        goal_id = bytes(handle.goal_id.uuid)
        goal = ros_node.Goal(
            action,
            goal_id,
            goal_id.hex(),
            ros2_topics.callers_of(self._node, name),
            _values(handle.request),
            lambda percent: handle.publish_feedback(kind.Feedback(percent_complete=percent)),
        )
        outcome = ros_node.outcome_of(run, goal, lambda text: self.log(text, is_warning=True))

        def answer(handle: Any) -> Any:
            (handle.succeed if outcome.succeeded else handle.abort)()
            return kind.Result(**outcome.result)

        handle.execute(answer)

    def call_action(
        self, action: str, name: str, values: ros_node.Values, *,
        goal_id: bytes | None = None, timeout_s: float = 10.0,
    ) -> ros_node.GoalAnswer:  # fmt: skip
        """Send a goal and return what becomes of it."""
        from action_msgs.msg import GoalStatus
        from rclpy.action import ActionClient
        from unique_identifier_msgs.msg import UUID

        kind = ros2_topics.action_class(action)
        name = self._node.resolve_topic_name(name)
        client = ActionClient(self._node, kind, name)  # one that had the same goal refuses it
        try:
            if not client.wait_for_server(timeout_s):
                raise RosError(
                    f"no action server {name} answered within {timeout_s:g} s; is it running, "
                    "and in this ROS_DOMAIN_ID? Check with `ros2 action info`."
                )
            uuid = None if goal_id is None else UUID(uuid=list(goal_id))
            handle = self._wait(client.send_goal_async(kind.Goal(**values), goal_uuid=uuid),
                                name, timeout_s)  # fmt: skip
            if not handle.accepted:
                return ros_node.GoalAnswer("REJECTED", {})
            answer = self._wait(handle.get_result_async(), name, timeout_s)
        finally:
            client.destroy()
        names = {
            GoalStatus.STATUS_SUCCEEDED: "SUCCEEDED",
            GoalStatus.STATUS_ABORTED: "ABORTED",
            GoalStatus.STATUS_CANCELED: "CANCELED",
        }
        return ros_node.GoalAnswer(
            names.get(answer.status, str(answer.status)), _values(answer.result)
        )

    def _wait(self, future: Any, name: str, timeout_s: float) -> Any:
        self._executor.spin_until_future_complete(future, timeout_s)
        if not future.done():
            raise RosError(
                f"{name}: no result within {timeout_s:g} s; what became of it is not known."
            )
        return future.result()

    def run(self, stop: Callable[[], bool], *, tick: Callable[[], None] | None = None) -> None:
        """Let the executor work."""
        next_tick = 0.0
        while self._context.ok() and not stop():
            if tick is not None and time.monotonic() >= next_tick:
                tick()
                next_tick = time.monotonic() + ros_node.TICK_S
            self._executor.spin_once(timeout_sec=ros_node.TICK_S)

    def close(self) -> None:
        """Finish the goals that run, see what was published acknowledged, and leave."""
        self._goals.shutdown(wait=True)
        deadline = time.monotonic() + ACKNOWLEDGED_WITHIN_S
        while self._executor._tasks and time.monotonic() < deadline:  # noqa: SLF001
            self._executor.spin_once(timeout_sec=0)  # answers of the goals that ended just now
        for publisher in self._publishers:
            publisher.wait(max(0.0, deadline - time.monotonic()))
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()


def _refuse_to_run(_handle: Any) -> Any:
    raise AssertionError  # goals are run by `_run`, which hands the executor their answers


def _values(message: Any) -> ros_node.Values:
    return {name: getattr(message, name) for name in message.get_fields_and_field_types()}


def _steady_clock() -> Any:
    """Return a clock that goes on whatever `/clock` says."""
    from rclpy.clock import Clock, ClockType

    return Clock(clock_type=ClockType.STEADY_TIME)
