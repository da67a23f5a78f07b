"""Merges small segments into one: which ones, in what steps, and what a crash leaves.

The merged file takes the first one's name; the others become *leftovers*: whole segments that lie
inside the merged one. Readers skip them. They stay for an hour, because `cp -r` lists the names
first and may have copied the first file as it was before the merge. A later writer or compaction
removes them. From before the swap on, `metadata.yaml` lists only the first, with what it will
contain: so rosbag2's tools never meet a missing file or a repeated message.

Closed segments are rewritten in large zstd chunks, from pages of about a MiB of records: the same
records in a fraction of the bytes. Records keep their bytes and their order; only keyframes that
are too close to each other, where small segments are merged, are left out. The copy stays next to
the old file until it has been compared with it and synced; only then may it take a name. Memory:
about one chunk.
"""

from __future__ import annotations

import hashlib
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import PurePath
from stat import S_ISDIR
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from semmap_log.errors import CorruptLogError
from semmap_log.store.bag_metadata import ClosedSegment, write_bag_metadata
from semmap_log.store.byte_layout import (
    CHUNK_BYTES,
    KEYFRAME_CHANNEL,
    KEYFRAME_EVERY_BYTES,
    ROLL_BYTES,
    SEQUENCE_RANGE,
)
from semmap_log.store.chunks import BuiltChunk, build_chunk
from semmap_log.store.folder import LogFolder
from semmap_log.store.header import with_all_of
from semmap_log.store.pages import KEYFRAME_BIT, Page
from semmap_log.store.reading.chunk_table import ChunkTable
from semmap_log.store.reading.invariants import ReadPosition, place_after
from semmap_log.store.reading.page_reading import read_page
from semmap_log.store.reading.segment_reading import last_commit, page_at, pages_of, statistics_of
from semmap_log.store.reading.segment_scan import Segment, open_segment
from semmap_log.store.reading.segment_set import check_follows
from semmap_log.store.record_scan import ScannedRecords
from semmap_log.store.segment import SegmentWriter

if TYPE_CHECKING:
    from semmap_log.store.header import SegmentHeader


MERGE_BYTES = ROLL_BYTES
"""Records that a merged segment holds at most, uncompressed."""


MERGED_KEPT_S = 3600
"""So long files stay that were merged into another: a copy of the folder may take as long."""

Listing = dict[PurePath, ClosedSegment]
"""What metadata.yaml lists, by path, in order."""


@dataclass(frozen=True, slots=True)
class Step:
    """Adjacent closed segments that become one file; often only one, to be rechunked."""

    sources: tuple[Segment, ...]

    @property
    def size(self) -> int:
        """Bytes of its records, uncompressed."""
        return sum(_size(segment) for segment in self.sources)

    def run(self, folder: LogFolder, listed: Listing, pause: Pause) -> Listing:
        """Do it; wherever it stops, the folder holds the log, as it was or as it will be.

        Args:
            folder: The log; its writer's lock is held.
            listed: All its closed segments, by path, in order.
            pause: Called between chunks.

        Returns:
            The closed segments afterwards.

        Raises:
            CorruptLogError: A segment is damaged; all stay as they are.
            OSError: As the file system says.
        """
        first, *others = (segment.path for segment in self.sources)
        with rechunked(folder, self.sources, pause) as copy:
            listed = {path: said for path, said in listed.items() if path not in others}
            listed[first] = copy.closed_segment()
            if others:
                write_bag_metadata(folder, listed.values())
            copy.install(replacing=self.sources[0].source.identity)
        return listed


def plan(closed: Sequence[Segment], *, merge: bool) -> list[Step]:
    """Return what must be done about the closed segments of a log, in order.

    What was done once is not planned again: merged segments hold more than half of what they may,
    or have a neighbour that would not fit.
    """
    groups = _small_neighbours(closed) if merge else ((segment,) for segment in closed)
    return [Step(group) for group in groups if len(group) > 1 or needs_compaction(group[0])]


