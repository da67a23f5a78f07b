"""ROS 2's topics as bytes: publishers, readers that ask for what is offered, compiled classes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

from semmap_log.errors import RosError
from semmap_log.interop.formats.bags.bag_protocol import BagTopic

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
    """Other types that are published on the topic, and were told."""

    def look(self) -> None:
        """Subscribe, once there is somebody; and anew, for less, if somebody offers less."""
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
