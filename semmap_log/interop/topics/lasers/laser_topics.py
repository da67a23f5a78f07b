"""Topics that only lasers need, read as others are: scans, frames, places. They make no events."""

from __future__ import annotations

from collections.abc import Iterable

from semmap_log.core.model.events import Event
from semmap_log.interop.topics.door_maps import is_on_map, take_transforms
from semmap_log.interop.topics.lasers.lasers import Lasers
from semmap_log.interop.topics.topic_reader import Context, TopicMessage
from semmap_log.interop.topics.topic_rules import ReadFrames, ReadPlace, ReadScan


class _Eventless:
    """Reads for others."""

    def actor(self, _got: TopicMessage) -> str:
        """Return nobody."""
        return ""


class LaserScans(_Eventless):
    """Reads a laser's scans."""

    def __init__(self, topic: str, rule: ReadScan, context: Context, lasers: Lasers) -> None:
        self._lasers = lasers
        lasers.add(topic, rule, context.level(rule.level))

    def events(self, got: TopicMessage) -> Iterable[Event]:
        """Have a scan wait for its place."""
        self._lasers.take_scan(got)
        return ()


class RobotFrames(_Eventless):
    """Reads TF."""

    def __init__(self, rule: ReadFrames, context: Context, lasers: Lasers) -> None:
        self._tree = lasers.tree(rule.robot)
        self._context = context

    def events(self, got: TopicMessage) -> Iterable[Event]:
        """Take in transforms."""
        take_transforms(got, self._tree, self._context)
        return ()


class RobotPlaces(_Eventless):
    """Reads poses."""

    def __init__(self, rule: ReadPlace, context: Context, lasers: Lasers) -> None:
        self._robot = rule.robot
        self._context = context
        self._lasers = lasers

    def events(self, got: TopicMessage) -> Iterable[Event]:
        """Take in a pose."""
        if is_on_map(got, self._context):
            self._lasers.take_pose(got, self._robot)
        return ()
