"""The segments of a log that is being written: which one takes the next commit, and the others.

One segment is live. When it is full it is closed, and another begins; a background thread then
puts the closed one into large compressed chunks. A small closed segment is continued in a copy,
so that a thousand commands of one line do not make a thousand files.

A segment is made writable again as a copy of its whole commits, with the torn tail kept next to it.
Nothing is ever cut in place: a reader may have the old file mapped, and a power cut may come at
any moment. Chunk times and message indexes are recomputed from the messages, never copied.

`CommandMemory` finds which commands are already stored, so that a repeated one is stored once,
however long ago and in whichever segment it was stored. Until it is queried, nothing is read or
remembered; a command without an id costs nothing more. The first query reads the index of every
closed segment: 8 bytes a commit stay in memory, 8 MB a million. That takes about as long as opening
the log: 0.3 to 0.6 s for 1,825 segments of 1,000 commits; 4 s where these were closed before there
was an index, so that their commits are read, once for each opening. After that an unknown command
takes 10 us, however long the log is: among a million commits one in 4,000 has a known fingerprint,
and a chunk is read to find that it is another command. A stored command takes one chunk of its
segment: a millisecond, some more where it is compacted.
"""

from __future__ import annotations

import errno
import threading
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.io.byte_source import blocks
from semmap_log.core.model.commits import Commit
from semmap_log.errors import CorruptLogError
from semmap_log.store.bag_metadata import ClosedSegment, write_bag_metadata
from semmap_log.store.byte_layout import (
    CONTINUE_BELOW_BYTES,
    ROLL_AGE_NS,
    ROLL_BYTES,
    ROLL_COMMITS,
    TORN_SUFFIX,
    segment_name,
)
from semmap_log.store.chunks import BuiltChunk, build_chunk
from semmap_log.store.closed_mark import ClosedMark, read_mark, write_mark
from semmap_log.store.command_index import fingerprint
from semmap_log.store.compaction.background import BackgroundCompactor, KeepUp
from semmap_log.store.compaction.merge import MergedFiles, needs_compaction
from semmap_log.store.folder import LogFolder, Version
from semmap_log.store.gone_commands import StoredCommand
from semmap_log.store.header import SegmentHeader
from semmap_log.store.pages import Page
from semmap_log.store.reading.command_rows import rows_of
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import commit_of, read_chunk, statistics_of
from semmap_log.store.reading.segment_scan import Segment, open_segment
from semmap_log.store.reading.tombstones import gone_commands, seal_of
from semmap_log.store.segment import SegmentWriter

MOST_LEFT = 16
"""So many segments are looked at, when a log is opened, for compaction that was left undone."""


@dataclass(frozen=True, slots=True)
class LogEnd:
    """Where a log ends."""

    next_event: int
    """Number of the event that comes next."""
    head: bytes
    """Hash of the last commit."""

    def mark(self, last: SegmentHeader) -> ClosedMark:
        """Return what is written down of a log that ends here, its last segment closed."""
        return ClosedMark(last.info.log_id, last.last_number, self.next_event, self.head.hex())


