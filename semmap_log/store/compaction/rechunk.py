"""Closed segments written anew in large zstd chunks: the same records, a fraction of the bytes.

Records keep their bytes and their order; only keyframes that stand too near to each other, where
small segments are merged, are left out. The copy lies beside the old file until it has been
compared with it, and is synced; only then may it take a name. Memory: about one chunk.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from semmap_log.errors import CorruptLogError
from semmap_log.store.bag_metadata import ClosedSegment
from semmap_log.store.chunks import BuiltChunk, build_chunk
from semmap_log.store.compaction.repaging import Pause, are_pages, no_pause, pages
from semmap_log.store.folder import LogFolder
from semmap_log.store.form import KEYFRAME_CHANNEL
from semmap_log.store.header import with_all_of
from semmap_log.store.pages import Page
from semmap_log.store.reading.invariants import ReadPosition, place_behind
from semmap_log.store.reading.segment_reading import last_commit, page_at, pages_of, statistics_of
from semmap_log.store.reading.segment_scan import Segment, open_segment
from semmap_log.store.reading.segment_set import check_follows
from semmap_log.store.segment import SegmentWriter

if TYPE_CHECKING:
    from pathlib import PurePath

    from semmap_log.store.header import SegmentHeader


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
    """Tell whether compaction would make a closed segment smaller or its chunks fewer.

    Reads few chunks: of a segment that was compacted those that would not get smaller by it.
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
        place = place_behind(page, place)
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
