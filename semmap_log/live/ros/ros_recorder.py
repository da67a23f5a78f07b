"""Records what a robot's topics say: callbacks fill a queue, one writer makes events of it.

The writer takes all that waits, appends the events of each message as one commit, and has them
share one sync. What came before it was stopped is written; what had not come is not.
"""

from __future__ import annotations

import queue
import re
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Protocol

from semmap_log.core.batches.event_batch import one_by_one
from semmap_log.core.model.commits import Durability, Note
from semmap_log.core.model.events import Event
from semmap_log.core.texts import counted
from semmap_log.errors import CommandError, InvalidEventError, RosError
from semmap_log.interop.formats.ros.ros_types import MessageType, RosVersion, short_name
from semmap_log.interop.topics.lasers.lasers import RobotScan
from semmap_log.interop.topics.lasers.scan_keeper import ScanKeeper, ScanWatch, VisitCommit
from semmap_log.interop.topics.topic_reader import Known, TopicProblems
from semmap_log.interop.topics.topic_rules import EXPECTED_TOPICS, RosMapping, TopicRule
from semmap_log.interop.topics.translator import Translator
from semmap_log.live.ros.ros_node import Received, RosNode
from semmap_log.log import DoorLog, DoorLogWriter

MOST_WAITING = 100_000
"""Messages; of a disk that is slower for so long the newest are dropped, and counted."""
MOST_AT_ONCE = 1000
LOOK_EVERY_S = 1.0
"""How soon a topic is found that nobody published before."""
REPORT_EVERY_S = 60.0
QUIET_LOOK_S = 5.0
"""Where no message comes, so often visits are ended whose laser is silent."""


class EventSink(Protocol):
    """Where events go."""

    def write(self, events: list[Event], note: Note) -> None:
        """Take the events of a message: they become visible together, or not at all.

        Raises:
            CommandError: The map forbids one; none was taken.
            InvalidEventError: No log can hold one; none was taken.
        """

    def settle(self) -> None:
        """Return once all that was written lasts as long as was promised."""

    def known(self) -> Known:
        """Return what messages are compared with, as it stands."""

    def robot(self) -> str:
        """Return whose log it is; "": nobody's."""


class LogSink:
    """A log that is written."""

    def __init__(self, log: DoorLogWriter) -> None:
        self._log = log
        self._is_synced_at_once = log.policy.level is Durability.EVENT

    def write(self, events: list[Event], note: Note) -> None:
        """Append them as one commit; as was promised of it, but for the sync that many share."""
        self._log.append(events, note=note, sync=False if self._is_synced_at_once else None)

    def settle(self) -> None:
        """Sync, if every event is to be on the disk at once; the others see to it themselves."""
        if self._is_synced_at_once:
            self._log.sync()

    def known(self) -> Known:
        """Return what the log knows."""
        return Known.of(self._log)

    def robot(self) -> str:
        """Return whose log it is."""
        return self._log.info.robot


class PrintedSink:
    """Nothing is written: each event is shown. For a dry run."""

    def __init__(self, show: Callable[[Event, Note], None], log: DoorLog | None) -> None:
        self._show = show
        self._log = log

    def write(self, events: list[Event], note: Note) -> None:
        """Show them."""
        for event in one_by_one(events):
            self._show(event, note)

    def settle(self) -> None:
        """There is nothing to wait for."""

    def known(self) -> Known:
        """Return what the log knows, if there is one."""
        return Known() if self._log is None else Known.of(self._log)

    def robot(self) -> str:
        """Return whose log it is, if there is one."""
        return "" if self._log is None else self._log.info.robot


@dataclass(slots=True)
class RecorderCounts:
    """What has come and what became of it."""

    received: int = 0
    dropped: int = 0
    """Not even read: too many waited."""
    messages: int = 0
    """Read."""
    commits: int = 0
    events: int = 0
    scans: int = 0
    """That have a place on the map."""
    visits: int = 0
    """To doors; those that decided nothing, too."""

    def __str__(self) -> str:
        dropped = f", {self.dropped:,} DROPPED (the disk is too slow)" if self.dropped else ""
        seen = f", {counted(self.visits, 'visit')} to doors" if self.scans else ""
        return (
            f"{counted(self.messages, 'message')}, {counted(self.events, 'event')}{seen}{dropped}"
        )