def _small_neighbours(closed: Sequence[Segment]) -> Iterator[tuple[Segment, ...]]:
    """Yield adjacent segments in groups that fit into one; one that is half full stays alone."""
    group: list[Segment] = []
    room = 0
    for segment in closed:
        is_trimmed = segment.header.trimmed is not None  # its Tombstones are of one segment
        size = MERGE_BYTES if is_trimmed else _size(segment)
        if size > room or size > MERGE_BYTES // 2:
            if group:
                yield tuple(group)
            group, room = [], MERGE_BYTES if size <= MERGE_BYTES // 2 else size
        group.append(segment)
        room -= size
    if group:
        yield tuple(group)


def _size(segment: Segment) -> int:
    return int(segment.chunks.rows["size"].sum())


@dataclass(frozen=True, slots=True)
class MergedFiles:
    """Files whose segments lie in merged ones, and these, by name."""

    parts: tuple[str, ...] = ()
    wholes: tuple[str, ...] = ()

    @classmethod
    def of(cls, segments: Sequence[Segment], leftovers: Sequence[PurePath]) -> MergedFiles:
        """Return those of a log, from what a reader has found."""
        wholes = [s.path.name for s in segments if s.header.last_number > s.header.number]
        return cls(tuple(path.name for path in leftovers), tuple(wholes))

    def remove(self, folder: LogFolder, keep_s: float | None = None) -> MergedFiles:
        """Remove the parts, once no copy of the folder can need them; return what stays for now.

        Only for who holds the writer's lock, and has opened the reader since.

        Args:
            folder: The log's.
            keep_s: How old the last merge must be; default: an hour.

        Raises:
            OSError: As the file system says.
        """
        if not self.parts:
            return self
        last_s = max(folder.status(name, follows=True).st_mtime for name in self.wholes)
        if time.time() - last_s < (MERGED_KEPT_S if keep_s is None else keep_s):
            return self
        folder.sync()  # the merged file's name may not be on the disk yet; they are
        for name in self.parts:
            if not S_ISDIR(folder.status(name).st_mode):
                folder.remove(name)
        folder.sync()
        return MergedFiles()


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
    that are merged bring more keyframes than are of use: those too near to the last are left out,
    but never that of a trimmed log's horizon, where its history begins.

    Raises:
        CorruptLogError: A chunk is not what was written.
    """
    page, since_keyframe = _Pending(), KEYFRAME_EVERY_BYTES
    for read in _reads(sources, pause):
        at = 0
        while at < len(read.ends):
            is_keyframe = bool(read.is_keyframe[at])
            is_near = since_keyframe < KEYFRAME_EVERY_BYTES
            if is_keyframe and is_near and not read.is_at_horizon(at):
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
    """Return whether a segment's chunks are those that `pages` makes; reads no chunk."""
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

    def is_at_horizon(self, at: int) -> bool:
        """Return whether a keyframe holds the state before the first event that is kept."""
        trimmed = self.segment.header.trimmed
        if trimmed is None:
            return False
        sequence = int(self.page.heads["sequence"][self.firsts[at]])
        return sequence == (trimmed.horizon - 1) % SEQUENCE_RANGE

    def size(self, at: int) -> int:
        """Return the bytes of a chunk's records."""
        return int(self.ends[at] - self.starts[at])

    def reaching(self, at: int, size: int) -> int:
        """Return the end of the chunks, from `at` on, that reach that size or the next keyframe."""
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


@contextmanager
def rechunked(
    folder: LogFolder, sources: Sequence[Segment], pause: Pause = no_pause
) -> Iterator[SegmentWriter]:
    """Hand out the closed, synced and compared copy of adjacent segments, as one segment.

    It has the first one's name; `install` puts it there. If that is not called, or on any error,
    nothing is left of it.

    Args:
        folder: The log's.
        sources: Closed segments that follow each other; often only one.
        pause: Called between chunks.

    Raises:
        CorruptLogError: One is damaged, or does not follow the one before.
        OSError: As the file system says.
    """
    writer = SegmentWriter(folder, sources[0].path.name, merged_header(sources))
    try:
        digest = _write(writer, sources, pause)
        _compare(sources, digest, writer, pause)
        yield writer
    finally:
        writer.abandon()


