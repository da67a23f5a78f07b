"""A log's stream as a bag: for `rosbag play` and `ros2 bag play`, RViz, Foxglove and Lichtblick."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from semmap_log.core.io.disk import refuse_own_folder
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.keywords import knows_keywords
from semmap_log.interop.exporting.stream import StreamOptions, log_stream
from semmap_log.interop.formats.bags.bag_reading import bytes_of, new_bag, ros_version_of
from semmap_log.interop.formats.ros.door_markers import is_drawn
from semmap_log.log.door_log.door_labels import labels_of
from semmap_log.log.door_log.door_log import DoorLog, Time


@dataclass(frozen=True, slots=True)
class RecordedBag:
    """What was written."""

    messages: dict[str, int]
    """Topic -> how many."""
    every_s: float
    """See `StreamOptions`."""
    left_out: tuple[str, ...]
    """Doors that have no place at the end, and so are not shown."""
    bytes: int


@knows_keywords
def record_bag(
    log: DoorLog,
    out: Path,
    options: StreamOptions = StreamOptions(),
    *,
    since: Time = None,
    until: Time = None,
    progress: Progress | None = None,
) -> RecordedBag:
    """Write the bag, whole or not at all; the same log and options give the same bytes.

    Args:
        log: The log.
        out: `.mcap`, `.bag` (ROS 1) or, without an extension, a rosbag2 folder. A file that was
            there is replaced, a folder never.
        options: What is told, and how.
        since: The first messages show this moment; default: the first event's, or the horizon.
        until: The last moment; default: the log's end.
        progress: Told how many of the events are done.

    Raises:
        FormatError: The name tells no bag.
        MomentError: `since` comes after `until`.
        OutputError: It cannot be written, or a time cannot be a ROS stamp; what was there is whole.
    """
    refuse_own_folder(log.path, out)
    stream = log_stream(log, options, ros_version=ros_version_of(out), since=since, until=until)
    counts = Counter({topic.name: 0 for topic in stream.topics})
    with new_bag(out, stream.topics) as bag:
        for message in stream.messages(progress):
            bag.write_encoded(message.topic, message.at_ns, message.data)
            counts[message.topic.name] += 1
    left_out = _left_out(log, log.instant(until))
    return RecordedBag(dict(counts), stream.plan.every_s, left_out, bytes_of(out))


def _left_out(log: DoorLog, until_ns: int | None) -> tuple[str, ...]:
    door_map = log.replay(at=until_ns)
    labels = labels_of(door_map)
    doors = door_map.doors.values()
    return tuple(labels.get(door.door_id, door.label) for door in doors if not is_drawn(door))
