"""What a bag means for a log as it stands: its messages, read as a mapping says, as events."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from semmap_log.core.io.progress import Progress
from semmap_log.core.model.events import Event
from semmap_log.errors import FormatError
from semmap_log.interop.formats.bags.bag_protocol import BagChannel, BagReader
from semmap_log.interop.formats.bags.bag_reading import open_bag
from semmap_log.interop.formats.ros.ros_types import short_name
from semmap_log.interop.importing.held_sightings import HeldSightings
from semmap_log.interop.importing.import_plan import ImportPlan, weight_of
from semmap_log.interop.topics.known import Known
from semmap_log.interop.topics.topic_problems import TopicProblems
from semmap_log.interop.topics.topic_rules import RosMapping
from semmap_log.interop.topics.translator import Translator
from semmap_log.log.door_log.door_log import DoorLog

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
        progress: Told (messages read, messages in all).

    Raises:
        FormatError: The bag cannot be read, or has no topic that is read.
        CommandError: A level that is not there, or that has to be named.
    """
    passage = _Passage.of(path, log, mapping, source, progress)
    kept: list[Event] | None = []
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
    """Tell whether a bag has a topic that a mapping reads.

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
    """The events of a bag that was gone through before, read anew: they are many."""

    path: Path
    log: DoorLog
    mapping: RosMapping
    source: str
    count: int

    def __iter__(self) -> Iterator[Event]:
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

    def events(self) -> Iterator[Event]:
        """Yield the events that the log does not hold."""
        for event in self.held.left(self._all_events()):
            kind = type(event).__name__
            self.made[kind] = self.made.get(kind, 0) + 1
            yield event

    def _all_events(self) -> Iterator[Event]:
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
