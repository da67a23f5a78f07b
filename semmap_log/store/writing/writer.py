"""The log being written: one writer, one commit at a time, each with a promise of how it lasts.

The writer's keyframes come from a source that returns their bytes; it does not know their content.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.io.clock import Clock, SystemClock, believable_ns
from semmap_log.core.model.commits import NO_CONTENT, Commit, Durability, Note
from semmap_log.core.model.events import Event
from semmap_log.errors import CommandError, LogError, LogPoisonedError
from semmap_log.store.byte_layout import NO_HASH
from semmap_log.store.chunks import BuiltChunk
from semmap_log.store.command_index import COMMAND_ID_BYTES
from semmap_log.store.commit_records import CommitBuilder, Entropy, Stamp
from semmap_log.store.compaction.background import KeepUp
from semmap_log.store.folder import LogFolder
from semmap_log.store.gone_commands import StoredCommand
from semmap_log.store.header import SegmentHeader
from semmap_log.store.lock import WriterLock
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.writing import durability
from semmap_log.store.writing.keyframe_source import KeyframeSource, keyframe_chunk
from semmap_log.store.writing.segment_chain import CommandMemory, LogEnd, SegmentChain


@dataclass(frozen=True)
class Environment:
    """What a writer takes from the machine, and what it promises; tests give their own."""

    policy: durability.DurabilityPolicy = field(default_factory=durability.DurabilityPolicy)
    clock: Clock = field(default_factory=SystemClock)
    entropy: Entropy = os.urandom
    compacts: bool = True
    """Whether full segments are put into large compressed chunks in the background."""
    keep_up: KeepUp | None = None
    """Called in the background after each of them."""


class Written(NamedTuple):
    """How far a writer has come."""

    next_event: int
    head: bytes
    """Hash of the last commit."""
    commits: int
    """That this writer has appended."""


class LogWriter:
    """Appends commits: one thread at a time; `make_durable` may be called by any, meanwhile."""

    def __init__(
        self,
        folder: LogFolder,
        lock: WriterLock,
        environment: Environment,
    ) -> None:
        self.folder = folder
        self.clock = environment.clock
        self.entropy = environment.entropy
        self.policy = policy = environment.policy
        self.next_event = 0
        self.last_ns: int
        """Given when the log is begun, or taken up."""
        self._last_hash = NO_HASH
        self.written = Written(self.next_event, NO_HASH, 0)
        """How far it has come; one value, for other threads."""
        self._lock = lock
        self._commands = CommandMemory(folder, lambda: self._chain.live, self.flush)
        self._chain = SegmentChain(
            folder,
            self._commands.closed,
            compacts=environment.compacts,
            keep_up=environment.keep_up,
        )
        self._keyframes: KeyframeSource
        """Given when the log is begun, or taken up."""
        self._syncs = durability.SharedSync()
        self._timer = durability.BatchTimer(self.sync, policy.batch_s)
        self._holds_back = policy.level is Durability.NONE
        self._poison = ""
        """Why nothing more may be written; empty as long as every write and sync went well."""
        self._in_commit = False
        """From the first byte until all counters are right: what stays so was interrupted."""
        self._busy = False
        self._open = True
        self._pid = os.getpid()

    def begin(self, header: SegmentHeader, keyframes: KeyframeSource) -> None:
        """Start a log: its first segment."""
        self._keyframes = keyframes
        self.last_ns = max(believable_ns(self.clock), 1)
        self._chain.begin(header, self._keyframe(self.last_ns))

    def proceed(self, reader: LogReader, keyframes: KeyframeSource) -> None:
        """Take up a log where it ends."""
        self._keyframes = keyframes
        commit = reader.last_commit()
        self.last_ns = reader.last_log_time_ns()
        if commit:
            self.next_event, self._last_hash = commit.last_event + 1, commit.hash
            self.written = Written(self.next_event, commit.hash, 0)
        self._syncs.durable_before = self.next_event  # closed, or about to be copied and synced
        self._chain.take_up(reader, self._end)

    @property
    def is_fresh(self) -> bool:
        """Whether nothing was ever appended, so that `begin_at` can be called."""
        return not self.next_event and self._chain.is_single

    def begin_at(self, recorded_ns: int) -> None:
        """Let a log without events begin at that moment, however early: it is about to be filled.

        Raises:
            LogError: It is not `is_fresh`; recorded time only grows.
            LogPoisonedError: It could not be written.
        """
        self.check_usable()
        if not self.is_fresh:
            raise LogError(
                f"{self.folder.path}: expected a log without events, got one with events."
            )
        self._in_commit = True  # an interrupt leaves the one segment or the other
        try:
            with self._syncs.lock:  # nobody may be syncing the file that is replaced here
                self.last_ns = recorded_ns
                self._chain.start_over(self._keyframe(recorded_ns))
        except OSError as error:
            raise self._poisoned(error.strerror) from error
        self._in_commit = False

    def begin_segment(self, recorded_ns: int) -> None:
        """Close the live segment, and begin another with a keyframe of that moment.

        Args:
            recorded_ns: When; a later one if something was recorded since.

        Raises:
            LogPoisonedError: It could not be written.
        """
        self.check_usable()
        self._in_commit = True  # an interrupt leaves neither
        try:
            with self._syncs.lock:  # nobody may be syncing the file that is closed here
                self._begin_next(recorded_ns)
        except OSError as error:
            raise self._poisoned(error.strerror) from error
        self._in_commit = False

    def _begin_next(self, recorded_ns: int) -> None:
        self._chain.roll(self._end)
        self.last_ns = max(recorded_ns, self.last_ns + 1)
        keyframe = self._keyframe(self.last_ns)
        self._chain.begin_next(self.next_event, self._last_hash, keyframe)
        self._syncs.durable_before = self.next_event

    @property
    def _end(self) -> LogEnd:
        return LogEnd(self.next_event, self._last_hash)

    @property
    def begins_segment(self) -> bool:
        """Whether the next commit is the first after a keyframe that may be in no segment yet."""
        return self._chain.begins_segment(self.next_event)

    @property
    def durable_before(self) -> int:
        """Events below this number survive a power cut."""
        return self._syncs.durable_before

    def append(
        self,
        events: Iterable[Event | EventBatch],
        *,
        note: Note = Note(),
        command_id: bytes | None = None,
        content: bytes = NO_CONTENT,
        clock: Clock | None = None,
    ) -> Commit:
        """Append events as one commit: all of them or none. `make_durable` makes it last.

        Args:
            events: At least one; read once, in memory of about one chunk. Of batches number and
                recorded time do not count; their values are not checked here.
            note: Who, with what, why.
            command_id: 16 bytes; default: drawn at random. `find` says whether it is known.
            content: Digest of what the command asks for.
            clock: What says when it is recorded; default: the log's own. Recorded time only grows.

        Raises:
            LogPoisonedError: A write failed, now or earlier: the outcome is unknown until the
                log is opened again.
        """
        self.check_usable()
        if command_id is None:
            command_id = self.entropy(COMMAND_ID_BYTES)
        elif len(command_id) != COMMAND_ID_BYTES:
            raise CommandError(f"a command id has {COMMAND_ID_BYTES} bytes, got {len(command_id)}.")
        self._busy = True
        try:
            return self._append(events, note, command_id, content, clock or self.clock)
        except OSError as error:
            if not self._in_commit:
                raise  # the events could not be read: nothing was written
            raise self._poisoned(error.strerror, command_id) from error
        finally:
            self._busy = False

    def _append(
        self,
        events: Iterable[Event | EventBatch],
        note: Note,
        command_id: bytes,
        content: bytes,
        clock: Clock,
    ) -> Commit:
        wall_ns = believable_ns(clock)
        self._make_ready(wall_ns, keeps_time=clock is not self.clock)
        segment = self._chain.live
        assert segment is not None
        stamp = Stamp(
            self.next_event,
            max(wall_ns, self.last_ns + 1),
            self._last_hash,
            command_id,
            wall_ns,
            clock.monotonic_ns(),
            clock.boot_id,
            self.policy.level,
            self._syncs.durable_before,
            content,
        )
        self._write_keyframe(segment, self.last_ns, is_commit_begun=False)
        builder = CommitBuilder(stamp, note, self.entropy)
        last_ns = None
        for chunk in builder.chunks(events):
            if last_ns is not None:
                self._write_keyframe(segment, last_ns, is_commit_begun=True)
            last_ns = chunk.facts.times[1]
            self._in_commit = True
            segment.add(chunk, levels=builder.levels, hold_back=self._holds_back)
            self._keyframes.add(chunk)
        commit = builder.commit
        self.next_event, self.last_ns = commit.last_event + 1, commit.closed_ns
        self._last_hash = commit.hash
        self.written = Written(self.next_event, commit.hash, self.written.commits + 1)
        self._commands.add(commit)
        self._in_commit = False
        return commit

    def _write_keyframe(
        self, segment: SegmentWriter, log_time_ns: int, *, is_commit_begun: bool
    ) -> None:
        """Write a keyframe if there has been none for long; the next sync is its, too."""
        if self._keyframes.wants_keyframe(is_commit_begun=is_commit_begun):
            self._in_commit = True
            segment.add(self._keyframe(log_time_ns), hold_back=self._holds_back)
            self._in_commit = is_commit_begun

    def _keyframe(self, log_time_ns: int) -> BuiltChunk:
        return keyframe_chunk(self._keyframes.keyframe(), log_time_ns)

    def apply_policy(self, before: int) -> None:
        """Return once events below that number last as was promised; others may append meanwhile.

        Raises:
            LogPoisonedError: The sync failed; it is not tried again.
        """
        level = self.policy.level
        if level is Durability.EVENT:
            self.make_durable(before)
        elif level is Durability.BATCH:
            if before - self._syncs.durable_before >= self.policy.batch_events:
                self.make_durable(before)
            elif before > self._syncs.durable_before:
                self._timer.start()

    def sync(self) -> None:
        """Return once every commit so far survives a power cut.

        Raises:
            LogPoisonedError: A write or sync failed, now or earlier; none is tried again.
        """
        if self._poison:
            raise LogPoisonedError(self._poison)
        self.make_durable(self.next_event)

    def make_durable(self, before: int) -> None:
        """Return once events below that number survive a power cut; threads share the syncs.

        Raises:
            LogPoisonedError: A sync failed, now or earlier; none is tried again.
        """
        self._syncs.make_durable(before, self._sync)

    def _sync(self) -> int:
        """Sync what was written so far, and return the event number before which that is."""
        if self._poison:
            raise LogPoisonedError(self._poison)
        self._check_process()
        written, segment = self.next_event, self._chain.live
        if segment is None:  # what is closed is synced; what was interrupted between two is not
            raise self._poisoned("interrupted between two segments")
        try:
            segment.sync()
        except OSError as error:
            raise self._poisoned(error.strerror) from error
        return written

    def flush(self) -> None:
        """Hand to the kernel what is held back, so that readers see it.

        Raises:
            LogPoisonedError: It could not be written.
        """
        if self._holds_back and self._chain.live is not None:
            try:
                self._chain.live.flush()
            except OSError as error:
                raise self._poisoned(error.strerror) from error

    def find(self, command_id: bytes) -> StoredCommand | None:
        """Return the commit of a command, if it is stored, however long ago.

        Args:
            command_id: 16 bytes.

        Raises:
            CorruptLogError: A segment in which it may be is damaged.
        """
        return self._commands.find(command_id)

    def close(self) -> None:
        """Close the live segment, so that every tool reads it, and let the next writer in."""
        if not self._open:
            return
        self._open = False
        try:
            self._timer.close()
            if os.getpid() == self._pid:
                try:
                    self._close_or_abandon()
                finally:  # who takes the lock next must not meet a thread at work
                    self._chain.rest(wait=not self._poison)
        except OSError as error:
            self._poisoned(error.strerror)
            raise LogPoisonedError(
                f"{self.folder.path}: the segment could not be closed: {error.strerror}. "
                "Its commits are whole; the next opening closes it."
            ) from error
        finally:
            self._lock.release()

    def _close_or_abandon(self) -> None:
        with self._syncs.lock:
            if self._poison or self._in_commit or self._syncs.is_broken:
                self._chain.abandon()
            else:
                self._chain.close_live(self._end)
                self._syncs.durable_before = self.next_event

    def check_usable(self) -> None:
        """Check that this writer can append.

        Raises:
            LogPoisonedError: A write failed or was interrupted.
            LogError: It was closed, was opened by another process, or is appending already.
        """
        if self._busy:
            raise LogError(
                f"{self.folder.path}: an append is under way; what it reads cannot append."
            )
        if self._in_commit:
            self._poisoned("interrupted in the middle of a commit")
        if self._syncs.is_broken:
            self._poison = self._poison or f"{self.folder.path}: {durability.SYNC_FAILED}"
        if self._poison:
            raise LogPoisonedError(self._poison)
        if not self._open:
            raise LogError(f"{self.folder.path}: this log was closed; open it again to append.")
        self._check_process()

    def _check_process(self) -> None:
        if os.getpid() != self._pid:
            raise LogError(
                f"{self.folder.path}: opened by process {self._pid}; a forked child cannot append."
            )

    def _poisoned(self, why: object, command_id: bytes = b"") -> LogPoisonedError:
        """Refuse all that follows, and return the error that says so."""
        self._poison = (
            f"{self.folder.path}: a write failed ({why}); whether its events are stored is "
            "unknown. Open the log again: it keeps every commit that is whole."
        )
        return LogPoisonedError(self._poison, command_id)

    def _make_ready(self, wall_ns: int, *, keeps_time: bool) -> None:
        """See to a live segment that has room: the one there is, or a continued, or a new one.

        A new one begins with a keyframe, which needs a nanosecond of its own. Where times are kept
        and there is none between two commits, it begins with a later one.
        """
        chain = self._chain
        if chain.live is not None:
            has_time = not keeps_time or wall_ns - self.last_ns > 1
            if not (has_time and chain.is_full(max(wall_ns, self.last_ns))):
                return
        self._in_commit = True  # an interrupt between two segments leaves neither
        with self._syncs.lock:  # nobody may be syncing the file that is closed here
            if chain.live is None:
                chain.continue_last(self._end)
            if chain.live is None or chain.is_full(max(wall_ns, self.last_ns)):
                self._begin_next(wall_ns - 1)  # the commit's time stays free
            self._syncs.durable_before = self.next_event
        self._in_commit = False
