"""A log that takes events: one commit at a time, each checked against the map as it stands."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from inspect import currentframe
from itertools import chain
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeAlias

from semmap_log.batches.event_batch import EventBatch, one_by_one
from semmap_log.domain.commits import NO_CONTENT, Commit, Note
from semmap_log.domain.doors import DoorId, DoorMap
from semmap_log.domain.events import Event, RobotPose, is_whole_number
from semmap_log.domain.keywords import knows_its_keywords
from semmap_log.domain.moments import format_local
from semmap_log.door_log.backdating import remedy
from semmap_log.door_log.command_content import are_same
from semmap_log.door_log.commands import Gatekeeper, Roster, resolve_door
from semmap_log.door_log.door_labels import labels_ever
from semmap_log.door_log.door_log import DoorLog
from semmap_log.door_log.removed_doors import removed_called, several_removed
from semmap_log.errors import (
    CommandReusedError,
    EarlyEventsWarning,
    InvalidEventError,
    LogPoisonedError,
    UnexpectedEventError,
    UnknownDoorError,
)
from semmap_log.folds.door_map import DoorMapState
from semmap_log.folds.early_events import EarlyEvents
from semmap_log.io.clock import Clock, KeptClock, believable_ns
from semmap_log.replay.written_state import WrittenState
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing.durability import DurabilityPolicy
from semmap_log.store.writing.writer_opening import OpenedLog

if TYPE_CHECKING:
    from typing_extensions import Self

Events: TypeAlias = "Iterable[Event | EventBatch] | EventBatch"
"""What can be appended: events, and batches of them, in any order."""

TOLD_AGAIN = 10
"""What no answer counts is told at once, and again when it has become so many times as much."""

POSES_WAIT_S = 1.0
"""Robot poses join the next commit; without one, they are written after this time."""


@dataclass(frozen=True, slots=True)
class Appended:
    """What became of an append."""

    commit: Commit
    poses: int = 0
    """How many robot poses, which had waited, stand before its own events in the commit."""
    repeated: bool = False
    """The command was stored before; nothing was written now."""
    _make_durable: Callable[[int], None] | None = field(default=None, repr=False, compare=False)

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


@knows_its_keywords
class AppendableLog(DoorLog):
    """A log that is written; answers questions, too. May be used by several threads."""

    def __init__(self, opened: OpenedLog[WrittenState]) -> None:
        super().__init__(opened.reader)
        self._writer = writer = opened.writer
        self._written = opened.keyframes
        self._mutex = threading.RLock()
        self._poses: list[RobotPose] = []
        self._pose_timer: threading.Timer | None = None
        self._is_stale = False
        self._early = EarlyEvents.none()
        """What was appended and had happened before its door was added."""
        self._early_told = 0
        self._roster: Roster | None = None
        self._named: DoorMap | None = None
        """A map as of some moment since which no name has changed."""
        self._taken_in = writer.next_event
        """Events below this number are taken into account in all of these."""

    @property
    def reader(self) -> LogReader:
        """The bytes underneath, with all that was written so far."""
        with self._mutex:
            self._take_in()
            if self._is_stale:
                self._writer.flush()
                self.refresh()
                self._is_stale = False
            return self._reader

    @property
    def state(self) -> DoorMapState:
        """The door map after the last commit, as the writer holds it."""
        with self._mutex:
            return self._written.get()

    def door_map(self) -> DoorMap:
        """Return the doors after the last commit as values, whatever is appended meanwhile."""
        with self._mutex:
            return self._written.get().door_map()

    @property
    def roster(self) -> Roster:
        """Which doors and levels there are after the last commit."""
        with self._mutex:
            self._take_in()
            if self._roster is None:
                self._roster = Roster.of(self._written.get())
                self._roster.log = self.path
                # Not of this log: what holds itself is let go of late.
                self._roster.names = partial(_names_now, self._written)
            return self._roster

    @property
    def policy(self) -> DurabilityPolicy:
        """What is promised of an append when it returns."""
        return self._writer.policy

    @property
    def durable_before(self) -> int:
        """Events below this number survive a power cut."""
        return self._writer.durable_before

    def end_ns(self) -> int:
        """Return the log's end: the latest happened time in it; 0 for a log without events."""
        return self.state.latest_happened_ns

    def now_ns(self) -> int:
        """Return what the log's clock says: nanoseconds since 1970, UTC."""
        return believable_ns(self._writer.clock)

    def append(
        self,
        events: Events,
        *,
        note: Note = Note(),
        command_id: bytes | None = None,
        content: bytes = NO_CONTENT,
        expected_event: int | None = None,
        sync: bool | None = None,
    ) -> Appended:
        """Append events as one commit, all or none; waiting robot poses go before them.

        Args:
            events: At least one: events, batches of them as columns, or a batch. Of many, give a
                generator of batches: they are written as they come, in memory of about one chunk.
            note: Who, with what, why.
            command_id: 16 bytes; a command that is stored already is not stored again.
            content: Digest of what the command asks for (`content_of`), if the same command may
                come with other events; default: the events themselves are compared.
            expected_event: The number of the log's last event (-1: none), as the caller knows it.
            sync: Whether to return only when it survives a power cut; default: as the log's
                durability says.

        Raises:
            InvalidEventError: A batch holds a value that no event can have; as for:
            CommandError: The map forbids an event; nothing is stored.
            CommandReusedError: The command is stored already, with other events.
            UnexpectedEventError: The log went on since.
            LogPoisonedError: A write failed; the outcome is unknown until the log is reopened.
        """
        compares = command_id is not None and content == NO_CONTENT
        given = [events] if isinstance(events, EventBatch) else events
        if compares and not isinstance(given, list):
            given = list(given)

        def is_stored(commit: Commit) -> bool:
            if not compares:
                return commit.content == content
            wanted = list(one_by_one(given))
            stored = self._stored(commit)[-len(wanted) :]
            return note == commit.note and are_same(wanted, stored)

        def expected() -> Iterable[Event | EventBatch]:
            self._check_last_event("the log", expected_event, self._writer.next_event - 1)
            return given

        return self._append_once(expected, note, command_id, content, is_stored, sync=sync)

    def append_made(
        self,
        make: Callable[[], list[Event]],
        *,
        note: Note = Note(),
        command_id: bytes | None = None,
        content: bytes = NO_CONTENT,
    ) -> Appended | None:
        """Append what `make` gives, as one commit; nobody appends between its look and that.

        Args:
            make: Asks this log what it wants, and gives the events, or none where what it finds
                needs no change; not called for a command that is stored already.
            note: Who, with what, why.
            command_id: 16 bytes; a command that is stored already is not stored again.
            content: Digest of what the command asks for.

        Returns:
            None where there was nothing to append; what `make` looked at is durable, as promised.

        Raises:
            CommandError: The map forbids an event; nothing is stored.
            CommandReusedError: The command is stored already, with other content.
            LogPoisonedError: A write failed; the outcome is unknown until the log is reopened.
        """
        with self._mutex:
            appended = self._repeated(command_id, lambda stored: stored.content == content)
            if appended is None:
                self._writer.check_usable()  # before `make` does anything
                looked_at = self._writer.next_event
                events = make()
                if events:
                    appended = self._append_now(lambda: events, note, command_id, content)
        if appended is None:
            self._writer.apply_policy(looked_at)
        else:
            self._make_last(appended.commit, sync=None)
            self._warn_of_early()
        return appended

    def sync(self) -> None:
        """Return once every commit so far survives a power cut."""
        self._writer.sync()

    def take_over(
        self,
        make: Callable[[int], Iterable[Event | EventBatch]],
        *,
        note: Note,
        command_id: bytes,
        content: bytes,
        are_facts: bool = True,
        recorded_ns: int | None = None,
    ) -> Commit:
        """Append a commit of another log as it was there; `sync` makes it last.

        Args:
            make: Gives the events; is told the number that the first of them gets.
            note: Who, with what, why.
            command_id: 16 bytes; who calls has seen that it is not stored.
            content: Digest of what the command asked for.
            are_facts: The other log took them: only what this log could not hold is refused.
            recorded_ns: When the other log recorded it; None: it is recorded now. Later than the
                log's end, or the log ends there.

        Raises:
            CommandError: The map forbids an event; nothing of the commit is stored.
            LogPoisonedError: A write failed; the outcome is unknown until the log is reopened.
        """
        clock = None if recorded_ns is None else KeptClock(recorded_ns)
        with self._mutex:
            self._write_poses()
            first = self._writer.next_event
            return self._append_now(
                lambda: make(first), note, command_id, content, clock, are_facts=are_facts
            ).commit

    def begin_at(self, recorded_ns: int) -> bool:
        """Let a log without events begin at that moment, so that it can take over another's times.

        Returns:
            False: it has events, or had; nothing was done.

        Raises:
            LogPoisonedError: It could not be written.
        """
        with self._mutex:
            self._write_poses()
            if not self._writer.is_fresh:
                return False
            self._writer.begin_at(recorded_ns)
            self._is_stale = True
            return True

    def find_command(self, command_id: bytes) -> Commit | None:
        """Return the commit that a command became, if it is stored, however long ago.

        Args:
            command_id: 16 bytes.

        Raises:
            CorruptLogError: A segment in which it may be is damaged.
        """
        with self._mutex:
            return self._writer.find(command_id)

    def robot_pose(self, pose: RobotPose) -> None:
        """Keep a pose for the next commit; if none comes within a second, it gets its own.

        Raises:
            UnknownLevelError: It tells no level, and the log has several.
        """
        with self._mutex:
            self._writer.check_usable()
            self._take_in()
            if pose.happened_ns is None:
                pose = replace(pose, happened_ns=self.now_ns())
            pose = replace(pose, level=self.level_meant(pose.level))
            self._poses.append(pose)
            if self._pose_timer is None:
                self._pose_timer = threading.Timer(POSES_WAIT_S, self._write_poses_late)
                self._pose_timer.daemon = True
                self._pose_timer.start()

    def resolve(self, door: str | int) -> DoorId:
        """Return the door of that id, name, or level/name, as of now."""
        return self._resolve(door)

    def _resolve(self, door: str | int) -> DoorId:
        if not isinstance(door, str) and is_whole_number(door):
            return DoorId(int(door))  # whether it is there, the gatekeeper says
        with self._mutex:
            self._take_in()
            if self._named is None:
                self._named = self._written.get().door_map()
            try:
                return resolve_door(door, self._named)
            except UnknownDoorError:
                removed = removed_called(door, self._written.get())
                if len(removed) > 1:
                    raise UnknownDoorError(several_removed(door, removed)) from None
                if removed:
                    return removed[0]  # that it was removed, the gatekeeper says
                raise

    def level_meant(self, level: int | str | None) -> int:
        """Return the level that a caller means, as of now: as `Roster.level_meant`."""
        with self._mutex:
            return self.roster.level_meant(level)

    def level_of(self, door: DoorId) -> int:
        """Return the level that a door is on; 0 for one that is not there."""
        known = self.state.door_map().doors.get(door)
        return known.level if known else 0

    def close(self) -> None:
        """Write what waits, close the segment so that every tool reads it, let the lock go."""
        with self._mutex:
            try:
                self._write_poses()
            finally:
                self._poses = []
                self._writer.close()
                self._is_stale = True
        self._warn_of_early(is_last=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _append_once(
        self,
        make: Callable[[], Iterable[Event | EventBatch]],
        note: Note,
        command_id: bytes | None,
        content: bytes,
        is_stored: Callable[[Commit], bool],
        *,
        sync: bool | None = None,
    ) -> Appended:
        """Append the events that `make` gives, unless their command is stored already.

        What is asked of the map to make them is asked only then: a command that is sent again may
        speak of a door that it has removed itself.
        """
        with self._mutex:
            appended = self._repeated(command_id, is_stored)
            if appended is None:
                appended = self._append_now(make, note, command_id, content)
        self._make_last(appended.commit, sync=sync)  # other threads may append meanwhile
        self._warn_of_early()
        return appended

    def _repeated(
        self, command_id: bytes | None, is_stored: Callable[[Commit], bool]
    ) -> Appended | None:
        """Return the answer to a command that is stored already; None: it is not.

        Raises:
            CommandReusedError: It is, with other content.
        """
        if command_id is not None and not isinstance(command_id, bytes):
            raise InvalidEventError("command_id", "16 bytes", command_id)
        known = None if command_id is None else self._writer.find(command_id)
        if known is None:
            return None
        if not is_stored(known):
            raise CommandReusedError(
                f"command {known.command_id.hex()} is stored already, as event "
                f"{known.first_event}, and was another; a new command wants a new id."
            )
        stored = self._stored(known)
        poses = next((i for i, e in enumerate(stored) if not isinstance(e, RobotPose)), 0)
        return Appended(known, poses, repeated=True, _make_durable=self._writer.make_durable)

    def _append_now(
        self,
        make: Callable[[], Iterable[Event | EventBatch]],
        note: Note,
        command_id: bytes | None,
        content: bytes,
        clock: Clock | None = None,
        *,
        are_facts: bool = False,
    ) -> Appended:
        self._take_in()
        poses = self._poses
        now_ns = self.now_ns if clock is None else clock.wall_ns
        first = self._writer.next_event + len(poses)
        gatekeeper = Gatekeeper(self.roster, first, now_ns, are_facts=are_facts)
        try:
            events = make()
            if isinstance(events, (list, tuple)):
                events = [*poses, *gatekeeper.check_all(events)]
            else:
                events = chain(poses, gatekeeper.checked(events))
            commit = self._writer.append(
                events,
                note=note,
                command_id=command_id,
                content=content,
                clock=clock,
            )
        finally:
            self._is_stale = True
        self._poses = []
        gatekeeper.settle(commit)
        if not gatekeeper.keeps_names:
            self._named = None
        self._roster = gatekeeper.roster if gatekeeper.is_roster_sure else None
        if gatekeeper.has_retraction:  # it may have moved addings
            self._early, self._early_told = EarlyEvents.none(), 0
        if gatekeeper.early is not None:
            self._early.add_all(gatekeeper.early)
        self._taken_in = commit.last_event + 1
        return Appended(commit, len(poses), _make_durable=self._writer.make_durable)

    def _warn_of_early(self, *, is_last: bool = False) -> None:
        """Tell of what no answer counts: at once, when it is ten times as much, and at the end."""
        if not self._early.counts:
            return
        count = len(self._early)
        enough = self._early_told + 1 if is_last else TOLD_AGAIN * self._early_told
        if count < enough:
            return
        self._early_told = count
        since = format_local(min(self._early.first_ns.values()), self.info.timezone)
        said = self._early.in_words(labels_ever(self._written.get()), since)
        text = f"{said}; {remedy(self.path)}"
        warnings.warn(EarlyEventsWarning(text), stacklevel=_frames_of_ours())

    def _take_in(self) -> None:
        """Forget what does not fit any more: an interrupt came right behind a commit."""
        if self._taken_in != self._writer.next_event:
            self._poses, self._roster, self._named, self._is_stale = [], None, None, True
            self._taken_in = self._writer.next_event

    def _make_last(self, commit: Commit, *, sync: bool | None) -> None:
        """Return once a commit lasts: as was asked, or as the log's durability promises."""
        before = commit.last_event + 1
        try:
            if sync is None:
                self._writer.apply_policy(before)
            elif sync:
                self._writer.make_durable(before)
        except LogPoisonedError as error:
            error.command_id = error.command_id or commit.command_id
            raise

    def _stored(self, commit: Commit) -> list[Event]:
        """Return the events of a commit."""
        numbers = range(commit.first_event, commit.last_event + 1)
        return [self.event(number).event for number in numbers]

    def _check_last_event(self, of: str, expected: int | None, actual: int) -> None:
        """Return if the last event is the one that a caller expects, or it expects none.

        Raises:
            UnexpectedEventError: It is another.
            InvalidEventError: That is no number.
        """
        if expected is not None and not is_whole_number(expected):
            raise InvalidEventError("expected_event", "the number of an event, or -1", expected)
        if expected is not None and expected != actual:
            raise UnexpectedEventError(of, expected, actual)

    def _write_poses_late(self) -> None:
        """Write poses for which no commit came; called by the timer's thread."""
        with suppress(LogPoisonedError):  # whoever appends next is told
            self._write_poses()

    def _write_poses(self) -> None:
        with self._mutex:
            if self._pose_timer is not None:
                self._pose_timer.cancel()
                self._pose_timer = None
            self._take_in()
            if self._poses:
                commit = self._writer.append(self._poses)
                self._poses = []
                self._taken_in = commit.last_event + 1
                self._is_stale = True
                self._make_last(commit, sync=None)


def _names_now(written: WrittenState) -> Mapping[DoorId, str]:
    return written.get().names()


def _frames_of_ours() -> int:
    """Return how many calls of this package, this one included, its user stands behind."""
    frame = currentframe()
    count = 0
    while frame is not None and str(frame.f_globals.get("__name__")).startswith("semmap_log."):
        frame, count = frame.f_back, count + 1
    return count
