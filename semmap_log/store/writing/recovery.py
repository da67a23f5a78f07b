"""A segment made writable again: a copy of its whole commits, the torn tail kept beside it.

Nothing is ever cut in place: a reader may have the old file mapped, and a power cut may come at
any moment. Chunk times and message indexes are made anew from the messages, never copied.
"""

from __future__ import annotations

from collections.abc import Iterator

from semmap_log.core.io.byte_source import blocks
from semmap_log.store.chunks import build_chunk
from semmap_log.store.folder import LogFolder
from semmap_log.store.form import TORN_SUFFIX
from semmap_log.store.pages import Page
from semmap_log.store.reading.segment_reading import read_chunk
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.segment import SegmentWriter


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
    """Put what lies behind the last whole commit beside the segment, named by where it lay."""
    name = f"{segment.path.name}{TORN_SUFFIX}-{segment.whole_end}"
    kept, more = name, 1
    while folder.has(kept) and not _holds(folder, kept, segment):
        more += 1
        kept = f"{name}-{more}"
    folder.write_whole(kept, _torn_tail(segment))


def _torn_tail(segment: Segment) -> Iterator[memoryview]:
    return blocks(segment.source, segment.whole_end, segment.size)


def _holds(folder: LogFolder, name: str, segment: Segment) -> bool:
    try:
        with folder.regular_file(name) as file:
            same = all(file.read(len(block)) == block for block in _torn_tail(segment))
            return same and not file.read(1)
    except OSError:  # a stranger's link, or something else that is no file
        return False
