"""The log being written: one writer, one commit at a time, durable before `append` returns."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path

from semmap_log.commits import Commit, Note
from semmap_log.errors import (
    CommandError,
    LogAccessError,
    LogError,
    LogExistsError,
    LogPoisonedError,
)
from semmap_log.events import Event, Retracted
from semmap_log.log import keyframes
from semmap_log.log.bag_metadata import ClosedSegment, statistics_of, write_bag_metadata
from semmap_log.log.chunks import BuiltChunk
from semmap_log.log.clock import Clock, SystemClock
from semmap_log.log.commits import NO_HASH, CommitBuilder, Stamp
from semmap_log.log.disk import is_empty, remove_leftovers, sync_folder
from semmap_log.log.form import (
    CHUNK_BYTES,
    COMMIT_CHANNEL,
    CONTINUE_BELOW_BYTES,
    ROLL_AGE_NS,
    ROLL_BYTES,
    ROLL_COMMITS,
    segment_name,
)
from semmap_log.log.header import LogInfo, SegmentHeader
from semmap_log.log.lock import WriterLock
from semmap_log.log.pages import Page
from semmap_log.log.reader import LogReader, check_is_log
from semmap_log.log.recovery import reopened
from semmap_log.log.scan import Segment
from semmap_log.log.segment import SegmentWriter
from semmap_log.projections.door_map import DoorMapState
from semmap_log.projections.retraction import Retractions

Entropy = Callable[[int], bytes]
"""Like os.urandom: n bytes for ids and salts; seeded where bytes must repeat."""

REMEMBERED_COMMANDS = 10_000
COMMAND_ID_BYTES = 16


def create_log(
    folder: Path, info: LogInfo, *, clock: Clock | None = None, entropy: Entropy = os.urandom
) -> LogWriter:
    """Make a new log in a folder that does not exist, or is empty, and open it.

    Raises:
        LogExistsError: Something is there already.
        LogAccessError: The folder cannot be made.
    """
    try:
        if folder.exists() and not is_empty(folder):
            raise LogExistsError(
                f"{folder}: there is something here already; "
                "a new log wants a new or an empty folder."
            )
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LogAccessError(f"{folder}: no log can be made here: {error.strerror}.") from error
    lock = WriterLock(folder)
    try:
        remove_leftovers(folder)
        header = SegmentHeader(info, number=0, first_event=0, hash_so_far=NO_HASH)
        writer = LogWriter(folder, lock, DoorMapState(), clock or SystemClock(), entropy)
        writer.begin(header, last_ns=0)
        sync_folder(folder.parent)
    except OSError as error:
        lock.release()
        raise LogAccessError(f"{folder}: no log can be made here: {error.strerror}.") from error
    except BaseException:
        lock.release()
        raise
    return writer


def open_for_append(
    folder: Path, *, clock: Clock | None = None, entropy: Entropy = os.urandom
) -> LogWriter:
    """Open a log for writing; a last segment that a crash left torn is made whole first.

    Raises:
        NotALogError: There is none.
        LogLockedError: Somebody else is writing.
        LogAccessError: The file system does not let us.
        CorruptLogError: Commits that were acknowledged are damaged.
    """
    check_is_log(folder)  # before a lock file is put into somebody else's folder
    lock = WriterLock(folder)
    try:
        remove_leftovers(folder)
        reader = LogReader(folder)
        writer = LogWriter(folder, lock, _state(reader), clock or SystemClock(), entropy)
        writer.go_on(reader)
    except OSError as error:
        lock.release()
        if isinstance(error, LogAccessError):
            raise
        raise LogAccessError(f"{folder}: cannot be opened: {error.strerror}.") from error
    except BaseException:
        lock.release()
        raise
    return writer


def _state(reader: LogReader) -> DoorMapState:
    """Return the state at the log's end: from the last keyframe, unless a retraction touches it."""
    last = len(reader.segments) - 1
    state = reader.keyframe(reader.segments[last])
    retractions = Retractions()
    for batch in reader.batches(first_segment=last):
        retractions.apply(batch)
    if state is None or (retractions and retractions.first_event <= state.event):
        last, state, retractions = 0, DoorMapState(), reader.retractions()
    for batch in reader.batches(first_segment=last):
        state.note_used_ids(batch)
        state.apply(retractions.visible(batch))
    return state


