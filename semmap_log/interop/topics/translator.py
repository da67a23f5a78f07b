"""Message after message to events: what the recorder and the import of bags have in common.

Here are the readers of floor plans (nav_msgs/OccupancyGrid: each content once), of the robot's
rounds (the status of the action that drives them, or any marker), and of messages about doors
(Open-RMF's states and requests, and any sensor's).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from semmap_log.core.folds.rebasing import are_same
from semmap_log.core.model import events as ev
from semmap_log.core.model.doors import MAX_LEVEL, DoorId, DoorState
from semmap_log.core.model.rigid_transform import yaw_of
from semmap_log.errors import CommandError, SemmapError, UnknownLevelError
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.interop.formats.ros.ros_types import MessageType, decode_message, short_name
from semmap_log.interop.topics import door_maps, topic_reader, topic_rules
from semmap_log.interop.topics.lasers.laser_topics import LaserScans, RobotFrames, RobotPlaces
from semmap_log.interop.topics.lasers.lasers import Lasers, RobotScan


@dataclass(frozen=True, slots=True)
class Made:
    """What became of a message."""

    events: list[ev.Event]
    """In order; empty: the message has nothing new, or nothing possible."""
    actor: str = ""
    """Who did it, if the message says so."""
    reason: str = ""
    said: str = ""
    """What was done, for a person who waits for it; empty: nobody does."""
    scans: Sequence[RobotScan] = ()
    """Those that have their places now: this message's, or such that waited."""


