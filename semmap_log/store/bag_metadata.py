"""metadata.yaml, by which rosbag2's tools open the folder: a cache of the closed segments."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import PurePath

from mcap.records import Statistics

from semmap_log.core.lazily import late_pattern
from semmap_log.core.messages import BAG_METADATA_NAME, offered_qos, type_hash
from semmap_log.store import byte_layout
from semmap_log.store.folder import LogFolder
from semmap_log.store.header import SegmentHeader
from semmap_log.store.newer import NOTHING_NEWER, Newer, is_later_kind


@dataclass(frozen=True, slots=True)
class ClosedSegment:
    """What metadata.yaml says of a segment."""

    name: str
    start_ns: int
    end_ns: int
    counts: dict[int, int]
    """Channel id -> messages."""
    minor: int = 0
    """Of its format's version."""
    newer: Newer = NOTHING_NEWER
    """Its topics that a later version has added."""

    @classmethod
    def of(cls, path: PurePath, said: Statistics, header: SegmentHeader) -> ClosedSegment:
        """Return what a segment's Statistics and its full header say."""
        counts = said.channel_message_counts
        return cls(
            path.name,
            said.message_start_time,
            said.message_end_time,
            counts,
            header.minor,
            header.newer if may_hold_newer(header, counts) else NOTHING_NEWER,
        )


def may_hold_newer(header: SegmentHeader, counts: Mapping[int, int]) -> bool:
    """Return whether a segment's head is searched for topics that a later version has added."""
    return header.minor > byte_layout.FORMAT_MINOR or any(map(is_later_kind, counts))


def write_bag_metadata(folder: LogFolder, segments: Iterable[ClosedSegment]) -> None:
    """Write metadata.yaml for these segments, or remove it where there are none.

    A file that says so already is left alone.

    Raises:
        OSError: As the system says.
    """
    listed = sorted(segments, key=lambda one: (one.start_ns, one.end_ns))  # in order of time
    if listed:
        text = bag_metadata_text(listed).encode()
        if not _says(folder, text):
            folder.write_atomic(BAG_METADATA_NAME, [text])
    elif folder.has(BAG_METADATA_NAME):
        folder.remove(BAG_METADATA_NAME)
        folder.sync()


def _says(folder: LogFolder, text: bytes) -> bool:
    try:
        return folder.read_bytes(BAG_METADATA_NAME, len(text) + 1) == text
    except OSError:
        return False


def listed_names(text: str) -> list[str]:
    """Return the closed segments that a metadata.yaml lists, as far as it can be read."""
    names = []
    for quoted in _LISTED.findall(text):
        with suppress(ValueError):
            names.append(str(json.loads(quoted)))
    return names


_LISTED = late_pattern(r'^    - path: (".*")$', re.MULTILINE)


def bag_metadata_text(segments: list[ClosedSegment]) -> str:
    """Return the text of metadata.yaml for these segments, at least one."""
    counts: Counter[int] = Counter()
    for segment in segments:
        counts.update(segment.counts)
    start = min(segment.start_ns for segment in segments)
    duration = max(segment.end_ns for segment in segments) - start
    lines = [
        "rosbag2_bagfile_information:",
        "  version: 9",
        "  storage_identifier: mcap",
        "  duration:",
        f"    nanoseconds: {duration}",
        "  starting_time:",
        f"    nanoseconds_since_epoch: {start}",
        f"  message_count: {counts.total()}",
        "  topics_with_message_count:",
        *_topics(segments, counts),
        '  compression_format: ""',
        '  compression_mode: ""',
        "  relative_file_paths:",
        *(f"    - {_quoted(segment.name)}" for segment in segments),
        "  files:",
        *(line for segment in segments for line in _file(segment)),
        "  custom_data: ~",
        "  ros_distro: rosbags",
    ]
    return "\n".join(lines) + "\n"


def _topics(segments: list[ClosedSegment], counts: Counter[int]) -> Iterator[str]:
    """Yield all fixed topics, with or without messages, and the floor maps that there are."""
    minor = max(segment.minor for segment in segments)
    levels = (
        c - byte_layout.FLOOR_MAP_CHANNEL for c in counts if c > byte_layout.FLOOR_MAP_CHANNEL
    )
    there = (
        byte_layout.trimmed_topics()
        if byte_layout.TOMBSTONE_CHANNEL in counts
        else byte_layout.topics()
    )
    fixed = [topic for topic in there if topic.since_minor <= minor]
    known = [*fixed, *map(byte_layout.floor_map_topic, levels)]
    told = {
        topic.channel_id: (
            topic.topic,
            topic.ros_type,
            offered_qos(topic.durability),
            type_hash(topic.ros_type),
        )
        for topic in known
    }
    told |= Newer.all_of(segment.newer for segment in segments).topics
    for channel, texts in sorted(told.items()):
        yield from _topic(*texts, counts[channel])


def _topic(name: str, ros_type: str, qos: str, hashed: str, count: int) -> list[str]:
    return [
        "    - topic_metadata:",
        f"        name: {name}",
        f"        type: {ros_type}",
        "        serialization_format: cdr",
        "        offered_qos_profiles:",
        f"          {qos}",
        f"        type_description_hash: {hashed}",
        f"      message_count: {count}",
    ]


def _file(segment: ClosedSegment) -> list[str]:
    return [
        f"    - path: {_quoted(segment.name)}",
        "      starting_time:",
        f"        nanoseconds_since_epoch: {segment.start_ns}",
        "      duration:",
        f"        nanoseconds: {segment.end_ns - segment.start_ns}",
        f"      message_count: {sum(segment.counts.values())}",
    ]


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # JSON's strings are YAML's
