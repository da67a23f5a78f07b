"""A bag of ROS 1: `rosbag play` and rviz of noetic open it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.interop.formats.ros.ros_types import RosVersion, encoded, ros_types

CALLER = "/semmap_log"
"""Who published it: without a caller, rosbag does not replay a topic as latched."""


@contextmanager
def ros1_bag(path: Path, topics: Sequence[BagTopic]) -> Iterator[_Ros1Bag]:
    """Write the file, its chunks packed as lz4; it is closed when the block ends well."""
    import lz4.frame
    from rosbags.rosbag1 import Writer

    path.unlink()  # which `whole_file` made: rosbags makes its own, and follows no link
    writer = Writer(path)
    writer.set_compression(Writer.CompressionFormat.LZ4)
    # ROS's own roslz4 reads no frames but these ("malformed data to decompress").
    writer.compressor = partial(
        lz4.frame.compress, block_linked=False, content_checksum=True, store_size=False
    )
    with writer:
        yield _Ros1Bag(writer, topics)


class _Ros1Bag:
    ros_version: RosVersion = 1

    def __init__(self, writer: Any, topics: Sequence[BagTopic]) -> None:
        self._writer = writer
        self._connections = {
            topic: writer.add_connection(
                topic.name,
                topic.ros_type,
                typestore=ros_types(1),
                callerid=CALLER,
                latching=int(topic.is_latched),
            )
            for topic in topics
        }

    def write(self, topic: BagTopic, at_ns: int, message: Any) -> None:
        self.write_encoded(topic, at_ns, encoded(1, message, topic.ros_type))

    def write_encoded(self, topic: BagTopic, at_ns: int, data: bytes) -> None:
        self._writer.write(self._connections[topic], at_ns, data)
