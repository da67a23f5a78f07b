"""What a bag is, whoever wrote it: its topics and messages, read and written."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

from semmap_log.interop.formats.ros.ros_decoding import MessageType
from semmap_log.interop.formats.ros.ros_types import RosVersion


@dataclass(frozen=True, slots=True)
class BagTopic:
    """A topic of a bag that is written."""

    name: str
    ros_type: str
    """In ROS 2's long form, such as `nav_msgs/msg/OccupancyGrid`; for ROS 1, too."""
    is_latched: bool
    """Who subscribes late gets the last message: ROS 1's latching, ROS 2's `transient_local`."""


class NewBag(Protocol):
    """A bag while it is written."""

    ros_version: RosVersion
    """Whose message classes it takes: see `ros_types`."""

    def write(self, topic: BagTopic, at_ns: int, message: Any) -> None:
        """Append a message; times do not run backwards."""

    def write_encoded(self, topic: BagTopic, at_ns: int, data: bytes) -> None:
        """Append a message that is bytes already: CDR, or as ROS 1 serializes."""


@dataclass(frozen=True, slots=True)
class BagChannel:
    """A topic of a bag, as one publisher's connection had it."""

    topic: str
    message_type: MessageType


@dataclass(frozen=True, slots=True)
class BagMessage:
    """A message as the bag holds it."""

    channel: BagChannel
    at_ns: int
    """When it was recorded."""
    data: bytes


class BagReader(Protocol):
    """A bag that is open."""

    @property
    def channels(self) -> Collection[BagChannel]:
        """All that it has."""

    def count(self, channels: Collection[BagChannel]) -> int:
        """Return how many messages the bag says that there are."""

    def messages(self, channels: Collection[BagChannel]) -> Iterator[BagMessage]:
        """Yield the messages of these channels, times ascending.

        Raises:
            FormatError: The bag is damaged, or unfinished; or its times go back and forth too far.
        """
