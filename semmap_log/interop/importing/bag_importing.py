"""What a bag means for a log as it stands: its messages, read as a mapping says, as events.

Visits that the log has already are left out: those of an earlier import, or recorded while the
robot drove. Doors are taken at their places at the moments of the scans, by what is known now.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import hypot
from operator import itemgetter
from pathlib import Path

import numpy as np

from semmap_log.analysis.scans.door_watcher import ONE_PASSAGE_NS
from semmap_log.analysis.scans.visit import DoorPlaces, Visit
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_changes import STATE, STATE_CHANGE, known_states, parts_of
from semmap_log.core.io.progress import Progress
from semmap_log.core.model import events as ev
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.meaning import PLACING, sets_part
from semmap_log.core.model.moments import HOUR_NS
from semmap_log.errors import FormatError
from semmap_log.interop.formats.bags.bag_protocol import BagChannel, BagReader
from semmap_log.interop.formats.bags.bag_reading import open_bag
from semmap_log.interop.formats.ros.ros_types import short_name
from semmap_log.interop.importing.held_sightings import HeldSightings
from semmap_log.interop.importing.import_plan import ImportPlan, weight_of
from semmap_log.interop.topics.lasers.door_places import changes_places, places_of
from semmap_log.interop.topics.lasers.scan_keeper import WAY_NS, VisitCommit, is_laser
from semmap_log.interop.topics.topic_reader import Known, TopicProblems
from semmap_log.interop.topics.topic_rules import RosMapping
from semmap_log.interop.topics.translator import Translator
from semmap_log.log import DoorLog, Scope

MOST_KEPT = 200_000
"""Of more events none is kept in memory: their bag is read twice. For `weight_of`."""

TOLD_EVERY = 1000
"""Messages between two words of progress."""


def plan_bag(
    path: Path, log: DoorLog, mapping: RosMapping, *, source: str = "",
    progress: Progress | None = None,
) -> ImportPlan:  # fmt: skip
    """Return the events of a bag, in the order in which the bag has their messages.

    Sightings that the log holds by another file are left out.

    Args:
        path: The bag.
        log: What its messages are compared with, as it stands.
        mapping: How its topics are read.
        source: Only what the log has of this source is compared; empty: all.
        progress: Called with (messages read, messages in all).

    Raises:
        FormatError: The bag cannot be read, or has no topic that is read.
        CommandError: A level that is not there, or that has to be named.
    """
    passage = _Passage.of(path, log, mapping, source, progress)
    kept: list[ev.Event] | None = []
    weight = count = 0
    for event in passage.events():
        count += 1
        weight += weight_of(event)
        if kept is not None:
            kept.append(event)
            if weight > MOST_KEPT:
                kept = None
    events = _BagEvents(path, log, mapping, source, count) if kept is None else kept
    return ImportPlan(
        events,
        count=count,
        summary=passage.summary(count),
        left_out=passage.left_out,
        warnings=(*passage.complaints.lines(), *passage.no_poses, *passage.notes()),
        nothing="" if count else passage.nothing,
    )


def reads_any(path: Path, mapping: RosMapping) -> bool:
    """Return whether a bag has a topic that a mapping reads.

    Raises:
        FormatError: The bag cannot be read.
    """
    with open_bag(path) as bag:
        return any(mapping.rule(c.topic, c.message_type.name) for c in bag.channels)


def left_out_of(path: Path, mapping: RosMapping) -> list[str]:
    """Return the topics of a bag that a mapping does not read, with their types.

    Raises:
        FormatError: The bag cannot be read.
    """
    with open_bag(path) as bag:
        there = [(channel.topic, channel.message_type.name) for channel in bag.channels]
    return sorted({_shown(*each) for each in there if mapping.rule(*each) is None})


def _shown(topic: str, ros_type: str) -> str:
    return f"{topic} ({short_name(ros_type)})"


@dataclass(frozen=True, slots=True)
class _BagEvents:
    """The events of a bag, read a second time, since they are too many to keep."""

    path: Path
    log: DoorLog
    mapping: RosMapping
    source: str
    count: int

    def __iter__(self) -> Iterator[ev.Event]:
        count = 0
        for event in _Passage.of(self.path, self.log, self.mapping, self.source).events():
            count += 1
            yield event
        if count != self.count:
            raise FormatError(self.path, "it changed while it was imported; import it again")


@dataclass(slots=True)
class _Passage:
    """One going through a bag."""

    path: Path
    known: Known
    mapping: RosMapping
    held: HeldSightings
    progress: Progress | None
    complaints: TopicProblems = field(default_factory=TopicProblems)
    left_out: tuple[str, ...] = ()
    messages: int = 0
    actors: int = 0
    made: dict[str, int] = field(default_factory=dict)
    """Kind of event -> how many there are."""
    no_poses: tuple[str, ...] = ()
    """Why topics of transforms never gave a pose."""

    @classmethod
    def of(
        cls, path: Path, log: DoorLog, mapping: RosMapping, source: str,
        progress: Progress | None = None,
    ) -> _Passage:  # fmt: skip
        held = HeldSightings(log, source=source)
        return cls(path, Known.of(log), mapping, held, progress)

    def events(self) -> Iterator[ev.Event]:
        """Yield the events that the log does not hold."""
        for event in self.held.left(self._all_events()):
            kind = type(event).__name__
            self.made[kind] = self.made.get(kind, 0) + 1
            yield event

    def _all_events(self) -> Iterator[ev.Event]:
        translator = Translator(self.mapping, self.known, self.complaints)
        with open_bag(self.path) as bag:
            channels = self._read_channels(bag, translator)
            in_all = bag.count(channels)
            for message in bag.messages(channels):
                self.messages += 1
                if self.progress is not None and self.messages % TOLD_EVERY == 0:
                    self.progress(self.messages, max(in_all, self.messages))
                channel = message.channel
                made = translator.take(
                    channel.topic, channel.message_type, message.data, message.at_ns
                )
                self.actors += bool(made.actor)
                yield from made.events
        self.no_poses = translator.why_no_poses()

    @property
    def nothing(self) -> str:
        """Why no message is an event; empty: they say what the log holds already."""
        if self.held.count:
            return ""
        if not self.messages:
            return "the topics that are read have no messages"
        return "; ".join((*self.complaints.lines(), *self.no_poses))

    def summary(self, count: int) -> tuple[str, ...]:
        made = ", ".join(f"{name} {n:,}" for name, n in sorted(self.made.items()))
        said = f"messages: {self.messages:,}, events: {count:,}"
        if self.held.count:
            said += f"; in the log already, by another file: {self.held.count:,}"
        return (said, *([made] if made else []))

    def notes(self) -> tuple[str, ...]:
        if not self.actors:
            return ()
        return (f"messages that say who: {self.actors:,}; an import is one commit, with one note",)

    def _read_channels(self, bag: BagReader, translator: Translator) -> Collection[BagChannel]:
        """Have the translator read what the mapping names, and note the rest.

        Raises:
            FormatError: There is nothing to read.
        """
        chosen: list[BagChannel] = []
        others: set[str] = set()
        for channel in bag.channels:
            topic, ros_type = channel.topic, channel.message_type.name
            rule = self.mapping.rule(topic, ros_type)
            if rule is None:
                others.add(_shown(topic, ros_type))
            else:
                if not any(each.topic == topic for each in chosen):
                    translator.read_topic(topic, rule)
                chosen.append(channel)
        if not chosen:
            there = ", ".join(sorted(others)[:MOST_TOPICS]) or "nothing"
            raise FormatError(
                self.path, f"no topic that the mapping reads; there is: {there}; name what is "
                "meant in a mapping file (--mapping)",
            )  # fmt: skip
        self.left_out = tuple(sorted(others))
        return chosen


MOST_TOPICS = 20


SAME_PLACE_M = 1.0
"""Two robots are not so near to each other at one moment."""
_KINDS = (ev.RobotPose, ev.DoorObserved, ev.DoorPassed)
_Key = tuple[str, str, int, type[ev.Event]]


@dataclass(frozen=True, slots=True)
class PlannedVisit:
    """A commit for the log."""

    command_id: bytes
    commit: VisitCommit


@dataclass(frozen=True, slots=True)
class SeenBefore:
    """What a log has of the lasers of a bag, at the time of the bag.

    A visit that is recorded twice would count as two.
    """

    commands: frozenset[bytes]
    told: Mapping[_Key, Sequence[int]]
    """Actor, source, door and kind -> when, nanoseconds, ascending."""
    from_where: Mapping[tuple[int, type[ev.Event]], Sequence[ev.RobotPose]] = field(
        default_factory=dict
    )
    """Door and kind -> where a robot was when its laser reported that."""

    @classmethod
    def of(cls, log: DoorLog, visits: Sequence[VisitCommit]) -> SeenBefore:
        """Return what a log has that may be some of these visits."""
        if not visits:
            return cls(frozenset(), {})
        poses: dict[tuple[bytes, int], ev.RobotPose] = {}
        from_where: dict[tuple[int, type[ev.Event]], list[ev.RobotPose]] = {}
        told: dict[_Key, list[int]] = {}
        commands: set[bytes] = set()
        since = min(each.visit.first_ns for each in visits) - ONE_PASSAGE_NS
        until = max(each.visit.last_ns for each in visits) + ONE_PASSAGE_NS + 1
        for entry in log.history(since=since, until=until, kinds=_KINDS):
            event = entry.event
            if isinstance(event, ev.RobotPose):  # before what was seen from there
                poses[entry.command_id, entry.happened_ns] = event
                continue
            assert isinstance(event, ev.DoorObserved | ev.DoorPassed)
            commands.add(entry.command_id)
            key = (entry.actor, entry.source, event.door_id, type(event))
            told.setdefault(key, []).append(entry.happened_ns)
            pose = poses.get((entry.command_id, entry.happened_ns))
            if pose is not None and is_laser(entry.source):
                from_where.setdefault((event.door_id, type(event)), []).append(pose)
        in_order = {key: sorted(times) for key, times in told.items()}
        return cls(frozenset(commands), in_order, from_where)

    def holds(self, planned: PlannedVisit) -> bool:
        """Return whether this very visit is stored."""
        return planned.command_id in self.commands

    def overlaps(self, planned: PlannedVisit, actor: str = "") -> bool:
        """Return whether the same laser saw the same door meanwhile, or another one of its robot.

        The same holds for any report that the robot drove through it: it did so once. The actor's
        name does not matter: two robots are not at one place at one moment.

        Args:
            planned: The visit.
            actor: Who will be named as who saw it, and may have been before; "": the robot.
        """
        names = {planned.commit.note.actor, actor or planned.commit.note.actor}
        if any(self._overlaps(planned, name) for name in names):
            return True
        visit, way = planned.commit.visit, planned.commit.way
        told = self.from_where.get((visit.door_id, kind_of(visit)), ())
        return any(_was_there(way, pose) for pose in told)

    def _overlaps(self, planned: PlannedVisit, actor: str) -> bool:
        visit, source = planned.commit.visit, planned.commit.note.source
        kind = kind_of(visit)
        own = (actor, source, visit.door_id, kind)
        if self._is_reported(own, visit.first_ns, visit.last_ns):
            return True
        if not visit.passed:
            return False
        others = [key for key in self.told if key[::2] == (actor, visit.door_id) and key != own
                  and key[3] is kind]  # fmt: skip
        around = visit.first_ns - ONE_PASSAGE_NS, visit.last_ns + ONE_PASSAGE_NS
        return any(self._is_reported(key, *around) for key in others)

    def _is_reported(self, key: _Key, first_ns: int, last_ns: int) -> bool:
        times = self.told.get(key, ())
        place = bisect_left(times, first_ns)
        return place < len(times) and times[place] <= last_ns


def kind_of(visit: Visit) -> type[ev.DoorObserved | ev.DoorPassed]:
    """Return the kind of event that a visit becomes."""
    return ev.DoorPassed if visit.passed else ev.DoorObserved


def _was_there(way: Sequence[ev.RobotPose], pose: ev.RobotPose) -> bool:
    """Return whether a robot came by a place at that very moment."""
    at_ns = pose.happened_ns or 0
    for before, after in pairwise(way):
        first_ns, last_ns = before.happened_ns or 0, after.happened_ns or 0
        if first_ns <= at_ns <= last_ns and last_ns - first_ns <= 2 * WAY_NS:
            share = (at_ns - first_ns) / (last_ns - first_ns)
            x = before.x + share * (after.x - before.x)
            y = before.y + share * (after.y - before.y)
            return pose.level == before.level and hypot(pose.x - x, pose.y - y) <= SAME_PLACE_M
    return False


AHEAD_NS = 4 * HOUR_NS
"""Reports up to this long after a moment are read with it: visits come in order of time."""


class PlacesOverTime:
    """The places of a log's doors over time, with events that are to come into it."""

    def __init__(self, log: DoorLog, others: Sequence[ev.Event] = ()) -> None:
        self._log = log
        of_state = [event for event in others if isinstance(event, ev.STATE_KINDS)]
        self._states = _States(log, EventBatch.from_events(of_state))
        self._others = [event for event in others if changes_places(event)]
        self._moments = sorted({*_changes(log), *(e.happened_ns or 0 for e in self._others)})
        self._current: tuple[int, DoorPlaces] | None = None

    def at(self, when_ns: int) -> DoorPlaces:
        """Return the places of a moment; the same object until one of them changes."""
        number = bisect_right(self._moments, when_ns)
        if self._current is None or self._current[0] != number:
            self._current = (number, self._places(when_ns))
        return self._current[1]

    def state(self, door_id: int, since_ns: int, when_ns: int) -> DoorState | None:
        """Return a door's state at a moment, by reports after `since_ns`; None: there are none."""
        return self._states.last(door_id, since_ns, when_ns)

    def _places(self, when_ns: int) -> DoorPlaces:
        state = self._log.state_in(Scope(at_ns=when_ns))
        for number, event in enumerate(self._others, start=self._log.last_event() + 1):
            if (event.happened_ns or 0) <= when_ns:
                state.apply_one(replace(event, happened_ns=event.happened_ns or 0), number)
        return places_of(state.door_map().doors.values())


