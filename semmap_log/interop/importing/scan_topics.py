"""Which lasers of a bag are looked through, where the command line asks for them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from semmap_log.errors import FormatError
from semmap_log.interop.formats.bags.bag_reading import open_bag
from semmap_log.interop.formats.ros.ros_types import (
    LASER_SCAN,
    POINT_CLOUD,
    short_name,
    whole_topic,
)
from semmap_log.interop.topics.topic_rules import ONLY_TYPES, ReadPlace, ReadScan, RosMapping

MOST_TOPICS = 20


@dataclass(frozen=True, slots=True)
class ScanOptions:
    """Which lasers of a bag are read, beside those of a mapping."""

    topics: tuple[str, ...] = ()
    """Empty: the bag's only one; of several, those called `scan`."""
    pose_topic: str = ""
    """Poses of the robot on the map; empty: TF leads from the map to it."""
    heights: tuple[float, float] | None = None
    """Of the points of clouds that count, over the robot's frame, m; None: as usual."""

    def words(self) -> list[str]:
        """Return the options of a command line that ask for the same."""
        words = [word for topic in self.topics or ("",) for word in ("--scan", topic) if word]
        if self.pose_topic:
            words += ["--pose-topic", self.pose_topic]
        if self.heights is not None:
            words += ["--heights", ",".join(f"{each:g}" for each in self.heights)]
        return words


def with_scans(path: Path, mapping: RosMapping, options: ScanOptions | None) -> RosMapping:
    """Return a mapping that reads the lasers that were asked for, as far as the bag has them.

    Raises:
        FormatError: It has no such topic, or several could be meant.
    """
    if options is None:
        return mapping
    topics = _topics(path, mapping, options)
    return mapping.with_scans(topics, options.pose_topic, options.heights)


def _topics(path: Path, mapping: RosMapping, options: ScanOptions) -> Collection[str]:
    with open_bag(path) as bag:
        there = {channel.topic: channel.message_type.name for channel in bag.channels}
    lasers = sorted(topic for topic, name in there.items() if name == LASER_SCAN)
    named = [(whole_topic(topic), ONLY_TYPES[ReadScan]) for topic in options.topics]
    if options.pose_topic:
        named.append((whole_topic(options.pose_topic), ONLY_TYPES[ReadPlace]))
    for topic, possible in named:
        if there.get(topic) not in possible:
            kinds = " or ".join(map(short_name, possible))
            raise FormatError(
                path, f"expected a topic {topic} of {kinds}; there is: {_listed(there)}"
            )
    if options.topics:
        return options.topics
    if any(isinstance(rule.reading, ReadScan) for rule in mapping.topics.values()):
        return ()
    called_so = [topic for topic in lasers if topic.endswith("/scan")]
    chosen = lasers if len(lasers) == 1 else called_so
    if not chosen:
        clouds = sorted(topic for topic, name in there.items() if name == POINT_CLOUD)
        which = (*lasers, *clouds)
        what = (
            f"it has several: {', '.join(which)}; name those of different lasers: --scan {which[0]}"
            if which
            else f"it has none; there is: {_listed(there)}"
        )
        raise FormatError(path, f"expected one topic of {short_name(LASER_SCAN)}; {what}")
    return chosen


def _listed(topics: dict[str, str]) -> str:
    named = [f"{topic} ({short_name(name)})" for topic, name in sorted(topics.items())]
    return ", ".join(named[:MOST_TOPICS]) or "nothing"
