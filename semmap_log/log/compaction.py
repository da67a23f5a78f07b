"""Closed segments in large compressed chunks: the same records, a fraction of the bytes."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from semmap_log.errors import CorruptLogError
from semmap_log.log.bag_metadata import statistics_of, write_bag_metadata
from semmap_log.log.chunks import build_chunk
from semmap_log.log.form import (
    CHUNK_BYTES,
    KEYFRAME_CHANNEL,
)
from semmap_log.log.lock import WriterLock
from semmap_log.log.pages import Page
from semmap_log.log.reader import LogReader, check_is_log, read_chunk
from semmap_log.log.scan import Segment, open_segment
from semmap_log.log.segment import SegmentWriter


@dataclass(frozen=True, slots=True)
class Compacted:
    """What a compaction did."""

    segments: int
    bytes_before: int
    bytes_after: int


def compact(folder: Path) -> Compacted:
    """Rechunk every closed segment of a log to zstd chunks of about a MiB.

    Records keep their bytes and their order. Each segment is written beside the old one, checked
    record by record, and takes its name at once.

    Raises:
        LogLockedError: Somebody is writing.
        CorruptLogError: A segment is damaged; it is left as it is.
    """
    check_is_log(folder)
    lock = WriterLock(folder)
    try:
        segments = [segment for segment in LogReader(folder).segments if segment.closed]
        before = sum(len(segment.file) for segment in segments)
        after = sum(_compact_segment(segment) for segment in segments)
        closed = [open_segment(segment.path) for segment in segments]
        write_bag_metadata(folder, [statistics_of(s.path, s.file) for s in closed])
    finally:
        lock.release()
    return Compacted(len(segments), before, after)


def _compact_segment(segment: Segment) -> int:
    """Write a segment anew, in place of the old one; return its bytes."""
    writer = SegmentWriter(segment.path, segment.header)
    try:
        for records in _pages(segment):
            page = Page(records, segment.header.first_event, segment.path)
            writer.add(build_chunk(records, page.offsets, compression="zstd"), levels=page.levels)
        writer.close()
        assert writer.temporary is not None
        _check_same(segment, open_segment(writer.temporary))
        writer.install()
    except BaseException:
        writer.abandon()
        raise
    return writer.size


def _pages(segment: Segment) -> Iterator[bytes]:
    """Yield a segment's records in parts of about a MiB, each keyframe by itself."""
    parts: list[bytes] = []
    size = 0
    for chunk in segment.chunks:
        records = bytes(read_chunk(segment, chunk))
        is_keyframe = Page(records, 0, segment.path).heads["channel_id"][0] == KEYFRAME_CHANNEL
        if parts and (is_keyframe or size >= CHUNK_BYTES):
            yield b"".join(parts)
            parts, size = [], 0
        if is_keyframe:
            yield records
        else:
            parts.append(records)
            size += len(records)
    if parts:
        yield b"".join(parts)


def _check_same(old: Segment, new: Segment) -> None:
    """Compare all records of two segments, in the memory of one chunk."""
    if _digest(old) != _digest(new):
        raise CorruptLogError(old.path, 0, "the compacted copy differs; the old one is kept")


def _digest(segment: Segment) -> bytes:
    whole = hashlib.sha256()
    for chunk in segment.chunks:
        whole.update(read_chunk(segment, chunk))
    return whole.digest()
