"""A bag of ROS 2 messages as one MCAP file: closed, in zstd chunks, indexed, with CRCs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.interop.formats.ros.ros_types import RosVersion, encoded, ros_types
from semmap_log.store.form import LIBRARY, PROFILE, TRANSIENT_LOCAL, VOLATILE, offered_qos

CHUNK_BYTES = 4 * 2**20
"""A grid in a chunk with those before it costs little more than what changed; but to show one, a
player that jumps there unpacks its chunk."""


@contextmanager
def mcap_bag(path: Path, topics: Sequence[BagTopic]) -> Iterator[_McapBag]:
    """Write the file; it is closed when the block ends well."""
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file, chunk_size=CHUNK_BYTES, enable_data_crcs=True)
        writer.start(profile=PROFILE, library=LIBRARY)
        yield _McapBag(writer, topics)
        writer.finish()


def qos_of(topic: BagTopic) -> str:
    """Return the QoS with which players offer a topic."""
    return offered_qos(TRANSIENT_LOCAL if topic.is_latched else VOLATILE)


class _McapBag:
    ros_version: RosVersion = 2

    def __init__(self, writer: Any, topics: Sequence[BagTopic]) -> None:
        self._writer = writer
        self._types = ros_types(2)
        self._channels = {topic: self._channel(topic) for topic in topics}
        self._counts: Counter[BagTopic] = Counter()

    def write(self, topic: BagTopic, at_ns: int, message: Any) -> None:
        self.write_encoded(topic, at_ns, encoded(2, message, topic.ros_type))

    def write_encoded(self, topic: BagTopic, at_ns: int, data: bytes) -> None:
        self._writer.add_message(
            self._channels[topic],
            log_time=at_ns,
            data=data,
            publish_time=at_ns,
            sequence=self._counts[topic],
        )
        self._counts[topic] += 1

    def _channel(self, topic: BagTopic) -> int:
        text, _ = self._types.generate_msgdef(topic.ros_type, ros_version=2)
        schema = self._writer.register_schema(topic.ros_type, "ros2msg", text.encode())
        channel: int = self._writer.register_channel(
            topic.name,
            "cdr",
            schema,
            {
                "offered_qos_profiles": qos_of(topic),
                "topic_type_hash": self._types.hash_rihs01(topic.ros_type),
            },
        )
        return channel
