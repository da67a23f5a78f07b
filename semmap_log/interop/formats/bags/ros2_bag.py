"""A bag of ROS 2 as a folder: an MCAP file, and metadata.yaml (version 9, that of Jazzy)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from semmap_log.core.messages import BAG_METADATA_NAME
from semmap_log.interop.formats.bags.bag_protocol import BagTopic, NewBag, mcap_bag, qos_of
from semmap_log.interop.formats.ros.ros_types import RosVersion, ros_types


@contextmanager
def ros2_bag(path: Path, topics: Sequence[BagTopic]) -> Iterator[_Ros2Bag]:
    """Write the folder; it is complete when the block ends well."""
    path.mkdir()
    file = path / f"{path.name}_0.mcap"
    with mcap_bag(file, topics) as messages:
        bag = _Ros2Bag(messages)
        yield bag
    metadata = {"rosbag2_bagfile_information": bag.metadata(file.name, topics)}
    text = yaml.safe_dump(metadata, sort_keys=False, allow_unicode=True)
    (path / BAG_METADATA_NAME).write_text(text, encoding="utf-8")


class _Ros2Bag:
    """Counts what goes into the file, for metadata.yaml."""

    ros_version: RosVersion = 2

    def __init__(self, messages: NewBag) -> None:
        self._messages = messages
        self._counts: Counter[BagTopic] = Counter()
        self._first_ns = self._last_ns = 0

    def write(self, topic: BagTopic, at_ns: int, message: Any) -> None:
        self._count(topic, at_ns)
        self._messages.write(topic, at_ns, message)

    def write_encoded(self, topic: BagTopic, at_ns: int, data: bytes) -> None:
        self._count(topic, at_ns)
        self._messages.write_encoded(topic, at_ns, data)

    def _count(self, topic: BagTopic, at_ns: int) -> None:
        if not self._counts:
            self._first_ns = at_ns
        self._last_ns = at_ns
        self._counts[topic] += 1

    def metadata(self, file: str, topics: Sequence[BagTopic]) -> dict[str, Any]:
        """Return what metadata.yaml says of the bag: rosbag2_storage/bag_metadata.hpp."""
        extent = {
            "starting_time": {"nanoseconds_since_epoch": self._first_ns},
            "duration": {"nanoseconds": self._last_ns - self._first_ns},
            "message_count": self._counts.total(),
        }
        return {
            "version": 9,
            "storage_identifier": "mcap",
            **_copied(extent),
            "topics_with_message_count": [self._topic(topic) for topic in topics],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [file],
            "files": [{"path": file, **extent}],
            "custom_data": None,
            "ros_distro": "rosbags",
        }

    def _topic(self, topic: BagTopic) -> dict[str, Any]:
        return {
            "topic_metadata": {
                "name": topic.name,
                "type": topic.ros_type,
                "serialization_format": "cdr",
                # As in the file: rosbags passes over a file in silence where the two differ.
                "offered_qos_profiles": yaml.safe_load(qos_of(topic)),
                "type_description_hash": ros_types(2).hash_rihs01(topic.ros_type),
            },
            "message_count": self._counts[topic],
        }


def _copied(extent: dict[str, Any]) -> dict[str, Any]:
    """Return it as another object, or YAML would write a reference to the first."""
    return {key: dict(value) if isinstance(value, dict) else value for key, value in extent.items()}
