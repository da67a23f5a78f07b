"""Messages that say how a door is, or shall be: Open-RMF's, and any sensor's."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorObserved, DoorRequested, Event
from semmap_log.interop.formats.parsing.problems import shown
from semmap_log.interop.topics.topic_reader import Context, DoorsByName, TopicMessage, field_of
from semmap_log.interop.topics.topic_rules import Accuracy, ReadRmfRequest, ReadRmfState, ReadSensor

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

    accuracy: Accuracy
    repeats: RepeatFilter

    def of(
        self, door: DoorId, state: DoorState, got: TopicMessage, happened_ns: int | None
    ) -> Iterator[Event]:
        """Yield the sighting, unless it repeats the one before."""
        at_ns = got.received_ns if happened_ns is None else happened_ns
        if not self.repeats.is_repeat(door, state, at_ns):
            yield DoorObserved(
                door_id=door,
                state=state,
                accuracy_open=self.accuracy.open,
                accuracy_closed=self.accuracy.closed,
                happened_ns=happened_ns,
            )


@dataclass(slots=True)
class RepeatFilter:
    """Tells what only says again what was said a moment ago."""

    within_ns: int
    _last: dict[tuple[DoorId, str], tuple[DoorState, int]] = field(default_factory=dict)
    """Door and sayer -> the state that was kept last, and when."""

    def is_repeat(self, door: DoorId, state: DoorState, at_ns: int, sayer: str = "") -> bool:
        """Tell whether it can be left out; what cannot is remembered as kept."""
        last = self._last.get((door, sayer))
        if last is not None and last[0] == state and 0 <= at_ns - last[1] < self.within_ns:
            return True
        self._last[door, sayer] = (state, at_ns)
        return False


class RmfStates:
    """Reads rmf_door_msgs/DoorState."""

    def __init__(self, topic: str, rule: ReadRmfState, context: Context) -> None:
        self._doors = _RmfDoors(topic, rule, context)
        self._sightings = SightingMaker(
            rule.accuracy, RepeatFilter(int(context.mapping.repeats_s * 1e9))
        )

    def events(self, got: TopicMessage) -> Iterator[Event]:
        """Return a sighting, unless it repeats the last one."""
        said = self._doors.said(got, got.message.current_mode, got.message.door_time)
        yield from said.new
        if said.door is not None:
            yield from self._sightings.of(said.door, said.state, got, said.happened_ns)

    def actor(self, _got: TopicMessage) -> str:
        """Return nobody."""
        return ""


class RmfRequests:
    """Reads rmf_door_msgs/DoorRequest; one that is sent again and again is kept once in a while."""

    def __init__(self, topic: str, rule: ReadRmfRequest, context: Context) -> None:
        self._doors = _RmfDoors(topic, rule, context)
        self._repeats = RepeatFilter(int(context.mapping.repeats_s * 1e9))

    def events(self, got: TopicMessage) -> Iterator[Event]:
        """Return a request, unless the same one asked for the same a moment ago."""
        said = self._doors.said(got, got.message.requested_mode, got.message.request_time)
        yield from said.new
        if said.door is None:
            return
        at_ns = got.received_ns if said.happened_ns is None else said.happened_ns
        if not self._repeats.is_repeat(said.door, said.state, at_ns, self.actor(got)):
            yield DoorRequested(door_id=said.door, state=said.state, happened_ns=said.happened_ns)

    def actor(self, got: TopicMessage) -> str:
        """Return who asked."""
        return str(got.message.requester_id).replace("\0", "")


class SensorReader:
    """Reads a field of a message as the state of one door."""

    def __init__(self, topic: str, rule: ReadSensor, context: Context) -> None:
        self._rule = rule
        self._context = context
        self._doors = DoorsByName(topic, context, rule.unknown, rule.level)
        self._sightings = SightingMaker(
            rule.accuracy, RepeatFilter(int(context.mapping.repeats_s * 1e9))
        )

    def events(self, got: TopicMessage) -> Iterator[Event]:
        """Return a sighting, unless it repeats the last one."""
        value = field_of(got.message, self._rule.path)
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

    def actor(self, _got: TopicMessage) -> str:
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
    new: Sequence[Event] = ()
    """What makes the door known, before anything is said of it."""


class _RmfDoors:
    """Finds the door, the state and the time of Open-RMF's messages."""

    def __init__(self, topic: str, rule: ReadRmfState | ReadRmfRequest, context: Context) -> None:
        self._ours = rule.doors
        self._context = context
        self._doors = DoorsByName(topic, context, rule.unknown, rule.level)

    def said(self, got: TopicMessage, mode: Any, stamp: Any) -> _Said:
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
