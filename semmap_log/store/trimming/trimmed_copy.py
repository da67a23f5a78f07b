"""The copy of closed segments without some of their records, written, synced and compared."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

from semmap_log.errors import CorruptLogError
from semmap_log.store.chunks import build_chunk
from semmap_log.store.compaction.rechunk import merged_header
from semmap_log.store.compaction.repaging import Pause, no_pause
from semmap_log.store.folder import LogFolder
from semmap_log.store.header import SegmentHeader, Trimmed
from semmap_log.store.pages import Page
from semmap_log.store.reading.mapped_file import map_file
from semmap_log.store.reading.segment_reading import end_of, pages_of
from semmap_log.store.reading.segment_scan import Segment, segment_in
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.trimming.records_left import RecordsLeft, Selection


@contextmanager
def trimmed(
    folder: LogFolder, sources: Sequence[Segment], selection: Selection, pause: Pause = no_pause
) -> Iterator[TrimmedCopy]:
    """Hand out the closed, synced copy of adjacent segments, as one, without what was selected.

    It has the first one's name; `install` puts it there. If that is not called, or on any error,
    nothing is left of it.

    Args:
        folder: The log's.
        sources: Closed segments that follow each other; often only one.
        selection: What goes.
        pause: Called between chunks.

    Raises:
        CorruptLogError: The segment is damaged.
        OSError: As the file system says.
    """
    copy = TrimmedCopy(folder, sources, selection)
    try:
        copy.write(pause)
        yield copy
    finally:
        copy.writer.abandon()


class TrimmedCopy:
    """A copy under way, and what was taken out for it."""

    def __init__(self, folder: LogFolder, sources: Sequence[Segment], selection: Selection) -> None:
        """Begin: the head is written."""
        self.left = RecordsLeft(sources, selection)
        header = _header_of(sources, selection)
        self.writer = SegmentWriter(folder, sources[0].path.name, header)
        self._digest = hashlib.sha256()
        self.segment: Segment
        """The copy, opened, once it is written."""

    def write(self, pause: Pause) -> None:
        """Write all of it, close it, and compare what its file holds with what was written.

        Raises:
            CorruptLogError: The segment, or the copy, is damaged.
            OSError: As the file system says.
        """
        for records, next_event in self.left.parts(pause):
            page = Page(records, self.writer.header.first_event, self.writer.path)
            chunk = build_chunk(records, page.offsets, compression="zstd")
            self.writer.add(chunk, levels=page.levels, next_event=next_event)
            self._digest.update(records)
        self.writer.close()
        self._compare(pause)

    def install(self) -> None:
        """Put it in the place of the first segment; the others are leftovers then.

        Raises:
            OSError: As the file system says, or another file has its name now.
        """
        self.writer.install(replacing=self.left.sources[0].source.identity)

    def _compare(self, pause: Pause) -> None:
        """Read the copy from its file, and compare its records with those that were handed on."""
        writer, sources = self.writer, self.left.sources
        assert writer.temporary is not None, "it was not installed yet"
        source = map_file(writer.folder / writer.temporary, writer.folder)
        copy = self.segment = segment_in(writer.path, source)
        found = hashlib.sha256()
        for page in pages_of(copy):
            found.update(page.records)
            pause(0)
        is_same = found.digest() == self._digest.digest() and copy.head == sources[-1].head
        if not is_same or copy.full_header != writer.header:
            problem = "its trimmed copy is not what was written; the old one is kept"
            raise CorruptLogError(sources[0].path, 0, problem)


def _header_of(sources: Sequence[Segment], selection: Selection) -> SegmentHeader:
    """Return the header of the segment that stands for all of these, trimmed."""
    reasons, horizon = selection.reason, selection.horizon
    for segment in sources:
        if segment.header.trimmed is not None:
            reasons |= segment.header.trimmed.reasons
            horizon = max(horizon, segment.header.trimmed.horizon)
    trimmed = Trimmed(reasons, end_of(sources[-1]), horizon)
    return replace(merged_header(sources), trimmed=trimmed)