@dataclass(slots=True)
class RosRecorder:
    """Records the topics of a mapping until it is stopped."""

    node: RosNode
    mapping: RosMapping
    sink: EventSink
    say: Callable[[str], None]
    """Hears of topics, of trouble once for each kind, and every minute of the counts."""
    keeper: ScanKeeper | None = None
    """Keeps the scans of visits; None: nobody does."""
    counts: RecorderCounts = field(default_factory=RecorderCounts)
    stopping: bool = False
    """Set by a signal handler: finish what was received, then return."""
    _complaints: TopicProblems = field(init=False)
    _translator: Translator = field(init=False)
    _watch: ScanWatch = field(init=False)
    _queue: queue.SimpleQueue[tuple[str, Received] | None] = field(
        default_factory=queue.SimpleQueue
    )
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _subscribed: set[str] = field(default_factory=set)
    _error: BaseException | None = None
    _is_alone: bool = False
    """ROS did not answer the last query."""
    _next_look: float = 0.0
    _next_word: float = 0.0

    def __post_init__(self) -> None:
        self._complaints = TopicProblems(self.say)
        known = self.sink.known()
        self._translator = Translator(self.mapping, known, self._complaints)
        self._watch = ScanWatch(known, self.sink.robot(), self.keeper)

    def run(self) -> None:
        """Record; on return everything that was received is written, and lasts.

        Raises:
            CommandError: A level that is not there, or that has to be named; a topic's name that
                ROS cannot have.
            LogPoisonedError: A write failed; what came since then may or may not be stored.
        """
        self._next_word = time.monotonic() + REPORT_EVERY_S
        writer = threading.Thread(target=self._write, name="recorder")
        writer.start()
        try:
            for topic, rule in self.mapping.topics.items():  # report what is wrong first
                _check_name(topic, self.node.ros_version)
                self._translator.read_topic(topic, rule)
            self._subscribe_ahead()
            self.node.run(lambda: self.stopping or self._error is not None, tick=self._tick)
        finally:
            self.node.close()  # nothing comes any more
            self._queue.put(None)
            writer.join()
        if self._error is not None:
            raise self._error

    def summary(self) -> tuple[str, ...]:
        """Return what was wrong with messages, kind by kind; and of scans what came of them."""
        scans = self._watch.lines(self._translator.lasers) if self.mapping.reads_scans else ()
        return (*self._complaints.lines(), *self._translator.why_no_poses(), *scans)

    # Topics

    def _subscribe_ahead(self) -> None:
        """Subscribe to all whose type is known, though nobody may publish them yet."""
        for topic, rule in self.mapping.topics.items():
            if rule.expected_type or self.node.ros_version == 1:
                self._subscribe(topic, rule, rule.expected_type)
        if self.mapping.well_known:
            for topic, ros_type in EXPECTED_TOPICS.items():
                expected = self.mapping.rule(topic, ros_type)
                if expected is not None:
                    self._subscribe(topic, expected, ros_type)
        self._look()

    def _look(self) -> None:
        """Subscribe to what is published now, as far as it is read."""
        self._next_look = time.monotonic() + LOOK_EVERY_S
        for topic, ros_type in self._published().items():
            rule = self.mapping.rule(topic, ros_type)
            if rule is None:
                continue
            try:
                self._subscribe(topic, rule, rule.ros_type or ros_type)
            except CommandError as error:  # what is recorded already goes on
                self.say(f"left out: {error}")

    def _published(self) -> Mapping[str, str]:
        """Return the published topics; none while ROS does not answer, which is reported."""
        try:
            found = self.node.topics()
        except RosError as error:
            if not self._is_alone:
                self.say(str(error))
            self._is_alone = True
            return {}
        if self._is_alone:
            self.say("ROS answers again.")
        self._is_alone = False
        return found

    def _subscribe(self, topic: str, rule: TopicRule, ros_type: str) -> None:
        if topic in self._subscribed:
            return
        self._subscribed.add(topic)
        if topic not in self.mapping.topics:
            with self._lock:
                self._translator.read_topic(topic, rule)
        any_type = self.node.ros_version == 1 and not rule.ros_type
        try:
            self.node.subscribe(
                topic, "" if any_type else ros_type, lambda got: self._take(topic, got)
            )
        except RosError as error:
            self.say(f"{topic}: left out: {error}")
            return
        self.say(f"{topic}: recording ({short_name(ros_type) or 'any type'})")

    # Messages

    def _take(self, topic: str, got: Received) -> None:
        """Have a message wait for the writer; called by the node's threads."""
        self.counts.received += 1
        if self._queue.qsize() >= MOST_WAITING:
            self.counts.dropped += 1
            return
        self._queue.put((topic, got))

    def _tick(self) -> None:
        now = time.monotonic()
        if now >= self._next_look:
            self._look()
        if now >= self._next_word:
            self._next_word = now + REPORT_EVERY_S
            self.say(f"{self.counts}, {self._queue.qsize():,} waiting")

    def _write(self) -> None:
        """Write what waits until there is nothing more to come; the only one that writes."""
        try:
            while self._write_waiting():
                pass
            with self._lock:
                scans = self._translator.rest()
            self._look_through(scans)
            self._write_visits(self._watch.close())
            self.sink.settle()
        except BaseException as error:  # noqa: BLE001  whoever runs it raises it
            self._error = error

    def _write_waiting(self) -> bool:
        """Write all that waits, with one sync; return whether there is more to come."""
        is_more = True
        with suppress(queue.Empty):
            for _ in range(MOST_AT_ONCE):
                item = self._queue.get(timeout=QUIET_LOOK_S)
                is_more = item is not None
                if item is None:
                    break
                self._write_message(*item)
                if self._queue.empty():
                    break
        self._write_visits(self._watch.take())
        self.sink.settle()
        return is_more

    def _write_message(self, topic: str, got: Received) -> None:
        self.counts.messages += 1
        message_type = MessageType(got.ros_type, self.node.ros_version, got.definition)
        with self._lock:
            made = self._translator.take(topic, message_type, got.data, got.received_ns)
        self._look_through(made.scans)
        if not made.events:
            self._confirm(topic, made.said)
            return
        self._write_visits(self._watch.take())  # through which the doors are as they were
        source = f"{got.topic} of {got.sender}" if got.sender else got.topic
        try:
            self.sink.write(made.events, Note(made.actor, source, made.reason))
        except (CommandError, InvalidEventError) as error:
            self._complaints.add(topic, "events that the map forbids; left out", error)
            self._resync()
            return
        self._confirm(topic, made.said)
        self._watch.saw(made.events)
        self.counts.commits += 1
        self.counts.events += len(made.events)

    def _confirm(self, topic: str, said: str) -> None:
        """Report what was done, to a person who waits for it."""
        if said:
            self.say(f"{topic}: {said}")

    def _look_through(self, scans: Sequence[RobotScan]) -> None:
        self.counts.scans += len(scans)
        self._watch.add(scans)

    def _write_visits(self, visits: Iterable[VisitCommit]) -> None:
        """Write what visits to doors say, a commit each."""
        for commit in visits:
            try:
                self.sink.write(commit.events, commit.note)
            except (CommandError, InvalidEventError) as error:
                said = "a sighting by laser that the map forbids; left out"
                self._complaints.add(commit.note.source, said, error)
                self._resync()
                continue
            with self._lock:
                self._translator.heed(commit.events)
            self.counts.commits += 1
            self.counts.events += len(commit.events)
        self.counts.visits = self._watch.visits

    def _resync(self) -> None:
        """Take the log as it stands: what was made was not stored."""
        known = self.sink.known()
        with self._lock:
            self._translator.reset_known(known)
        self._watch.reset_known(known)


def _check_name(topic: str, ros_version: RosVersion) -> None:
    if not _NAMES[ros_version].fullmatch(topic):
        raise CommandError(
            f"{topic!r}: expected a topic's name as ROS {ros_version} has them: letters, digits "
            "and _ between single slashes"
            + (", no part of it beginning with a digit" if ros_version == 2 else "")
            + "; correct the mapping file."
        )


_NAMES = {1: re.compile(r"(/\w+)+", re.ASCII), 2: re.compile(r"(/[^\W\d]\w*)+", re.ASCII)}
