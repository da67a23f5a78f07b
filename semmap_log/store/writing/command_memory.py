"""Which commands are stored already, so that one that is sent again is stored once.

However long ago it was stored, in whichever segment. As long as nobody asks, nothing is read and
nothing remembered; a command without an id costs nothing more.

Who asks first has the index of every closed segment read: 8 bytes a commit stay in memory, 8 MB a
million. That takes about as long as opening the log: 0.3 to 0.6 s for 1,825 segments of 1,000
commits; 4 s where these were closed before there was an index, so that their commits are read, once
for each opening. From then on an unknown command takes 10 us, however long the log is: beside a
million commits one in 4,000 has a fingerprint that is known, and a chunk is read to tell that it is
another. A command that is stored takes one chunk of its segment: a millisecond, some more where it
is compacted.

The commands of all closed segments of a log, by 8 bytes each, for who writes it.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.model.commits import Commit
from semmap_log.errors import CorruptLogError
from semmap_log.store.command_index import fingerprint
from semmap_log.store.folder import LogFolder
from semmap_log.store.gone_commands import StoredCommand
from semmap_log.store.reading.command_rows import rows_of
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import commit_of
from semmap_log.store.reading.segment_scan import Segment, open_segment
from semmap_log.store.reading.tombstones import gone_commands, seal_of
from semmap_log.store.segment import SegmentWriter


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
        self._taken_in = 0
        """How many of its commits were looked at."""
        self._seen: Segment | None = None
        """The live segment as it was read last."""

    def add(self, commit: Commit) -> None:
        """Remember a commit that was written, if somebody has asked about its segment."""
        if self._known_of is not None:
            self._known[commit.command_id] = commit.first_event
            self._taken_in += 1

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
            if self._taken_in < len(live.written):
                self._look_at(live)
            event = self._known.get(command_id)
            if event is not None:
                return StoredCommand(self._read_live(live, command_id, event))
        if self._stored is None:
            self._stored = StoredCommands(self._folder, LogReader(self._folder).segments)
        return self._stored.find(command_id)

    def _look_at(self, live: SegmentWriter) -> None:
        """Take in the commits that were written before somebody asked."""
        for command_id in live.written.command_ids(self._taken_in):
            self._known[command_id] = live.written.first_event(self._taken_in)
            self._taken_in += 1

    def _read_live(self, live: SegmentWriter, command_id: bytes, event: int) -> Commit:
        self._flush()
        self._seen = open_segment(live.path, earlier=self._seen, folder=self._folder)
        commit = commit_of(self._seen, event)
        if commit is None or commit.command_id != command_id:
            problem = f"the commit of event {event}, which was written, is not there any more"
            raise CorruptLogError(live.path, self._seen.whole_end, problem)
        return commit

    def _forget_live(self, live: SegmentWriter | None) -> None:
        self._known, self._known_of, self._taken_in, self._seen = {}, live, 0, None


_LOW = np.uint64(0xFFFF_FFFF)
_HIGH = np.uint64(0xFFFF_FFFF_0000_0000)
_ALL = 2**32


class StoredCommands:
    """Fingerprint and first event of each commit: what they promise is looked up in the file.

    Files keep their names as long as the log's lock is held: the compaction beside the writer puts
    a segment's copy in its place, and only `compact` merges segments.
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
        """Return a command, the last one if there are several of its id; None: there is none.

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
