"""The one way into a log: a command comes in, and is a commit when it returns.

`Appended` is the result. Warns of events that no answer counts, since they happened before their
door was added, and of events that are dated in the future: no answer counts them so.
"""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log import errors
from semmap_log.core.batches.columnar_events import ColumnarEvents
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_index import all_door_labels
from semmap_log.core.folds.early_events import EarlyEvents, remedy
from semmap_log.core.io.clock import KeptClock
from semmap_log.core.model.commits import GIVEN_EVENTS, NO_CONTENT, POSES_WAIT_S, Commit
from semmap_log.core.model.doors import ShownAsTable
from semmap_log.core.model.events import Event, RobotPose
from semmap_log.core.model.moments import SECOND_NS, format_local
from semmap_log.core.texts import counted
from semmap_log.core.users_line import frames_of_ours
from semmap_log.log.door_log.current_map import WAITING_POSES, Command, CurrentMap, ImportedCommit
from semmap_log.log.door_log.known_past import Validator
from semmap_log.log.replay.written_state import WrittenState
from semmap_log.store.gone_commands import StoredCommand
from semmap_log.store.writing.writer_opening import OpenedLog


class Appender:
    """Appends commands, each checked against the map as it stands. May be used by several threads.

    One thread at a time makes and writes a command's events; then it waits for the disk while
    others continue.
    """

    def __init__(self, opened: OpenedLog[WrittenState]) -> None:
        """Begin where the log ends.

        Args:
            opened: The log, whose door map is known.
        """
        self._writer = opened.writer
        self._lock = threading.RLock()
        self.now = CurrentMap(opened, self._lock)
        self._early = EarlyWarnings(self.now, opened.reader.info.timezone)
        self._future = FutureWarnings(opened.reader.info.timezone)
        self._pose_timer: threading.Timer | None = None

    def append(self, command: Command, *, sync: bool | None = None) -> Appended:
        """Append a command's events as one commit, all or none; waiting poses go before them.

        One that is stored already is not stored again.

        Args:
            command: The command; it has at least one event.
            sync: Whether to return only when it survives a power cut; default: as the log's
                durability says.

        Raises:
            CommandError: The map forbids an event; nothing is stored.
            InvalidEventError: A value that no event can have.
            CommandReusedError: The command's id is stored already, of another.
            UnexpectedEventError: The door, or the log, went on since the caller looked.
            LogPoisonedError: A write failed; the outcome is unknown until the log is reopened.
        """
        content = command.content
        with self._lock:
            appended = self._repeated(command)
            if appended is None:
                appended = self._write(command, content, command.events(self.now))
        self._keep(appended.commit, sync=sync)  # other threads may append meanwhile
        self._warn()
        return appended

    def append_if_any(self, command: Command) -> Appended | None:
        """Append a command that may turn out to have no events; None: it had none.

        What it looked at to know that lasts, too, as the log's durability promises.

        Raises:
            LogError: As `append`; if the log cannot be appended to, the command is not evaluated.
        """
        with self._lock:
            appended = self._repeated(command)
            if appended is None:
                self._writer.check_usable()
                looked_at = self._writer.next_event
                events = command.events(self.now)
                if events:
                    appended = self._write(command, command.content, events)
        if appended is None:
            self._writer.apply_policy(looked_at)
            return None
        self._keep(appended.commit, sync=None)
        self._warn()
        return appended

    def take_over(
        self, command: Command, *, are_facts: bool = True, recorded_ns: int | None = None
    ) -> Commit:
        """Append a commit of another log as it was there; `LogWriter.sync` makes it last.

        Args:
            command: The caller has checked that it is not stored.
            are_facts: The other log took its events: only what this log could not hold is refused.
            recorded_ns: When the other log recorded it; None: it is recorded now. Later than the
                log's end, or the log ends there.

        Raises:
            CommandError: The map forbids an event; nothing of the commit is stored.
            LogPoisonedError: A write failed; the outcome is unknown until the log is reopened.
        """
        clock = None if recorded_ns is None else KeptClock(recorded_ns)
        with self._lock:
            self.write_poses()
            events = command.events(self.now)
            return self._write(command, command.content, events, clock, are_facts=are_facts).commit

    def begin_at(self, recorded_ns: int) -> bool:
        """Let a log without events begin at that moment; False: it has events, or had.

        Raises:
            LogPoisonedError: It could not be written.
        """
        with self._lock:
            self.write_poses()
            if not self._writer.is_fresh:
                return False
            self._writer.begin_at(recorded_ns)
            self.now.is_read = False
            return True

    def find_command(self, command_id: bytes) -> StoredCommand | None:
        """Return a command, if it is stored, however long ago.

        Raises:
            CorruptLogError: A segment in which it may be is damaged.
        """
        with self._lock:
            return self._writer.find(command_id)

    def add_pose(self, pose: RobotPose) -> None:
        """Keep a pose for the next commit; if none comes within a second, it gets its own.

        Raises:
            UnknownLevelError: It states no level, and the log has several.
        """
        with self._lock:
            self._writer.check_usable()
            if pose.happened_ns is None:
                pose = replace(pose, happened_ns=self.now.now_ns())
            pose = replace(pose, level=self.now.level_meant(pose.level))
            self.now.waiting.append(pose)
            if self._pose_timer is None:
                self._pose_timer = threading.Timer(POSES_WAIT_S, self._write_poses_late)
                self._pose_timer.daemon = True
                self._pose_timer.start()

    def write_poses(self) -> None:
        """Write the poses that wait, if any do, as a commit of their own.

        Raises:
            LogPoisonedError: A write failed; the outcome is unknown until the log is reopened.
        """
        with self._lock:
            if self._pose_timer is not None:
                self._pose_timer.cancel()
                self._pose_timer = None
            self.now.take_in()
            if self.now.waiting:
                written = self._write(WAITING_POSES, WAITING_POSES.content, ())
                self._keep(written.commit, sync=None)

    def close(self) -> None:
        """Write what waits, close the segment so that every tool reads it, let the lock go."""
        with self._lock:
            try:
                self.write_poses()
            finally:
                self.now.waiting = []
                self._writer.close()
                self.now.is_read = False
        self._early.warn(is_last=True)
        self._future.warn(is_last=True)

    def _warn(self) -> None:
        """Warn of times that cannot be meant."""
        if self._early.found.counts:
            self._early.warn()
        self._future.warn()

    def _repeated(self, command: Command) -> Appended | None:
        """Return the answer to a command that is stored already; None: it is not.

        Raises:
            CommandReusedError: Its id is, of another.
        """
        command_id = command.context.command_id
        if command_id is None:
            return None
        if not isinstance(command_id, bytes):
            raise errors.InvalidEventError("command_id", "16 bytes", command_id)
        found = self._writer.find(command_id)
        if found is None:
            return None
        known, stored = found.commit, list(self.now.events_of(found.commit))
        is_same = (
            command.is_stored_as(known, stored)
            if found.seal is None
            else command.is_sealed_as(found)
        )
        if not is_same:
            raise errors.CommandReusedError(
                f"command {known.command_id.hex()} is already stored as event "
                f"{known.first_event}, with other content; give a new command a new id."
            )
        poses = next((i for i, e in enumerate(stored) if not isinstance(e, RobotPose)), 0)
        own, waited = command.own_count, poses if found.seal is None else found.seal.poses
        before = waited if own is None else known.count - own
        return Appended(known, before, True, stored[poses:], self._writer.make_durable)

    def _write(
        self,
        command: Command,
        content: bytes,
        events: Iterable[Event | EventBatch],
        clock: KeptClock | None = None,
        *,
        are_facts: bool = False,
    ) -> Appended:
        """Write a command's events after the waiting poses, and apply their changes."""
        now, context = self.now, command.context
        if not isinstance(command, ImportedCommit):  # which has the content of its own log
            if context.command_id is None:
                content = NO_CONTENT  # it will not be sent again
            elif content == NO_CONTENT:
                content = GIVEN_EVENTS
        if now.next_event != self._writer.next_event:
            now.take_in()
        if context.expected_event is not None:
            now.check_last_event(context.expected_event, command.door_expected(events))
        poses, index = now.waiting, now.index
        validator = Validator(
            now.door_index if index is None else index,
            now.next_event + len(poses),
            now.now_ns if clock is None else clock.wall_ns,
            are_facts=are_facts,
            past=now.past,
        )
        own: Sequence[Event | EventBatch] = ()
        try:
            if isinstance(events, (list, tuple)):
                own = validator.check_all(events)
                whole: Iterable[Event | EventBatch] = [*poses, *own] if poses else own
            else:
                whole = chain(poses, self._future.passing(validator.checked(events)))
            commit = self._writer.append(
                whole,
                note=context.note,
                command_id=context.command_id,
                content=content,
                clock=clock,
            )
        finally:
            now.is_read = False
        self._take_in(validator, commit)
        self._future.settle(own, commit.recorded_ns)
        return Appended(commit, len(poses), False, own, self._writer.make_durable)

    def _take_in(self, validator: Validator, commit: Commit) -> None:
        """Take in what a commit changes."""
        now = self.now
        now.waiting = []
        validator.settle(commit)
        if not validator.keeps_names:
            now.doors = None
        now.index = validator.index if validator.is_index_sure else None
        if validator.has_retraction:
            self._early.start_over()
        if validator.early is not None:
            self._early.found.add_all(validator.early.found)
        now.next_event = self._writer.next_event  # last: an interrupt may come in between

    def _keep(self, commit: Commit, *, sync: bool | None) -> None:
        """Return once a commit is durable: as requested, or as the log's policy promises."""
        before = commit.last_event + 1
        try:
            if sync is None:
                self._writer.apply_policy(before)
            elif sync:
                self._writer.make_durable(before)
        except errors.LogPoisonedError as error:
            error.command_id = error.command_id or commit.command_id
            raise

    def _write_poses_late(self) -> None:
        """Write poses for which no commit came; called by the timer's thread."""
        with suppress(errors.LogPoisonedError):  # the next append raises it
            self.write_poses()