class Translator:
    """Makes events of messages, and knows the doors as they are after each."""

    def __init__(
        self,
        mapping: topic_rules.RosMapping,
        known: topic_reader.Known,
        complaints: topic_reader.TopicProblems,
    ) -> None:
        self.mapping = mapping
        self.complaints = complaints
        self._context = topic_reader.Context(mapping, known, complaints)
        self._track = door_maps.PoseFilter(mapping.moved_m, mapping.turned_rad)
        self.lasers = Lasers(mapping, complaints)
        self._readers: dict[str, topic_reader.TopicReader] = {}
        self._rules: dict[str, topic_rules.TopicRule] = {}

    def read_topic(self, topic: str, rule: topic_rules.TopicRule) -> None:
        """Read a topic from now on.

        Raises:
            CommandError: There is no such level, or no level is given.
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
        possible = topic_rules.ONLY_TYPES.get(type(rule.reading), ())
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
        made = self._made(topic_reader.TopicMessage(topic, message, received_ns, message_type.name))
        if self.mapping.reads_scans and isinstance(rule.reading, _PLACING):
            return replace(made, scans=list(self.lasers.placed()))
        return made

    def rest(self) -> list[RobotScan]:
        """Return the scans that waited for their places and have them: nothing comes any more."""
        return list(self.lasers.placed(is_end=True))

    def why_no_poses(self) -> tuple[str, ...]:
        """Return of each topic of transforms why it never gave a pose, in words."""
        readers = [
            each for each in self._readers.values() if isinstance(each, door_maps.Transforms)
        ]
        return tuple(filter(None, (reader.why_no_pose() for reader in readers)))

    def heed(self, events: Sequence[ev.Event]) -> None:
        """Take in events that others made: messages are compared with what is known."""
        for event in events:
            self._context.known.apply(event)

    def reset_known(self, known: topic_reader.Known) -> None:
        """Take the log as it stands for what is known: some events were not stored."""
        self._context.known = known
        for reader in self._readers.values():
            if isinstance(reader, door_maps.DoorMaps):
                reader.forget()

    def _made(self, got: topic_reader.TopicMessage) -> Made:
        reader, known = self._readers[got.topic], self._context.known
        events: list[ev.Event] = []
        try:
            for event in reader.events(got):
                if isinstance(event, ev.DoorObserved):
                    events += self._track.at_sighting()
                known.apply(event)
                events.append(event)
            actor = reader.actor(got) if events else ""
        except Exception as error:  # noqa: BLE001  of a message that is anything
            said = (
                str(error)
                if isinstance(error, _CLEAR_ERRORS)
                else f"{type(error).__name__}: {error}"
            )
            self.complaints.add(got.topic, "a message that cannot be; passed over", said)
            return Made(events)
        rule = self._rules[got.topic].reading
        said = reader.said if isinstance(reader, door_maps.ClickedDoors) else ""
        return Made(
            events, actor, rule.name if isinstance(rule, topic_rules.ReadPatrol) else "", said
        )

    def _reader(self, topic: str, rule: topic_rules.TopicRule) -> topic_reader.TopicReader:
        context, track, lasers = self._context, self._track, self.lasers
        makers: dict[type, Callable[[Any], topic_reader.TopicReader]] = {
            topic_rules.ReadDoorMap: lambda reading: door_maps.DoorMaps(topic, reading, context),
            topic_rules.ReadRmfState: lambda reading: RmfStates(topic, reading, context),
            topic_rules.ReadRmfRequest: lambda reading: RmfRequests(topic, reading, context),
            topic_rules.ReadSensor: lambda reading: SensorReader(topic, reading, context),
            topic_rules.ReadPose: lambda reading: door_maps.Poses(
                topic, reading, context, track, lasers
            ),
            topic_rules.ReadTransforms: lambda reading: door_maps.Transforms(
                reading, context, track, lasers.tree(reading.robot)
            ),
            topic_rules.ReadScan: lambda reading: LaserScans(topic, reading, context, lasers),
            topic_rules.ReadFrames: lambda reading: RobotFrames(reading, context, lasers),
            topic_rules.ReadPlace: lambda reading: RobotPlaces(reading, context, lasers),
            topic_rules.ReadFloorMap: lambda reading: FloorMaps(topic, reading, context),
            topic_rules.ReadClicks: lambda reading: door_maps.ClickedDoors(topic, reading, context),
            topic_rules.ReadPatrol: lambda reading: Rounds(reading, context),
        }
        return makers[type(rule.reading)](rule.reading)


_PLACING = (
    topic_rules.ReadScan,
    topic_rules.ReadFrames,
    topic_rules.ReadPlace,
    topic_rules.ReadTransforms,
    topic_rules.ReadPose,
)
"""What can give a scan its place."""

_CLEAR_ERRORS = (SemmapError, ValueError, OverflowError)
"""Errors whose text says enough without their type."""


_NEW_LEVEL = re.compile(f"[0-9]{{1,{len(str(MAX_LEVEL))}}}")

MOST_CELLS = 100_000_000


class FloorMaps:
    """Reads a map's topic."""

    def __init__(
        self, topic: str, rule: topic_rules.ReadFloorMap, context: topic_reader.Context
    ) -> None:
        self._topic = topic
        self._context = context
        self._level = _level(rule.level, context)

    def events(self, got: topic_reader.TopicMessage) -> Iterator[ev.Event]:
        """Return the floor plan, unless it is the one that is known."""
        frame = got.message.header.frame_id.removeprefix("/")
        if frame != self._context.mapping.map_frame:
            self._context.complaints.add(
                self._topic,
                f"a map in another frame than {self._context.mapping.map_frame}; passed over",
                shown(frame),
            )
            return
        drawn = replace(self._drawn(got), happened_ns=None)
        known = self._context.known.floor_maps.get(self._level)
        if known is None or not are_same([drawn], [known]):
            yield replace(drawn, happened_ns=self._context.happened_ns(got))

    def actor(self, _got: topic_reader.TopicMessage) -> str:
        """Return nobody."""
        return ""

    def _drawn(self, got: topic_reader.TopicMessage) -> ev.FloorMap:
        info = got.message.info
        cells = np.asarray(got.message.data, np.int8)
        if cells.size != info.width * info.height or not 0 < cells.size <= MOST_CELLS:
            raise ValueError(f"{cells.size:,} cells for a map of {info.width} x {info.height}")
        return ev.FloorMap(
            level=self._level,
            resolution=float(info.resolution),
            origin_x=info.origin.position.x,
            origin_y=info.origin.position.y,
            origin_theta=yaw_of(info.origin.orientation),
            cells=cells.reshape(info.height, info.width),
        )


def _level(text: str | None, context: topic_reader.Context) -> int:
    """Return the level that is drawn; a number may be that of a new one.

    Raises:
        UnknownLevelError: There is none of that name, or there are several.
    """
    if text is not None and _NEW_LEVEL.fullmatch(text) and int(text) <= MAX_LEVEL:
        return int(text)
    return context.level(text)


_RUNNING = {1: frozenset({1, 6}), 2: frozenset({2, 3})}
"""By the ROS: ACTIVE, PREEMPTING of actionlib_msgs/GoalStatus; EXECUTING, CANCELING of
action_msgs/GoalStatus."""


