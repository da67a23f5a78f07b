"""The records of segments in pages of about a MiB: what compaction writes as chunks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from semmap_log.store.form import CHUNK_BYTES, KEYFRAME_CHANNEL, KEYFRAME_EVERY_BYTES
from semmap_log.store.kind_bits import KEYFRAME_BIT
from semmap_log.store.pages import Page
from semmap_log.store.reading.chunk_table import ChunkTable
from semmap_log.store.reading.page_reading import read_page
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.record_scan import ScannedRecords

Pause = Callable[[int], None]
"""Called between steps with the bytes of records handled since the last call; each record is
handled twice, once to be written and once to be compared. What it raises stops the work."""

READ_BYTES = 2**17
"""So much is read between two pauses, if the chunks are small."""


def no_pause(done: int) -> None:
    """Go on at once."""


def pages(sources: Iterable[Segment], pause: Pause = no_pause) -> Iterator[Page]:
    """Yield the records of adjacent segments in pages of about a MiB, each keyframe by itself.

    Whole chunks are joined until they are long enough. So a commit's note never parts from it, and
    what has been joined once joins no further: to compact again changes nothing. Small segments
    that are merged bring more keyframes than are of use: those too near to the last are left out.

    Raises:
        CorruptLogError: A chunk is not what was written.
    """
    page, since_keyframe = _Pending(), KEYFRAME_EVERY_BYTES
    for read in _reads(sources, pause):
        at = 0
        while at < len(read.ends):
            is_keyframe = bool(read.is_keyframe[at])
            if is_keyframe and since_keyframe < KEYFRAME_EVERY_BYTES:
                pause(2 * read.size(at))  # neither written nor compared
                at += 1
                continue
            if is_keyframe and page.size:
                yield page.take()
            end = at + 1 if is_keyframe else read.reaching(at, CHUNK_BYTES - page.size)
            size = page.add(read, at, end)
            since_keyframe = 0 if is_keyframe else since_keyframe + size
            if is_keyframe or page.size >= CHUNK_BYTES:
                yield page.take()
            at = end
    if page.size:
        yield page.take()


def are_pages(chunks: ChunkTable) -> bool:
    """Tell whether a segment's chunks are what `pages` makes of them; none is read."""
    since_keyframe, is_short = KEYFRAME_EVERY_BYTES, False
    is_keyframe = (chunks.rows["kinds"] & np.uint32(KEYFRAME_BIT)) != 0
    for keyframe, size in zip(is_keyframe.tolist(), chunks.rows["size"].tolist(), strict=True):
        if since_keyframe < KEYFRAME_EVERY_BYTES if keyframe else is_short:
            return False
        since_keyframe = 0 if keyframe else since_keyframe + size
        is_short = not keyframe and size < CHUNK_BYTES
    return True


def _reads(sources: Iterable[Segment], pause: Pause) -> Iterator[_Read]:
    for segment in sources:
        asked = 0
        for group in segment.chunks.groups(READ_BYTES):
            pause(0)
            start, end = group.span()
            if end > asked:
                asked = max(end, start + CHUNK_BYTES)
                segment.source.will_need(start, asked)
            yield _Read(segment, group, read_page(group, segment.header.first_event))


class _Read:
    """Chunks that were read together, and where each lies in their records."""

    def __init__(self, segment: Segment, chunks: ChunkTable, page: Page) -> None:
        self.segment = segment
        self.page = page
        self.places = chunks.rows["offset"]
        """Of each chunk in the file."""
        self.ends = np.cumsum(chunks.rows["size"])
        self.starts = self.ends - chunks.rows["size"]
        self.firsts = np.searchsorted(page.offsets, self.starts)
        """Number of each chunk's first record."""
        self.is_keyframe = page.heads["channel_id"][self.firsts] == KEYFRAME_CHANNEL
        """By its first record: then it is its only one."""

    def size(self, at: int) -> int:
        """Return the bytes of a chunk's records."""
        return int(self.ends[at] - self.starts[at])

    def reaching(self, at: int, size: int) -> int:
        """Return the chunk behind those, from `at` on, that reach that size, or to a keyframe."""
        end = int(np.searchsorted(self.ends, int(self.starts[at]) + size)) + 1
        keyframes: list[int] = (at + np.flatnonzero(self.is_keyframe[at:end])).tolist()
        return min(end, len(self.ends), *keyframes[:1])


class _Pending:
    """The page under way: parts of what was read."""

    def __init__(self) -> None:
        self.size = 0
        self._first: tuple[Segment, int] | None = None
        """The segment that it begins in, and where there."""
        self._records: list[bytes | memoryview] = []
        self._offsets: list[NDArray[np.int64]] = []

    def add(self, read: _Read, at: int, end: int) -> int:
        """Add the chunks at..end of those that were read; return how many bytes they are."""
        if self._first is None:
            self._first = (read.segment, int(read.places[at]))
        start = int(read.starts[at])
        records = read.page.records[start : int(read.ends[end - 1])]
        behind = int(read.firsts[end]) if end < len(read.ends) else None
        offsets = read.page.offsets[int(read.firsts[at]) : behind]
        self._records.append(records)
        self._offsets.append(offsets + (self.size - start))
        self.size += len(records)
        return len(records)

    def take(self) -> Page:
        """Return the page, and begin another."""
        assert self._first is not None, "there is something in it"
        segment, place = self._first
        page = Page(
            b"".join(self._records),
            segment.header.first_event,
            segment.path,
            place,
            ScannedRecords(np.concatenate(self._offsets)),
        )
        self.size, self._first, self._records, self._offsets = 0, None, [], []
        return page
