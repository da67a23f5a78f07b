"""A node without a network: what is published on it is kept, decoded, and heard on it."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from semmap_log.errors import RosError
from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.interop.formats.ros.ros_types import (
    Messages,
    RosVersion,
    decoded,
    encoded,
    log_type,
)
from semmap_log.live.ros.ros_node import Goal, GoalAnswer, Outcome, Received, Values


@dataclass
class CollectingNode:
    """A `RosNode` that is server and client, publisher and subscriber in one."""

    ros_version: RosVersion = 2
    topics: dict[str, BagTopic] = field(default_factory=dict)
    messages: dict[str, list[Any]] = field(default_factory=lambda: defaultdict(list))
    order: list[str] = field(default_factory=list)
    """Topics by their messages, and actions as they were offered."""
    sent_s: list[float] = field(default_factory=list)
    """When each message was published, by a steady clock."""
    waited: list[str] = field(default_factory=list)
    """Topics of which somebody waited until they were taken."""
    patience_s: set[float] = field(default_factory=set)
    """For how long at most."""
    listeners: int = 1
    name: str = "/collecting"
    actions: dict[str, Callable[[Goal], Outcome]] = field(default_factory=dict)
    goals: list[Goal] = field(default_factory=list)
    is_closed: bool = False
    _last: dict[str, Received] = field(default_factory=dict)
    _takers: dict[str, Callable[[Received], None]] = field(default_factory=dict)

    def parameter(self, _name: str, default: Any) -> Any:
        return default

    def now_ns(self) -> int:
        return time.time_ns()

    def publisher(self, topic: BagTopic) -> _Publisher:
        assert topic.name not in self.topics
        self.topics[topic.name] = topic
        return _Publisher(self, topic)

    def topics_of_server(self, name: str) -> set[str]:
        return {f"{name}/result", *self.topics} if name in self.actions else set()

    def subscribe(self, topic: str, _ros_type: str, take: Callable[[Received], None]) -> None:
        self._takers[topic] = take
        if topic in self._last:
            take(self._last[topic])

    def serve_action(self, _action: str, name: str, run: Callable[[Goal], Outcome]) -> None:
        self.order.append(name)
        self.actions[name] = run

    def call_action(
        self, action: str, name: str, values: Values, *, goal_id: bytes, timeout_s: float
    ) -> GoalAnswer:
        if name not in self.actions:
            raise RosError(f"no action server {name} answered within {timeout_s:g} s")
        self.goals.append(Goal(action, goal_id, goal_id.hex(), self.name, values, lambda _: None))
        outcome = self.actions[name](self.goals[-1])
        text = outcome.text
        if self.ros_version == 2:
            self._say(f"{action} {bytes(16).hex()}: what another goal was told")
            if text:
                self._say(f"{action} {goal_id.hex()}: {text}")
            text = ""
        return GoalAnswer("SUCCEEDED" if outcome.succeeded else "ABORTED", outcome.result, text)

    def run(self, stop: Callable[[], bool], *, tick: Callable[[], None] | None = None) -> None:
        while not stop():
            if tick is not None:
                tick()
            time.sleep(0.001)

    def close(self) -> None:
        self.is_closed = True

    def take(self, topic: BagTopic, data: bytes) -> None:
        self.sent_s.append(time.monotonic())
        self.messages[topic.name].append(decoded(self.ros_version, data, topic.ros_type))
        self.order.append(topic.name)
        received = Received(topic.name, topic.ros_type, data, self.now_ns())
        if topic.is_latched:
            self._last[topic.name] = received
        if topic.name in self._takers:
            self._takers[topic.name](received)

    def _say(self, text: str) -> None:
        kind = log_type(2)
        made = Messages(2)
        line = made.new(
            kind, stamp=made.stamp(0), level=30, name="", msg=text, file="", function="", line=0
        )
        self.take(BagTopic("/rosout", kind, is_latched=False), encoded(2, line, kind))


@dataclass
class _Publisher:
    node: CollectingNode
    topic: BagTopic

    def publish(self, data: bytes) -> None:
        self.node.take(self.topic, data)

    def subscribers(self) -> int:
        return self.node.listeners

    def wait(self, timeout_s: float) -> None:
        self.node.waited.append(self.topic.name)
        self.node.patience_s.add(timeout_s)