class SegmentChain:
    """Used by one thread at a time, but for what the background thread reports.

    Every method may raise OSError; after that the live segment must only be abandoned.
    """

    def __init__(
        self,
        folder: LogFolder,
        closed: Callable[[SegmentWriter], None],
        *,
        compacts: bool,
        keep_up: KeepUp | None,
    ) -> None:
        """Prepare.

        Args:
            folder: The log's.
            closed: Called with each live segment that is closed, before it is compacted.
            compacts: Whether full segments are compacted in the background.
            keep_up: Called in the background after each of them.
        """
        self.folder = folder
        self.live: SegmentWriter | None = None
        self._header: SegmentHeader
        """Of the last segment, live or not."""
        self._small: Segment | None = None
        """The last segment if it is closed and nothing was written yet: perhaps to continue."""
        self._older: Sequence[Segment] = ()
        """Closed segments whose statistics nobody has needed yet."""
        self._closed: dict[str, ClosedSegment] = {}
        self._listing = threading.Lock()
        """Held while metadata.yaml is made: the background thread changes it, too."""
        self._written: dict[str, Version] = {}
        """Segments that this writer has closed, or compacted, as they were then."""
        self._merged = MergedFiles()
        """What was merged before this writer came, and is not old enough to go."""
        self._report_closed = closed
        self._compacts = compacts
        self._compactor = BackgroundCompactor(folder, self._compacted, keep_up)

    def begin(self, header: SegmentHeader, keyframe: BuiltChunk) -> None:
        """Start a segment: head, keyframe, its name on disk."""
        name = segment_name(self.folder.name, header.number)
        segment = SegmentWriter(self.folder, name, header)
        try:
            segment.add(keyframe)
            segment.install()
        except BaseException:
            segment.abandon()
            raise
        self._header, self.live, self._small = header, segment, None

    def begin_next(self, first_event: int, hash_so_far: bytes, keyframe: BuiltChunk) -> None:
        """Start the segment after the last."""
        self.begin(self._header.next(first_event, hash_so_far), keyframe)

    @property
    def is_single(self) -> bool:
        """Whether there is one segment, and never was another."""
        return self._header.number == 0

    def begins_segment(self, next_event: int) -> bool:
        """Return whether an event is the first of the last segment, or follows a trimmed one."""
        return self._header.trimmed is not None or self._header.first_event == next_event

    def start_over(self, keyframe: BuiltChunk) -> None:
        """Put a new segment in the place of the only one, which holds no events."""
        first, small = self.live, self._small
        assert first is not None or small is not None
        name = first.name if first is not None else small.path.name  # type: ignore[union-attr]
        self.live = self._small = None
        segment = SegmentWriter(self.folder, name, self._header)
        try:
            segment.add(keyframe)
            self._list()  # rosbag2's tools must not meet a live segment
            segment.install(replacing=self.folder.identity(segment.name))
        except BaseException:
            segment.abandon()
            raise
        finally:
            if first is not None:
                first.abandon()
        self.live = segment

    def take_up(self, reader: LogReader, end: LogEnd) -> None:
        """Continue a log: a live segment is repaired now, a closed one when it is needed."""
        *older, last = reader.segments
        self._merged = MergedFiles.of(reader.segments, reader.leftovers)
        self._older, self._header, self._small = older, last.full_header, last
        if last.closed:
            self.folder.sync_file(last.path.name)  # who closed it may have been killed before that
            mark = end.mark(last.header)
            if read_mark(self.folder) != mark:
                write_mark(self.folder, mark)
        else:
            self.continue_last(end)
        for segment in reversed(_left_to_compact(older)):
            self._compact(segment.path.name)

    def continue_last(self, end: LogEnd) -> None:
        """Make the last segment live again, in a copy, if it is small; else close it."""
        last, self._small = self._small, None
        if last is None:
            return  # a crash left a large one: it was made whole, and closed
        is_done = last.size >= CONTINUE_BELOW_BYTES or last.header.trimmed is not None
        if last.closed and is_done:
            self._older = (*self._older, last)
            return
        segment = reopened(self.folder, last)
        self._list()  # rosbag2's tools must not meet a live segment
        segment.install(replacing=last.source.identity)
        self.live = segment
        if segment.size >= CONTINUE_BELOW_BYTES:
            self.roll(end)

    def is_full(self, now_ns: int) -> bool:
        """Return whether the live segment is full and must be followed by another."""
        live = self.live
        return live is not None and (
            live.size >= ROLL_BYTES
            or live.commits >= ROLL_COMMITS
            or now_ns - live.start_ns >= ROLL_AGE_NS
        )

    def roll(self, end: LogEnd) -> None:
        """Close the live segment, since another will follow, and have it compacted."""
        segment = self.live
        self.close_live(end)
        with suppress(OSError):  # the next writer does it
            self._merged = self._merged.remove(self.folder)
        if segment is not None:
            self._compact(segment.name)

    def close_live(self, end: LogEnd) -> None:
        """Give the live segment its index and footer, so that every tool reads it.

        Args:
            end: Where it ends: from then on, a log that ends before is known to be cut.
        """
        segment, self.live = self.live, None
        if segment is not None:
            try:
                segment.close()
            except BaseException:
                segment.abandon()
                raise
            self._report_closed(segment)
            write_mark(self.folder, end.mark(segment.header))  # first: see `check_listed`
            self._list(segment.closed_segment())
            self._check_written(segment.name)

    def abandon(self) -> None:
        """Let go of the live segment as it is."""
        if self.live is not None:
            self.live.abandon()
            self.live = None

    def rest(self, *, wait: bool) -> None:
        """End the background thread; what it has not done is left to the next writer.

        Args:
            wait: Let it finish the segment that it is at.
        """
        self._compactor.close(wait=wait)

    def _compact(self, name: str) -> None:
        if self._compacts:
            self._compactor.add(name)

    def _compacted(self, closed: ClosedSegment) -> None:
        """Take in that a segment was replaced; called by the background thread."""
        with self._listing:
            self._written[closed.name] = self.folder.version(closed.name)
            self._closed[closed.name] = closed
            if not self._older:
                write_bag_metadata(self.folder, self._closed.values())

    def _check_written(self, closed: str) -> None:
        """Check that all that this writer has written is still what lies there.

        Raises:
            OSError: A file was removed, exchanged or written over by somebody else.
        """
        with self._compactor.swapping, self._listing:
            for name, version in self._written.items():
                if not self.folder.has(name) or self.folder.version(name) != version:
                    problem = f"{name} was removed, exchanged or written over by somebody else"
                    raise FileNotFoundError(errno.ENOENT, problem)
            self._written[closed] = self.folder.version(closed)

    def _list(self, *closed: ClosedSegment) -> None:
        """Rewrite metadata.yaml with what was closed."""
        with self._listing:
            older, self._older = self._older, ()
            for segment in older:
                if segment.told is not None:
                    continue  # removed from the disk: other tools must not look for it
                with suppress(CorruptLogError):  # its reader gets the error
                    self._closed[segment.path.name] = statistics_of(segment)
            for one in closed:
                self._closed[one.name] = one
            write_bag_metadata(self.folder, self._closed.values())


