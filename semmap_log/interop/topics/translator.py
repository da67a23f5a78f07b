"""Message after message to events: what the recorder and the import of bags have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from semmap_log.core.model.events import DoorObserved, Event
from semmap_log.errors import CommandError, SemmapError, UnknownLevelError
from semmap_log.interop.formats.ros.ros_decoding import MessageType, decode_message
from semmap_log.interop.formats.ros.ros_types import short_name
from semmap_log.interop.topics.clicked_doors import ClickedDoors
from semmap_log.interop.topics.door_maps import DoorMaps
from semmap_log.interop.topics.floors import FloorMaps
from semmap_log.interop.topics.known import Known
from semmap_log.interop.topics.lasers.laser_topics import LaserScans, RobotFrames, RobotPlaces
from semmap_log.interop.topics.lasers.lasers import Lasers, RobotScan
from semmap_log.interop.topics.robot_poses import PoseFilter, Poses, Transforms
from semmap_log.interop.topics.round_topics import Rounds
from semmap_log.interop.topics.state_topics import RmfRequests, RmfStates, SensorReader
from semmap_log.interop.topics.topic_problems import TopicProblems
from semmap_log.interop.topics.topic_reader import Context, TopicMessage, TopicReader
from semmap_log.interop.topics.topic_rules import (
    ONLY_TYPES,
    ReadClicks,
    ReadDoorMap,
    ReadFloorMap,
    ReadFrames,
    ReadPatrol,
    ReadPlace,
    ReadPose,
    ReadRmfRequest,
    ReadRmfState,
    ReadScan,
    ReadSensor,
    ReadTransforms,
    RosMapping,
    TopicRule,
)


@dataclass(frozen=True, slots=True)
class Made:
    """What became of a message."""

    events: list[Event]
    """In their order; none: it said nothing new, or nothing that can be."""
    actor: str = ""
    """Who did it, where the message tells."""
    reason: str = ""
    said: str = ""
    """What was done, for a person who waits for it; empty: nobody does."""
    scans: Sequence[RobotScan] = ()
    """Those that have their places now: this message's, or such that waited."""


class Translator:
    """Makes events of messages, and knows the doors as they are after each."""

    def __init__(self, mapping: RosMapping, known: Known, complaints: TopicProblems) -> None:
        self.mapping = mapping
        self.complaints = complaints
        self._context = Context(mapping, known, complaints)
        self._track = PoseFilter(mapping.moved_m, mapping.turned_rad)
        self.lasers = Lasers(mapping, complaints)
        self._readers: dict[str, TopicReader] = {}
        self._rules: dict[str, TopicRule] = {}

    def read_topic(self, topic: str, rule: TopicRule) -> None:
        """Read a topic from now on.

        Raises:
            CommandError: There is no such level, or it is not said which.
        """
        try:
            self._readers[topic] = self._reader(topic, rule)
        except UnknownLevelError as error:
            told = f"{topic}: {error} For one topic alone, a mapping file says it: level."
            raise CommandError(told) from None
        self._rules[topic] = rule

    def take(self, topic: str, message_type: MessageType, data: bytes, received_ns: int) -> Made:
        """Return the events of a message; trouble with it is complained about, never raised.

        Args:
            topic: One that is read.
            message_type: How to decode it.
            data: The message.
            received_ns: When it came: by the bag, or by the node's clock.
        """
        rule = self._rules[topic]
        possible = ONLY_TYPES.get(type(rule.reading), ())
        if possible and message_type.name not in possible:
            names = " or ".join(short_name(name) for name in possible)
            kind = f"a {short_name(message_type.name)}, expected {names}; passed over"
            self.complaints.add(topic, kind)
            return Made([])
        try:
            message = decode_message(message_type, data)
        except SemmapError as error:
            self.complaints.add(topic, "a message that cannot be read; passed over", error)
            return Made([])
        made = self._made(TopicMessage(topic, message, received_ns, message_type.name))
        if self.mapping.reads_scans and isinstance(rule.reading, _PLACING):
            return replace(made, scans=list(self.lasers.placed()))
        return made

    def rest(self) -> list[RobotScan]:
        """Return the scans that waited for their places and have them: nothing comes any more."""
        return list(self.lasers.placed(is_end=True))

    def why_no_poses(self) -> tuple[str, ...]:
        """Return of each topic of transforms why it never gave a pose, in words."""
        readers = [each for each in self._readers.values() if isinstance(each, Transforms)]
        return tuple(filter(None, (reader.why_no_pose() for reader in readers)))

    def heed(self, events: Sequence[Event]) -> None:
        """Take in events that others made: messages are compared with what is known."""
        for event in events:
            self._context.known.apply(event)

    def start_anew(self, known: Known) -> None:
        """Take the log as it stands for what is known: some events were not stored."""
        self._context.known = known
        for reader in self._readers.values():
            if isinstance(reader, DoorMaps):
                reader.forget()

    def _made(self, got: TopicMessage) -> Made:
        reader, known = self._readers[got.topic], self._context.known
        events: list[Event] = []
        try:
            for event in reader.events(got):
                if isinstance(event, DoorObserved):
                    events += self._track.at_sighting()
                known.apply(event)
                events.append(event)
            actor = reader.actor(got) if events else ""
        except Exception as error:  # noqa: BLE001  of a message that is anything
            said = str(error) if isinstance(error, _TELLING) else f"{type(error).__name__}: {error}"
            self.complaints.add(got.topic, "a message that cannot be; passed over", said)
            return Made(events)
        rule = self._rules[got.topic].reading
        said = reader.said if isinstance(reader, ClickedDoors) else ""
        return Made(events, actor, rule.name if isinstance(rule, ReadPatrol) else "", said)

    def _reader(self, topic: str, rule: TopicRule) -> TopicReader:
        context, track, lasers = self._context, self._track, self.lasers
        makers: dict[type, Callable[[Any], TopicReader]] = {
            ReadDoorMap: lambda reading: DoorMaps(topic, reading, context),
            ReadRmfState: lambda reading: RmfStates(topic, reading, context),
            ReadRmfRequest: lambda reading: RmfRequests(topic, reading, context),
            ReadSensor: lambda reading: SensorReader(topic, reading, context),
            ReadPose: lambda reading: Poses(topic, reading, context, track, lasers),
            ReadTransforms: lambda reading: Transforms(
                reading, context, track, lasers.tree(reading.robot)
            ),
            ReadScan: lambda reading: LaserScans(topic, reading, context, lasers),
            ReadFrames: lambda reading: RobotFrames(reading, context, lasers),
            ReadPlace: lambda reading: RobotPlaces(reading, context, lasers),
            ReadFloorMap: lambda reading: FloorMaps(topic, reading, context),
            ReadClicks: lambda reading: ClickedDoors(topic, reading, context),
            ReadPatrol: lambda reading: Rounds(reading, context),
        }
        return makers[type(rule.reading)](rule.reading)


_PLACING = (ReadScan, ReadFrames, ReadPlace, ReadTransforms, ReadPose)
"""What can give a scan its place."""

_TELLING = (SemmapError, ValueError, OverflowError)
"""Errors whose text says enough without their type."""