class Rounds:
    """Reads what marks rounds: a round begins where another began before, and that one is over.

    Of an action's status: a round is a goal that runs, and over once it does not any more, however
    it ended. Nav2's FollowWaypoints and move_base are such actions.
    """

    def __init__(self, rule: topic_rules.ReadPatrol, context: topic_reader.Context) -> None:
        self._rule = rule
        self._context = context
        self._goal: bytes | None = None
        """Whose round is under way; None: no action's status has one."""

    def events(self, got: topic_reader.TopicMessage) -> Iterator[ev.Event]:
        """Return the beginning or the end of a round."""
        happened_ns = self._context.happened_ns(got)
        status_list = getattr(got.message, "status_list", None)
        if status_list is not None:
            yield from self._of_status(status_list, happened_ns)
            return
        value = topic_reader.field_of(got.message, self._rule.path)
        if _is_among(value, self._rule.starts):
            yield from self._begin(happened_ns)
        elif _is_among(value, self._rule.finishes):
            yield from self._end(happened_ns)
        else:
            self._context.complaints.add(
                got.topic, "a value that marks no round; passed over", shown(value)
            )

    def actor(self, _got: topic_reader.TopicMessage) -> str:
        """Return nobody."""
        return ""

    def _of_status(self, status_list: object, happened_ns: int | None) -> Iterator[ev.Event]:
        running = set()
        for each in status_list:  # type: ignore[attr-defined]
            is_ros2 = hasattr(each, "goal_info")
            goal = bytes(each.goal_info.goal_id.uuid) if is_ros2 else each.goal_id.id.encode()
            if each.status in _RUNNING[2 if is_ros2 else 1]:
                running.add(goal)
        if self._goal is not None and self._goal not in running:
            self._goal = None
            yield from self._end(happened_ns)
        if self._goal is None and running:
            self._goal = min(running)
            yield from self._begin(happened_ns)

    def _begin(self, happened_ns: int | None) -> Iterator[ev.Event]:
        yield from self._end(happened_ns)
        yield ev.PatrolStarted(patrol=self._context.known.last_started + 1, happened_ns=happened_ns)

    def _end(self, happened_ns: int | None) -> Iterator[ev.Event]:
        known = self._context.known
        if known.last_started > known.last_finished:
            yield ev.PatrolFinished(patrol=known.last_started, happened_ns=happened_ns)


def _is_among(value: object, marks: tuple[object, ...]) -> bool:
    """Return whether a value is one of the marks: true is not 1."""
    kind = isinstance(value, bool)
    return any(value == mark and kind == isinstance(mark, bool) for mark in marks)


RMF_MODES = {
    0: DoorState.CLOSED,
    1: DoorState.MOVING,
    2: DoorState.OPEN,
    3: DoorState.OFFLINE,
    4: DoorState.UNKNOWN,
}
"""rmf_door_msgs/DoorMode."""


@dataclass(slots=True)
class SightingMaker:
    """Makes sightings of one topic, and leaves out those that repeat."""

    accuracy: topic_rules.Accuracy
    repeats: RepeatFilter

    def of(
        self,
        door: DoorId,
        state: DoorState,
        got: topic_reader.TopicMessage,
        happened_ns: int | None,
    ) -> Iterator[ev.Event]:
        """Yield the sighting, unless it repeats the one before."""
        at_ns = got.received_ns if happened_ns is None else happened_ns
        if not self.repeats.is_repeat(door, state, at_ns):
            yield ev.DoorObserved(
                door_id=door,
                state=state,
                accuracy_open=self.accuracy.open,
                accuracy_closed=self.accuracy.closed,
                happened_ns=happened_ns,
            )


@dataclass(slots=True)
class RepeatFilter:
    """Finds messages that only repeat what was reported a moment ago."""

    within_ns: int
    _last: dict[tuple[DoorId, str], tuple[DoorState, int]] = field(default_factory=dict)
    """Door and sayer -> the state that was kept last, and when."""

    def is_repeat(self, door: DoorId, state: DoorState, at_ns: int, sayer: str = "") -> bool:
        """Return whether it can be left out; what cannot is remembered as kept."""
        last = self._last.get((door, sayer))
        if last is not None and last[0] == state and 0 <= at_ns - last[1] < self.within_ns:
            return True
        self._last[door, sayer] = (state, at_ns)
        return False


class RmfStates:
    """Reads rmf_door_msgs/DoorState."""

    def __init__(
        self, topic: str, rule: topic_rules.ReadRmfState, context: topic_reader.Context
    ) -> None:
        self._doors = _RmfDoors(topic, rule, context)
        self._sightings = SightingMaker(
            rule.accuracy, RepeatFilter(int(context.mapping.repeats_s * 1e9))
        )

    def events(self, got: topic_reader.TopicMessage) -> Iterator[ev.Event]:
        """Return a sighting, unless it repeats the last one."""
        said = self._doors.said(got, got.message.current_mode, got.message.door_time)
        yield from said.new
        if said.door is not None:
            yield from self._sightings.of(said.door, said.state, got, said.happened_ns)

    def actor(self, _got: topic_reader.TopicMessage) -> str:
        """Return nobody."""
        return ""


