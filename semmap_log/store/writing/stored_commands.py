"""The commands of all closed segments of a log, by 8 bytes each, for who writes it."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray

from semmap_log.store.command_index import fingerprint
from semmap_log.store.folder import LogFolder
from semmap_log.store.gone_commands import StoredCommand
from semmap_log.store.reading.command_rows import rows_of
from semmap_log.store.reading.segment_reading import commit_of
from semmap_log.store.reading.segment_scan import Segment, open_segment
from semmap_log.store.reading.tombstones import gone_commands, seal_of

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