@dataclass(frozen=True, slots=True, repr=False)
class Appended(ShownAsTable):
    """What became of an append."""

    commit: Commit
    poses: int = 0
    """How many robot poses, which had waited, stand before its own events in the commit."""
    repeated: bool = False
    """The command was stored before; nothing was written now."""
    events: Sequence[Event | EventBatch] = field(default=(), repr=False, compare=False)
    """Its own events; empty where they were given as they came, one after the other."""
    _make_durable: Callable[[int], None] | None = field(default=None, repr=False, compare=False)

    def __repr__(self) -> str:
        first, again = self.first_event, ", stored before" if self.repeated else ""
        return f"<Appended events {first} to {first + self.count - 1}{again}>"

    @property
    def first_event(self) -> int:
        """Number of its own first event."""
        return self.commit.first_event + self.poses

    @property
    def count(self) -> int:
        """How many events of its own it has."""
        return self.commit.count - self.poses

    def wait(self) -> None:
        """Return once it survives a power cut, whatever the log's durability; threads share syncs.

        Raises:
            LogPoisonedError: The sync failed; the outcome is unknown until the log is reopened.
        """
        if self._make_durable is not None:
            self._make_durable(self.commit.last_event + 1)

    def __await__(self) -> Generator[Any, None, Appended]:
        """Wait without blocking the event loop: `appended = await log.append(events)`."""
        import asyncio

        yield from asyncio.to_thread(self.wait).__await__()
        return self


