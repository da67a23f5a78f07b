"""A bag of ROS 2 as a folder: metadata.yaml (version 9, Jazzy's) and an MCAP file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from semmap_log.formats.bags import BagTopic
from semmap_log.formats.ros_types import RosVersion, ros_types


@contextmanager
def ros2_bag(path: Path, topics: Sequence[BagTopic]) -> Iterator[_Ros2Bag]:
    """Write the folder, its chunks packed as zstd; it is closed when the block ends well."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        yield _Ros2Bag(writer, topics)


class _Ros2Bag:
    ros_version: RosVersion = 2

    def __init__(self, writer: Any, topics: Sequence[BagTopic]) -> None:
        self._writer = writer
        self._types = ros_types(2)
        self._connections = {
            topic: writer.add_connection(
                topic.name,
                topic.ros_type,
                typestore=self._types,
                offered_qos_profiles=[_qos(topic.is_latched)],
            )
            for topic in topics
        }

    def write(self, topic: BagTopic, at_ns: int, message: Any) -> None:
        data = self._types.serialize_cdr(message, topic.ros_type)
        self._writer.write(self._connections[topic], at_ns, data)


def _qos(is_latched: bool) -> Any:  # noqa: FBT001 - one of two
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    for_ever = QosTime(9223372036, 854775807)
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=10,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL if is_latched else QosDurability.VOLATILE,
        deadline=for_ever,
        lifespan=for_ever,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=for_ever,
        avoid_ros_namespace_conventions=False,
    )