def _left_to_compact(closed: Sequence[Segment]) -> list[Segment]:
    """Return the last segments that the writers before did not get to, the last first."""
    found = []
    with suppress(CorruptLogError):  # its reader gets the error
        for segment in reversed(closed[-MOST_LEFT:]):
            if segment.told is not None or not needs_compaction(segment):
                break
            found.append(segment)
    return found


def reopened(folder: LogFolder, segment: Segment) -> SegmentWriter:
    """Return a writer that holds the segment's whole commits, not yet installed."""
    if segment.torn_bytes:
        keep_torn_tail(folder, segment)
    writer = SegmentWriter(folder, segment.path.name, segment.full_header)
    try:
        for chunk in segment.chunks:
            records = bytes(read_chunk(segment, chunk))
            page = Page(records, segment.header.first_event, segment.path, chunk.offset)
            built = build_chunk(records, page.offsets, compression=chunk.compression)
            writer.add(built, levels=page.levels)
    except BaseException:
        writer.abandon()
        raise
    return writer


def keep_torn_tail(folder: LogFolder, segment: Segment) -> None:
    """Keep the bytes after the last whole commit next to the segment, named by their place."""
    name = f"{segment.path.name}{TORN_SUFFIX}-{segment.valid_end}"
    kept, more = name, 1
    while folder.has(kept) and not _holds(folder, kept, segment):
        more += 1
        kept = f"{name}-{more}"
    folder.write_atomic(kept, _torn_tail(segment))


def _torn_tail(segment: Segment) -> Iterator[memoryview]:
    return blocks(segment.source, segment.valid_end, segment.size)


def _holds(folder: LogFolder, name: str, segment: Segment) -> bool:
    try:
        with folder.regular_file(name) as file:
            same = all(file.read(len(block)) == block for block in _torn_tail(segment))
            return same and not file.read(1)
    except OSError:  # a stranger's link, or something else that is no file
        return False


class CommandMemory:
    """The commands of a log that is being written: by id those of the live segment, else by index.

    Used by one thread at a time.
    """

    def __init__(
        self,
        folder: LogFolder,
        live: Callable[[], SegmentWriter | None],
        flush: Callable[[], None],
    ) -> None:
        """Prepare; nothing is read.

        Args:
            folder: The log's.
            live: Gives the live segment.
            flush: Hands the kernel what the writer holds back, before the live segment is read.
        """
        self._folder = folder
        self._live = live
        self._flush = flush
        self._stored: StoredCommands | None = None
        self._known: dict[bytes, int] = {}
        """Of the live segment: command id -> first event."""
        self._known_of: SegmentWriter | None = None
        self._seen: Segment | None = None
        """The live segment as it was read last."""

    def add(self, commit: Commit) -> None:
        """Remember a commit that was written, if its segment has been queried."""
        if self._known_of is not None:
            self._known[commit.command_id] = commit.first_event

    def closed(self, segment: SegmentWriter) -> None:
        """Take in that the live segment was closed, with all of its commits."""
        if self._known_of is segment:
            self._forget_live(None)
        if self._stored is not None:
            self._stored.add(segment.name, segment.header.first_event, segment.command_rows)

    def find(self, command_id: bytes) -> StoredCommand | None:
        """Return a command, if it is stored.

        Args:
            command_id: 16 bytes.

        Raises:
            CorruptLogError: A segment in which it may be is damaged.
            LogAccessError: One cannot be read.
        """
        live = self._live()
        if live is not None:
            if live is not self._known_of:
                self._forget_live(live)
            if len(self._known) < len(live.written):
                self._look_at(live)
            event = self._known.get(command_id)
            if event is not None:
                return StoredCommand(self._read_live(live, command_id, event))
        if self._stored is None:
            self._stored = StoredCommands(self._folder, LogReader(self._folder).segments)
        return self._stored.find(command_id)

    def _look_at(self, live: SegmentWriter) -> None:
        """Take in the commits that were written before the first query."""
        for place, command_id in enumerate(live.written.command_ids()):
            self._known[command_id] = live.written.first_event(place)

    def _read_live(self, live: SegmentWriter, command_id: bytes, event: int) -> Commit:
        self._flush()
        self._seen = open_segment(live.path, earlier=self._seen, folder=self._folder)
        commit = commit_of(self._seen, event)
        if commit is None or commit.command_id != command_id:
            problem = f"the commit of event {event}, which was written, is not there any more"
            raise CorruptLogError(live.path, self._seen.valid_end, problem)
        return commit

    def _forget_live(self, live: SegmentWriter | None) -> None:
        self._known, self._known_of, self._seen = {}, live, None