TOLD_AGAIN = 10
"""Uncounted events cause a warning at once, and again each time they are so many times as many."""


class EarlyWarnings:
    """Appended events from before their door was added, and how many of them were reported."""

    def __init__(self, now: CurrentMap, timezone: str) -> None:
        """Begin with nothing.

        Args:
            now: The map, of which the doors' names are.
            timezone: The log's.
        """
        self._now, self._timezone = now, timezone
        self.found = EarlyEvents.none()
        self._told = 0

    def start_over(self) -> None:
        """Forget what was found: a retraction may have moved addings."""
        self.found, self._told = EarlyEvents.none(), 0

    def warn(self, *, is_last: bool = False) -> None:
        """Warn at once, each time there are ten times as many, and at the end."""
        count = len(self.found)
        enough = self._told + 1 if is_last else TOLD_AGAIN * self._told
        if not count or count < enough:
            return
        self._told = count
        since = format_local(min(self.found.first_ns.values()), self._timezone)
        said = self.found.as_text(all_door_labels(self._now.state), since)
        text = f"{said}; {remedy(self._now.path)}"
        warnings.warn(errors.EarlyEventsWarning(text), stacklevel=frames_of_ours())


SLACK_NS = 60 * SECOND_NS
"""Two clocks may differ by this much."""
WARN_AGAIN = 10
"""Future events cause a warning at once, and again each time they are so many times as many."""


class FutureWarnings:
    """Appended events that are dated later than they were recorded."""

    def __init__(self, timezone: str) -> None:
        """Begin with nothing.

        Args:
            timezone: The log's.
        """
        self._timezone = timezone
        self._count = 0
        self._warned = 0
        self._latest_ns = 0
        self._waiting: list[NDArray[np.int64]] = []

    def passing(self, events: Iterable[Event | EventBatch]) -> Iterator[Event | EventBatch]:
        """Yield the events, and remember when they happen until they are recorded."""
        self._waiting = []
        for event in events:
            self._waiting.append(_times_of(event))
            yield event

    def settle(self, events: Iterable[Event | EventBatch], recorded_ns: int) -> None:
        """Count those that happen later than they were recorded, of these and of what has passed.

        Args:
            events: Of a commit, those that did not pass one by one.
            recorded_ns: When it was recorded.
        """
        parts, self._waiting = self._waiting, []
        if isinstance(events, ColumnarEvents):
            parts.append(np.array(events.given_times(), np.int64))
        else:
            parts += map(_times_of, events)
        for times in parts:
            ahead = times[times > recorded_ns + SLACK_NS]
            if len(ahead):
                self._count += len(ahead)
                self._latest_ns = max(self._latest_ns, int(ahead.max()))

    def warn(self, *, is_last: bool = False) -> None:
        """Warn at once, each time there are ten times as many, and at the end."""
        enough = self._warned + 1 if is_last else max(1, WARN_AGAIN * self._warned)
        if self._count < enough:
            return
        self._warned = self._count
        until = format_local(self._latest_ns, self._timezone)
        events = counted(self._count, "event")
        verb = "happens" if self._count == 1 else "happen"
        counts = "it counts" if self._count == 1 else "they count"
        text = (
            f"{events} {verb} in the future, at {until} at the latest; {counts} from the time of "
            "recording on. Check date, zone and clock; `retract` takes back what is wrong."
        )
        warnings.warn(errors.FutureTimesWarning(text), stacklevel=frames_of_ours())


def _times_of(event: Event | EventBatch) -> NDArray[np.int64]:
    """Return when events happen that say it."""
    if isinstance(event, EventBatch):
        return np.asarray(event.happened_ns)
    return np.array([] if event.happened_ns is None else [event.happened_ns], np.int64)
