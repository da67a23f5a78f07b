"""The records of a segment in pages of about a MiB: what compaction writes as chunks."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from semmap_log.log.form import CHUNK_BYTES, KEYFRAME_CHANNEL
from semmap_log.log.pages import Page
from semmap_log.log.reading.chunk_table import ChunkTable
from semmap_log.log.reading.page_reading import read_page
from semmap_log.log.reading.scan import Segment

Pause = Callable[[int], None]
"""Called between steps with the bytes of records handled since the last call; each record is
handled twice, once to be written and once to be compared. What it raises stops the work."""

READ_BYTES = 2**17
"""So much is read between two pauses, if the chunks are small."""


def no_pause(done: int) -> None:
    """Go on at once."""


def pages(segment: Segment, pause: Pause = no_pause) -> Iterator[Page]:
    """Yield a segment's records in pages of about a MiB, each keyframe by itself.

    Whole chunks are joined until they are long enough. So a commit's note never parts from it, and
    what has been joined once joins no further: to compact again changes nothing.

    Raises:
        CorruptLogError: A chunk is not what was written.
    """
    page = _Pending(segment)
    for group in segment.chunks.groups(READ_BYTES):
        pause(0)
        read = _Read(group, read_page(group, segment.header.first_event))
        at = 0
        while at < len(group):
            is_keyframe = bool(read.is_keyframe[at])
            if is_keyframe and page.size:
                yield page.take()
            end = at + 1 if is_keyframe else read.reaching(at, CHUNK_BYTES - page.size)
            page.add(read, at, end)
            if is_keyframe or page.size >= CHUNK_BYTES:
                yield page.take()
            at = end
    if page.size:
        yield page.take()


class _Read:
    """Chunks that were read together, and where each lies in their records."""

    def __init__(self, chunks: ChunkTable, page: Page) -> None:
        self.page = page
        self.places = chunks.rows["offset"]
        """Of each chunk in the file."""
        self.ends = np.cumsum(chunks.rows["size"])
        self.starts = self.ends - chunks.rows["size"]
        self.firsts = np.searchsorted(page.offsets, self.starts)
        """Number of each chunk's first record."""
        self.is_keyframe = page.heads["channel_id"][self.firsts] == KEYFRAME_CHANNEL
        """By its first record: then it is its only one."""

    def reaching(self, at: int, size: int) -> int:
        """Return the chunk behind those, from `at` on, that reach that size, or to a keyframe."""
        end = int(np.searchsorted(self.ends, int(self.starts[at]) + size)) + 1
        keyframes: list[int] = (at + np.flatnonzero(self.is_keyframe[at:end])).tolist()
        return min(end, len(self.ends), *keyframes[:1])


class _Pending:
    """The page under way: parts of what was read."""

    def __init__(self, segment: Segment) -> None:
        self.size = 0
        self._segment = segment
        self._records: list[bytes | memoryview] = []
        self._offsets: list[NDArray[np.int64]] = []
        self._place = 0

    def add(self, read: _Read, at: int, end: int) -> None:
        """Add the chunks at..end of those that were read."""
        if not self.size:
            self._place = int(read.places[at])
        start = int(read.starts[at])
        records = read.page.records[start : int(read.ends[end - 1])]
        behind = int(read.firsts[end]) if end < len(read.ends) else None
        offsets = read.page.offsets[int(read.firsts[at]) : behind]
        self._records.append(records)
        self._offsets.append(offsets + (self.size - start))
        self.size += len(records)

    def take(self) -> Page:
        """Return the page, and begin another."""
        page = Page(
            b"".join(self._records),
            self._segment.header.first_event,
            self._segment.path,
            self._place,
            np.concatenate(self._offsets),
        )
        self.size, self._records, self._offsets = 0, [], []
        return page