def _changes(log: DoorLog) -> Iterator[int]:
    """Yield when a door came, went, or may have got another place."""
    kinds = [ev.DoorAdded, ev.DoorRemoved, ev.DoorUpdated, ev.DoorAnnotated]
    for batch in log.batches(kinds=kinds):
        when = batch.folds_ns
        moves = np.ones(len(batch), np.bool_)
        if ev.DoorUpdated in batch:
            parts = batch[ev.DoorUpdated]["changed"]
            moves[batch.where(ev.DoorUpdated)] = sets_part(parts, int(PLACING))
        yield from np.unique(when[moves]).tolist()


class _States:
    """Reported states of doors: some hours of them are in memory at a time."""

    def __init__(self, log: DoorLog, others: EventBatch) -> None:
        self._log, self._others = log, others
        self._from_ns = self._until_ns = 0
        self._of_door: dict[int, list[tuple[int, int, DoorState]]] = {}
        """Door -> when, number, state; ascending."""

    def last(self, door_id: int, since_ns: int, when_ns: int) -> DoorState | None:
        """Return the last one from after `since_ns` to `when_ns`; None: there is none."""
        if not self._from_ns <= since_ns <= when_ns < self._until_ns:
            self._read(since_ns, when_ns + AHEAD_NS)
        said = self._of_door.get(door_id, [])
        place = bisect_right(said, when_ns, key=itemgetter(0))
        return said[place - 1][2] if place and said[place - 1][0] > since_ns else None

    def _read(self, from_ns: int, until_ns: int) -> None:
        self._from_ns, self._until_ns = from_ns, until_ns
        self._of_door.clear()
        behind = self._log.last_event() + 1
        for batch in self._log.batches(since=from_ns, until=until_ns, kinds=ev.STATE_KINDS):
            self._take(batch, 0)
        self._take(self._others, behind)
        for said in self._of_door.values():
            said.sort()

    def _take(self, batch: EventBatch, first: int) -> None:
        for rows in parts_of(batch, STATE_CHANGE, setting=STATE):
            rows["state"] = known_states(rows["state"])
            for door_id, at_ns, number, _, state in rows.tolist():
                said = (at_ns, first + number, DoorState(state))
                self._of_door.setdefault(door_id, []).append(said)
