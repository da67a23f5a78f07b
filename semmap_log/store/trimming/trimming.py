"""Trims the closed segments of a log, one by one, under the writer's lock.

Each is replaced by a copy without some of its records, which is written, synced and compared.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

from semmap_log.core.io.progress import Progress
from semmap_log.core.model.events import HistoryTrimmed
from semmap_log.errors import CorruptLogError, LogAccessError
from semmap_log.store.bag_metadata import write_bag_metadata
from semmap_log.store.chunks import build_chunk
from semmap_log.store.compaction.merge import MergedFiles, Pause, merged_header, no_pause
from semmap_log.store.folder import LogFolder
from semmap_log.store.gone_commands import TombstoneSum
from semmap_log.store.header import SegmentHeader, Trimmed, TrimReason
from semmap_log.store.lock import WriterLock
from semmap_log.store.pages import Page
from semmap_log.store.reading.mapped_file import map_file
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import end_of, pages_of, statistics_of
from semmap_log.store.reading.segment_scan import Segment, segment_in
from semmap_log.store.reading.tombstones import tombstones
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.trimming.remaining_records import RemainingRecords, Selection

Select = Callable[[Segment], Selection | None]
"""Returns what is to be taken out of a segment; None: nothing."""

CheckCopy = Callable[[LogReader, Segment], None]
"""Takes the log as it would be, and the trimmed copy in it, before the copy is installed; raises
CorruptLogError where the log could not be read or verified."""


@dataclass(frozen=True, slots=True)
class Trimming:
    """What was taken out of a log, or would be."""

    segments: int = 0
    """That lose something."""
    events: int = 0
    notes: int = 0
    bytes_before: int = 0
    """Of these segments."""
    bytes_after: int | None = 0
    """None where it was only counted."""

    def with_more(self, left: RemainingRecords, size: int | None) -> Trimming:
        """Return what was taken out with that of some segments more, of which so much is left."""
        return Trimming(
            self.segments + len(left.sources),
            self.events + left.events_gone,
            self.notes + left.notes_gone,
            self.bytes_before + sum(segment.size for segment in left.sources),
            None if self.bytes_after is None or size is None else self.bytes_after + size,
        )


def trim_segments(
    log: Path, select: Select, check: CheckCopy, progress: Progress | None = None
) -> Trimming:
    """Take records out of the closed segments of a log.

    Stopped at any point, by whatever, each segment is as it was, or as it will be.

    Args:
        log: The log's folder.
        select: Says what goes.
        check: Called for each copy before it is installed.
        progress: Called with the number of segment bytes that are done.

    Raises:
        LogLockedError: Somebody is writing.
        LogAccessError: The file system says no; what was done until then stays done.
        CorruptLogError: A segment is damaged, or its copy fails `check`; it stays as it is, and so
            do those after it.
    """
    folder = LogFolder.held(log)
    lock = WriterLock(folder)
    try:
        folder.remove_stale_files()
        reader = LogReader(folder)
        at_once = 0.0  # what was merged into other files holds what goes, too
        MergedFiles.of(reader.segments, reader.leftovers).remove(folder, at_once)
        return _trim(folder, select, check, progress)
    except LogAccessError:
        raise
    except OSError as error:
        problem = f"{log}: cannot be trimmed: {error.strerror or error}. Do it again."
        raise LogAccessError(problem) from error
    finally:
        lock.release()


def _trim(
    folder: LogFolder, select: Select, check: CheckCopy, progress: Progress | None
) -> Trimming:
    log = LogReader(folder)
    segments = [s for s in log.segments if s.closed and s.told is None]
    done, total = 0, sum(segment.size for segment in segments)
    found = Trimming()
    for sources, selection in _steps(segments, select):
        if selection is not None:
            with trimmed(folder, sources, selection) as copy:
                if copy.left.is_changed:
                    log = log.with_copy(copy.segment, sources)
                    check(log, copy.segment)
                    _install(folder, copy)
                    found = found.with_more(copy.left, copy.writer.size)
        done += sum(segment.size for segment in sources)
        if progress is not None:
            progress(done, total)
    closed = [s for s in LogReader(folder).segments if s.closed and s.told is None]
    write_bag_metadata(folder, [statistics_of(segment) for segment in closed])
    return found


def _steps(
    segments: Sequence[Segment], select: Select
) -> Iterator[tuple[tuple[Segment, ...], Selection | None]]:
    """Yield which segments are trimmed together: those from which all goes that can expire."""
    for selection, some in groupby(segments, select):
        if selection is not None and selection.reason is TrimReason.EXPIRED:
            yield tuple(some), selection
        else:
            yield from (((segment,), selection) for segment in some)


def _install(folder: LogFolder, copy: TrimmedCopy) -> None:
    """Put a copy in the place of its sources, as a merge does; at every instant there is a log."""
    others = {segment.path.name for segment in copy.left.sources[1:]}
    if others:
        stay = [s for s in LogReader(folder).segments if s.closed and s.told is None]
        listed = {s.path.name: statistics_of(s) for s in stay if s.path.name not in others}
        listed[copy.writer.name] = copy.writer.closed_segment()
        write_bag_metadata(folder, listed.values())
    copy.install()
    for name in sorted(others):
        folder.remove(name)
    folder.sync()


def count_selected(reader: LogReader, select: Select, progress: Progress | None = None) -> Trimming:
    """Return what `trim_segments` would take out of a log, the live segment included.

    Args:
        reader: Of the log.
        select: Says what would go.
        progress: Called with the number of segment bytes that are done.

    Raises:
        CorruptLogError: A segment is damaged.
    """
    done, total = 0, sum(segment.size for segment in reader.segments)
    found = Trimming(bytes_after=None)
    for sources, selection in _steps([s for s in reader.segments if s.told is None], select):
        if selection is not None:
            left = RemainingRecords(sources, selection)
            for _ in left.parts():
                pass
            if left.is_changed:
                found = found.with_more(left, None)
        done += sum(segment.size for segment in sources)
        if progress is not None:
            progress(done, total)
    return found


def takes_anything(reader: LogReader, select: Select) -> bool:
    """Return whether `trim_segments` would remove anything; reads up to the first such record.

    Args:
        reader: Of the log.
        select: Says what would go.

    Raises:
        CorruptLogError: A segment is damaged.
    """
    for sources, selection in _steps([s for s in reader.segments if s.told is None], select):
        if selection is not None:
            left = RemainingRecords(sources, selection)
            if any(left.is_changed for _ in left.parts()) or left.is_changed:
                return True
    return False


def told_of(
    reader: LogReader, *, before: int, rule: str, reason: TrimReason = TrimReason(0)
) -> HistoryTrimmed:
    """Return the event that says in a log what was taken out of it.

    Args:
        reader: Of the log, as it is without what was taken out.
        before: It was about events below this number.
        rule: What was taken out, in words.
        reason: Why, if the tombstones do not state it yet.

    Raises:
        CorruptLogError: A tombstone cannot be read.
    """
    found = taken_out(reader)
    names = [str(one.name).lower() for one in TrimReason if one & (found.reasons | reason)]
    return HistoryTrimmed(
        next_event=before,
        events_gone=found.events,
        notes_gone=found.notes,
        horizon=reader.horizon,
        reasons=", ".join(names),
        rule=rule,
        tombstones=of_log(reader, found.digest.hexdigest()),
    )


def of_log(reader: LogReader, digest: str) -> str:
    """Return a digest with the log that it is of: events go over into other logs."""
    return f"{reader.info.log_id}:{digest}"


def taken_out(reader: LogReader) -> TombstoneSum:
    """Return what the tombstones of a log state.

    Raises:
        CorruptLogError: One cannot be read.
    """
    found = TombstoneSum()
    for segment in reader.segments:
        for tombstone, record in tombstones(segment):
            found.add(tombstone, record)
    return found


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
        self.left = RemainingRecords(sources, selection)
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