class RmfRequests:
    """Reads rmf_door_msgs/DoorRequest; one that is sent again and again is kept once in a while."""

    def __init__(
        self, topic: str, rule: topic_rules.ReadRmfRequest, context: topic_reader.Context
    ) -> None:
        self._doors = _RmfDoors(topic, rule, context)
        self._repeats = RepeatFilter(int(context.mapping.repeats_s * 1e9))

    def events(self, got: topic_reader.TopicMessage) -> Iterator[ev.Event]:
        """Return a request, unless the same actor requested the same a moment ago."""
        said = self._doors.said(got, got.message.requested_mode, got.message.request_time)
        yield from said.new
        if said.door is None:
            return
        at_ns = got.received_ns if said.happened_ns is None else said.happened_ns
        if not self._repeats.is_repeat(said.door, said.state, at_ns, self.actor(got)):
            yield ev.DoorRequested(
                door_id=said.door, state=said.state, happened_ns=said.happened_ns
            )

    def actor(self, got: topic_reader.TopicMessage) -> str:
        """Return who requested it."""
        return str(got.message.requester_id).replace("\0", "")


class SensorReader:
    """Reads a field of a message as the state of one door."""

    def __init__(
        self, topic: str, rule: topic_rules.ReadSensor, context: topic_reader.Context
    ) -> None:
        self._rule = rule
        self._context = context
        self._doors = topic_reader.DoorsByName(topic, context, rule.unknown, rule.level)
        self._sightings = SightingMaker(
            rule.accuracy, RepeatFilter(int(context.mapping.repeats_s * 1e9))
        )

    def events(self, got: topic_reader.TopicMessage) -> Iterator[ev.Event]:
        """Return a sighting, unless it repeats the last one."""
        value = topic_reader.field_of(got.message, self._rule.path)
        state = self._state(value)
        if state is None:
            self._context.complaints.add(
                got.topic, "a value that means no state; passed over", shown(value)
            )
            return
        stamp = getattr(getattr(got.message, "header", None), "stamp", None)
        happened_ns = self._context.happened_ns(got, stamp)
        door, new = self._doors.find(self._rule.door, happened_ns)
        yield from new
        if door is not None:
            yield from self._sightings.of(door, state, got, happened_ns)

    def actor(self, _got: topic_reader.TopicMessage) -> str:
        """Return nobody."""
        return ""

    def _state(self, value: Any) -> DoorState | None:
        rule = self._rule
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            if value > rule.open_above:
                return DoorState.OPEN
            if value < rule.closed_below:
                return DoorState.CLOSED
        if rule.states:
            return rule.states.get(value) if isinstance(value, (str, int, float)) else None
        if isinstance(value, bool):
            return DoorState.OPEN if value else DoorState.CLOSED
        if isinstance(value, str):
            return DoorState.__members__.get(value.strip().upper())
        return None


@dataclass(frozen=True, slots=True)
class _Said:
    """What a message of Open-RMF says of a door."""

    door: DoorId | None = None
    """None: of no door that is read."""
    state: DoorState = DoorState.UNKNOWN
    happened_ns: int | None = None
    new: Sequence[ev.Event] = ()
    """Events that add the door, before anything is reported about it."""


class _RmfDoors:
    """Finds the door, the state and the time of Open-RMF's messages."""

    def __init__(
        self,
        topic: str,
        rule: topic_rules.ReadRmfState | topic_rules.ReadRmfRequest,
        context: topic_reader.Context,
    ) -> None:
        self._ours = rule.doors
        self._context = context
        self._doors = topic_reader.DoorsByName(topic, context, rule.unknown, rule.level)

    def said(self, got: topic_reader.TopicMessage, mode: Any, stamp: Any) -> _Said:
        """Return what a message says; what it says amiss is complained about.

        Args:
            got: The message.
            mode: Its rmf_door_msgs/DoorMode.
            stamp: Its time.
        """
        state, name = RMF_MODES.get(int(mode.value)), str(got.message.door_name)
        happened_ns = self._context.happened_ns(got, stamp)
        if state is None:
            kind = "a door mode that Open-RMF does not have; passed over"
            self._context.complaints.add(got.topic, kind, int(mode.value))
            return _Said()
        if not name or "\0" in name:
            kind = "a door without a name; passed over"
            self._context.complaints.add(got.topic, kind, shown(name))
            return _Said()
        door, new = self._doors.find(
            self._ours.get(name, name), happened_ns, or_id=name in self._ours
        )
        return _Said(door, state, happened_ns, new)