_LOW = np.uint64(0xFFFF_FFFF)
_HIGH = np.uint64(0xFFFF_FFFF_0000_0000)
_ALL = 2**32


class StoredCommands:
    """Fingerprint and first event of each commit: what they promise is looked up in the file.

    Files keep their names as long as the log's lock is held: background compaction replaces a
    segment by its copy, and only `compact` merges segments.
    """

    def __init__(self, folder: LogFolder, segments: Sequence[Segment]) -> None:
        """Take in the closed ones of a log's segments, each by its index.

        Args:
            folder: The log's.
            segments: All of it.

        Raises:
            CorruptLogError: As `rows_of`.
        """
        self._folder = folder
        self._firsts: list[int] = []
        """Number of the first event of each segment, ascending."""
        self._names: list[str] = []
        self._rows = np.empty(0, np.uint64)
        """Ascending; upper half the fingerprint, lower half the low bits of the first event."""
        self._end = 0
        """Commits that begin before this event are among them."""
        self._last: Segment | None = None
        """The one that was read last: commands that are sent again come in order, as a rule."""
        self._elsewhere = {s.path.name: s for s in segments if s.told is not None}
        """Those that were removed from the disk: what is not kept of them says where it lies."""
        self._gone = {command.id_digest: command for s in segments for command in gone_commands(s)}
        """Those of which nothing else is left."""
        self._take([(s.path.name, s.header.first_event, rows_of(s)) for s in segments if s.closed])

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, name: str, first_event: int, rows: NDArray[np.uint64]) -> None:
        """Take in a segment that was closed since, the one after the last or the last continued.

        Args:
            name: Its file's.
            first_event: Number of its first event.
            rows: Its command index.
        """
        self._last = None  # so that a file that is replaced gives its room back
        self._take([(name, first_event, rows)])

    def find(self, command_id: bytes) -> StoredCommand | None:
        """Return a command, the last one if there are several of its id, or None.

        Raises:
            CorruptLogError: The commit that it may be cannot be read.
            LogAccessError: Its segment cannot be read.
        """
        for event in self._events(fingerprint(command_id)):
            segment = self._segment(event)
            commit = commit_of(segment, event)
            if commit is not None and commit.command_id == command_id:
                return StoredCommand(commit, seal_of(segment, commit))
        gone = self._gone.get(sha256(command_id).digest()) if self._gone else None
        return None if gone is None else StoredCommand(gone.as_commit(command_id), gone.seal)

    def _events(self, wanted: int) -> Iterator[int]:
        """Yield where commits with a fingerprint begin, the last first."""
        rows = self._rows.data  # its numbers are Python's: each of numpy's takes longer
        events: list[int] = []
        for place in range(bisect_left(rows, wanted << 32), len(rows)):
            row = rows[place]
            if row >> 32 != wanted:
                break
            events += range(row & 0xFFFF_FFFF, self._end, _ALL)
        yield from sorted(events, reverse=True)

    def _segment(self, event: int) -> Segment:
        name = self._names[bisect_right(self._firsts, event) - 1]
        if name in self._elsewhere:
            return self._elsewhere[name]
        if self._last is None or self._last.path.name != name:
            self._last = open_segment(self._folder / name, folder=self._folder)
        return self._last

    def _take(self, more: Sequence[tuple[str, int, NDArray[np.uint64]]]) -> None:
        parts = [self._rows]
        for name, first_event, rows in more:
            offsets = rows & _LOW
            first = np.uint64(first_event)
            new = offsets + first >= np.uint64(self._end)
            low = (offsets[new] + first) & _LOW
            parts.append((rows[new] & _HIGH) | low)
            self._firsts.append(first_event)
            self._names.append(name)
            if len(rows):
                self._end = max(self._end, first_event + int(offsets.max()) + 1)
        self._rows = np.concatenate(parts)
        self._rows.sort(kind="stable")  # which merges what is sorted already