def merged_header(sources: Sequence[Segment]) -> SegmentHeader:
    """Return the header of the segment that stands for all of these."""
    headers = [segment.full_header for segment in sources]
    return replace(with_all_of(headers), last_number=headers[-1].last_number)


def needs_compaction(segment: Segment) -> bool:
    """Return whether compaction would make a closed segment smaller or its chunks fewer.

    Reads few chunks: of a compacted segment, those that would not get smaller.
    """
    if segment.header.trimmed is not None:
        return False  # it was written in such chunks
    plain = np.flatnonzero(segment.chunks.rows["compression"] != b"zstd").tolist()
    return not are_pages(segment.chunks) or any(_shrinks(segment, i) for i in plain)


def _shrinks(segment: Segment, i: int) -> bool:
    return _smallest(page_at(segment, i)).facts.compression == "zstd"


def _write(writer: SegmentWriter, sources: Sequence[Segment], pause: Pause) -> bytes:
    """Write and close the copy; return the digest of all records that it takes over.

    Raises:
        CorruptLogError: A segment is damaged, or does not follow the one before.
    """
    for before, segment in pairwise(sources):
        check_follows(segment, last_commit(before), before)
    header = sources[0].header
    place = ReadPosition(header.first_event, header.first_event, header.hash_so_far)
    whole = hashlib.sha256()
    for page in pages(sources, pause):
        place = place_after(page, place)
        pause(0)  # after each step that keeps the interpreter
        chunk = _smallest(page)
        pause(0)
        writer.add(chunk, levels=page.levels)
        whole.update(page.records)
        pause(len(page.records))
    writer.close()
    return whole.digest()


def _smallest(page: Page) -> BuiltChunk:
    """Return the chunk of these records: compressed, unless that makes it no smaller."""
    records = bytes(page.records)
    built = build_chunk(records, page.offsets, compression="zstd")
    if built.facts.stored_size < built.facts.size:
        return built
    return build_chunk(records, page.offsets, compression="")


def _compare(
    sources: Sequence[Segment], digest: bytes, writer: SegmentWriter, pause: Pause
) -> None:
    """Read the copy from its file and compare head, statistics and every record with the old."""
    assert writer.temporary is not None
    copy = open_segment(writer.folder / writer.temporary, folder=writer.folder)
    if copy.full_header != writer.header:
        raise _differs(sources[0].path, "its head")
    said = [statistics_of(segment) for segment in sources]
    if _contents(said) != _contents([statistics_of(copy)]):
        raise _differs(sources[0].path, "the number or the time of its messages")
    whole = hashlib.sha256()
    for page in pages_of(copy):
        whole.update(page.records)
        pause(len(page.records))
    if whole.digest() != digest:
        raise _differs(sources[0].path, "its records")


def _contents(segments: Sequence[ClosedSegment]) -> tuple[dict[int, int], int, int]:
    """Return messages by channel, and the first and last log time, of segments together.

    Keyframes are not counted: some may be left out. So the end is that of the last segment that has
    more: one was killed, or refused what it was given, before its first commit.
    """
    counts: Counter[int] = Counter()
    for segment in segments:
        counts.update(segment.counts)
    del counts[KEYFRAME_CHANNEL]
    with_commits = [segment for segment in segments if segment.counts.keys() - {KEYFRAME_CHANNEL}]
    return (
        dict(counts),
        min(segment.start_ns for segment in segments),
        max(segment.end_ns for segment in with_commits or segments[:1]),
    )


def _differs(path: PurePath, what: str) -> CorruptLogError:
    return CorruptLogError(path, 0, f"its compacted copy differs in {what}; the old one is kept")