class LogWriter:
    """Appends commits. Not for use by several threads at once."""

    def __init__(
        self, folder: Path, lock: WriterLock, state: DoorMapState, clock: Clock, entropy: Entropy
    ) -> None:
        self.folder = folder
        self.clock = clock
        self.entropy = entropy
        self.next_event = 0
        self.last_ns = 0
        self._lock = lock
        self._state = state
        self._unfolded: list[bytes] = []
        self._unfolded_size = 0
        self._refold = False
        self._last_hash = NO_HASH
        self._durable_before = 0
        """Events below this number survive a power cut."""
        self._segment: SegmentWriter | None = None
        self._header: SegmentHeader
        self._continue: Segment | None = None
        self._closed_segments: list[ClosedSegment] = []
        self._poison = ""
        self._busy = False
        self._open = True
        self._pid = os.getpid()
        self._commands: dict[bytes, Commit] | None = None

    def begin(self, header: SegmentHeader, *, last_ns: int) -> None:
        """Start a segment: head, keyframe, its name on disk."""
        self.last_ns = max(self.clock.wall_ns(), last_ns + 1)
        segment = SegmentWriter(self.folder / segment_name(self.folder, header.number), header)
        try:
            segment.add(keyframes.keyframe_chunk(self.state, self.last_ns))
            segment.install()
        except BaseException:
            segment.abandon()
            raise
        self._header, self._segment, self._continue = header, segment, None
        self.next_event, self._last_hash = header.first_event, header.hash_so_far
        self._durable_before = self.next_event

    def go_on(self, reader: LogReader) -> None:
        """Take up a log where it ends; a live segment is repaired now, a closed one when needed."""
        last = reader.segments[-1]
        commit = reader.last_commit()
        self._header, self._continue = last.header, last
        self.last_ns = reader.last_log_time_ns()
        if commit:
            self.next_event, self._last_hash = commit.last_event + 1, commit.hash
        self._durable_before = self.next_event  # what is closed was synced; a copy will be
        self._closed_segments = [
            statistics_of(segment.path, segment.file) for segment in reader.segments[:-1]
        ]
        if not last.closed:
            self._take_up(last)

    @property
    def state(self) -> DoorMapState:
        """The door map after the last commit."""
        self._fold()
        if self._refold:
            self._state, self._refold = _state(LogReader(self.folder)), False
        return self._state

    def append(
        self,
        events: Iterable[Event],
        *,
        note: Note = Note(),
        command_id: bytes | None = None,
        sync: bool = True,
    ) -> Commit:
        """Append events as one commit: all of them or none.

        Args:
            events: At least one; read once, in memory of about one chunk.
            note: Who, with what, why.
            command_id: 16 bytes; default: drawn at random. `find` tells whether it is known.
            sync: Whether to return only when it survives a power cut; if not, `sync` does that.

        Raises:
            LogPoisonedError: A write failed, now or earlier: the outcome is unknown until the
                log is opened again.
        """
        self.check_usable()
        if command_id is not None and len(command_id) != COMMAND_ID_BYTES:
            raise CommandError(f"a command id has {COMMAND_ID_BYTES} bytes, got {len(command_id)}.")
        command_id = command_id or self.entropy(COMMAND_ID_BYTES)
        try:
            self._busy = True
            return self._append(events, note, command_id, sync=sync)
        finally:
            self._busy = False

    def _append(
        self, events: Iterable[Event], note: Note, command_id: bytes, *, sync: bool
    ) -> Commit:
        segment = self._ready_segment()
        wall_ns = self.clock.wall_ns()
        stamp = Stamp(
            first_event=self.next_event,
            recorded_ns=max(wall_ns, self.last_ns + 1),
            previous_hash=self._last_hash,
            command_id=command_id,
            wall_clock_ns=wall_ns,
            monotonic_clock_ns=self.clock.monotonic_ns(),
            boot_id=self.clock.boot_id,
            durable_before=self._durable_before,
        )
        builder = CommitBuilder(stamp, note, self.entropy(16))
        try:
            for chunk in builder.chunks(events):
                # From the first byte on until all counters are right, an interrupt at any point
                # must leave a writer that refuses to go on.
                self._poisoned("interrupted in the middle of a commit")
                segment.add(chunk, levels=builder.levels)
                self._remember(chunk)
            if sync:
                segment.sync()
        except OSError as error:
            self._poisoned(f"{error.strerror}")
            raise LogPoisonedError(self._poison) from error
        commit = builder.commit
        if sync:
            self._durable_before = commit.last_event + 1
        self.next_event, self.last_ns = commit.last_event + 1, commit.closed_ns
        self._last_hash = commit.hash
        if self._commands is not None:
            self._commands[commit.command_id] = commit
        self._poison = ""
        return commit

    def sync(self) -> None:
        """Return once every commit so far survives a power cut.

        Raises:
            LogPoisonedError: The sync failed; it is not tried again.
        """
        self.check_usable()
        if self._segment is not None:
            try:
                self._segment.sync()
                self._durable_before = self.next_event
            except OSError as error:
                self._poisoned(f"{error.strerror}")
                raise LogPoisonedError(self._poison) from error

    def find(self, command_id: bytes, *, everywhere: bool = False) -> Commit | None:
        """Return the commit of a command, if it is stored.

        Args:
            command_id: 16 bytes.
            everywhere: Search the whole log, not only the last 10,000 commits or so.
        """
        if self._commands is None:
            self._commands = _recent_commands(LogReader(self.folder))
        known = self._commands.get(command_id)
        if known or not everywhere:
            return known
        return next(
            (c for c in LogReader(self.folder).commits() if c.command_id == command_id), None
        )

    def close(self) -> None:
        """Close the live segment, so that every tool reads it, and let the next writer in."""
        if not self._open:
            return
        self._open = False
        try:
            if self._segment is not None and os.getpid() == self._pid:
                if self._poison:
                    self._segment.abandon()
                else:
                    self._close_segment()
        except OSError as error:
            self._poisoned(f"{error.strerror}")
            raise LogPoisonedError(
                f"{self.folder}: the segment could not be closed: {error.strerror}. "
                "Its commits are whole; the next opening closes it."
            ) from error
        finally:
            self._lock.release()

    def check_usable(self) -> None:
        """Return if this writer can append.

        Raises:
            LogPoisonedError: A write failed or was interrupted.
            LogError: It was closed, was opened by another process, or is appending already.
        """
        if self._busy:
            raise LogError(f"{self.folder}: an append is under way; what it reads cannot append.")
        if self._poison:
            raise LogPoisonedError(self._poison)
        if not self._open:
            raise LogError(f"{self.folder}: this log was closed; open it again to append.")
        if os.getpid() != self._pid:
            raise LogError(
                f"{self.folder}: opened by process {self._pid}; a forked child cannot append."
            )

    def _poisoned(self, why: str) -> None:
        self._poison = (
            f"{self.folder}: a write failed ({why}); whether its events are stored is unknown. "
            "Open the log again: it keeps every commit that is whole."
        )

    def _ready_segment(self) -> SegmentWriter:
        """Return a segment to write to: the live one, or the last continued, or a new one."""
        if self._segment is not None and not self._is_full(self._segment):
            return self._segment
        self._poisoned("interrupted between two segments")
        try:
            if self._segment is None:
                assert self._continue is not None
                self._take_up(self._continue)
            if self._segment is None or self._is_full(self._segment):
                if self._segment is not None:
                    self._close_segment()
                self.begin(
                    self._header.next(self.next_event, self._last_hash), last_ns=self.last_ns
                )
        except OSError as error:
            self._poisoned(f"{error.strerror}")
            raise LogPoisonedError(self._poison) from error
        assert self._segment is not None
        self._poison = ""
        return self._segment

    def _is_full(self, segment: SegmentWriter) -> bool:
        first_ns = segment.chunk_indexes[0].message_start_time
        return (
            segment.size >= ROLL_BYTES
            or segment.counts[COMMIT_CHANNEL] >= ROLL_COMMITS
            or max(self.clock.wall_ns(), self.last_ns) - first_ns >= ROLL_AGE_NS
        )

    def _take_up(self, last: Segment) -> None:
        """Go on with the last segment if it is small; else close it if it is not."""
        self._continue = None
        if last.closed and len(last.file) >= CONTINUE_BELOW_BYTES:
            self._closed_segments.append(statistics_of(last.path, last.file))
            return
        segment = reopened(last)
        write_bag_metadata(self.folder, self._closed_segments)
        segment.install()
        self._segment = segment
        if segment.size >= CONTINUE_BELOW_BYTES:
            self._close_segment()

    def _close_segment(self) -> None:
        assert self._segment is not None
        segment, self._segment = self._segment, None
        segment.close()
        self._closed_segments.append(ClosedSegment.of(segment.path, segment.statistics()))
        write_bag_metadata(self.folder, self._closed_segments)

    def _remember(self, chunk: BuiltChunk) -> None:
        """Keep a chunk's records for the state, folded in when somebody asks or they are many."""
        self._unfolded.append(chunk.records)
        self._unfolded_size += len(chunk.records)
        if self._unfolded_size >= CHUNK_BYTES:
            self._fold()

    def _fold(self) -> None:
        """Fold what was appended; what a retraction hides can only be left out by a new fold."""
        if not self._unfolded:
            return
        batch = Page(b"".join(self._unfolded), self._header.first_event, self.folder).events()
        self._unfolded, self._unfolded_size = [], 0
        self._state.apply(batch)
        self._refold |= Retracted in batch


def _recent_commands(reader: LogReader) -> dict[bytes, Commit]:
    """Return the commits of the last segments, at least `REMEMBERED_COMMANDS` if there are."""
    first, count = len(reader.segments), 0
    while first > 0 and count < REMEMBERED_COMMANDS:
        first -= 1
        count += len(reader.segments[first].chunks)
    return {commit.command_id: commit for commit in reader.commits(first)}
