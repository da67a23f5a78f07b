"""A node in memory whose topics are those of one process."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field

from semmap_log.errors import RosError
from semmap_log.interop.formats.ros.ros_types import RosVersion
from semmap_log.live.ros.ros_node import Received
from tests.interop.formats.bags.bags_of_others import Said


@dataclass
class MemoryNode:
    """As much of a `RosNode` as a recorder needs; `during` is what happens while it runs."""

    during: Callable[[MemoryNode], None]
    published: dict[str, str] = field(default_factory=dict)
    ros_version: RosVersion = 2
    takers: dict[str, Callable[[Received], None]] = field(default_factory=dict)
    tick: Callable[[], None] | None = None
    stop: Callable[[], bool] = lambda: False
    is_closed: bool = False
    name: str = "/memory"

    def topics(self) -> dict[str, str]:
        return self.published

    def subscribe(self, topic: str, ros_type: str, take: Callable[[Received], None]) -> None:
        if ros_type.startswith("odd_msgs"):
            raise RosError("odd_msgs is not there; install it")
        self.takers[topic] = take

    def run(self, stop: Callable[[], bool], *, tick: Callable[[], None] | None = None) -> None:
        self.tick = tick
        self.stop = stop
        thread = threading.Thread(target=self.during, args=[self])  # callbacks have their own
        thread.start()
        thread.join()

    def close(self) -> None:
        self.is_closed = True

    def say(self, said: Said) -> None:
        self.takers[said.topic](Received(said.topic, said.ros_type, said.data, said.at_ns))
