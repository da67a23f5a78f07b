"""The log being read: all segments as one order of events. Needs no lock and no write access."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semmap_log.commits import Commit
from semmap_log.errors import CorruptLogError, LogError
from semmap_log.event_batch import EventBatch, RecordedEvent
from semmap_log.events import Retracted
from semmap_log.log.chunks import StoredChunk
from semmap_log.log.header import LogInfo
from semmap_log.log.kind_bits import bits_of_kinds
from semmap_log.log.pages import Page
from semmap_log.log.reading.mapping import map_file
from semmap_log.log.reading.scan import Segment, open_segment, read_head
from semmap_log.log.reading.segment_folder import SegmentFolder, list_segments
from semmap_log.log.reading.segment_reading import (
    batches_of,
    commit_of,
    last_commit,
    page_at,
    pages_of,
)
from semmap_log.log.reading.segment_set import check_adjoins, check_counts, check_follows
from semmap_log.log.reading.window import EVERYTHING, Window
from semmap_log.log.walking import ChunkDamage
from semmap_log.projections.retraction import Retractions

Progress = Callable[[int, int], None]
"""Called with (bytes done, bytes in all)."""

OnPage = Callable[[Segment, Page], None]
"""Called with the records in which the events of the next batch lie."""


@dataclass(frozen=True, slots=True)
class Position:
    """A place between two chunks of a log."""

    segment: int
    chunk: int
    """The one behind it."""


BEGINNING = Position(0, 0)


class LogReader:
    """A log as it was when it was opened, or last refreshed."""

    def __init__(self, folder: Path, *, only: Path | None = None) -> None:
        """Open the log in that folder, or only one segment of it.

        Raises:
            NotALogError: There is none.
            CorruptLogError: A segment is damaged, missing, or from elsewhere.
            LogAccessError: A segment cannot be read.
        """
        self.folder = folder
        self._only = only
        self._files = SegmentFolder(folder)
        self.segments: list[Segment] = []
        self.leftovers: list[Path] = []
        """Files whose segments were merged into another: for the next writer to remove."""
        self._retractions: Retractions | None = None
        self._latest_ns: NDArray[np.int64] | None = None
        """Of each segment and those before it, the latest happened time."""
        self._are_counted = False
        self.refresh()

    def refreshed(self) -> LogReader:
        """Return the log as it is now; this object stays as it was, for who is reading with it.

        Raises:
            LogError: As `refresh`.
        """
        reader = copy(self)
        reader.refresh()
        return reader

    def refresh(self) -> None:
        """Take in what was written since; what is known is not read again.

        Raises:
            NotALogError: The log is gone.
            CorruptLogError: A segment is damaged, missing, or from elsewhere.
            LogAccessError: A segment cannot be read.
        """
        before = self.segments
        if self._only is not None:
            self.segments = [open_segment(self._only)]
        else:
            found = self._files.look()
            self.segments, self.leftovers = found.segments, found.leftovers
        if self.segments != before:
            self._retractions, self._latest_ns, self._are_counted = None, None, False

    @property
    def info(self) -> LogInfo:
        """What was fixed when the log was made."""
        return self.segments[0].header.info

    def pages(
        self, start: Position = BEGINNING, progress: Progress | None = None
    ) -> Iterator[tuple[Segment, Page]]:
        """Yield all records, in order, small chunks joined to pages of about a MiB.

        Raises:
            CorruptLogError: A chunk is not what was written, or a segment does not follow the last.
        """
        last: Page | None = None
        before: Segment | None = None
        passage = _Passage(self.segments[start.segment :], progress)
        for segment in self.segments[start.segment :]:
            if before is not None:
                commit = last.last_commit() if last is not None else None
                check_follows(segment, commit or last_commit(before), before)
            last = None
            for page in pages_of(segment, start.chunk if before is None else 0):
                yield segment, page
                last = page
                passage.reached(segment, page)
            passage.passed(segment, is_read=True)
            before = segment

    def batches(
        self,
        window: Window = EVERYTHING,
        *,
        start: Position = BEGINNING,
        progress: Progress | None = None,
        on_page: OnPage | None = None,
    ) -> Iterator[EventBatch]:
        """Yield the events of a window, numbers ascending, retracted ones included.

        What cannot hold any is not read.

        Args:
            window: Which events.
            start: What comes before is not looked at.
            progress: Told how far the reading is.
            on_page: Called with the records of each batch that follows.

        Raises:
            CorruptLogError: A chunk is not what was written, or events are missing.
        """
        self._check_counts()
        passage = _Passage(self.segments[start.segment :], progress)
        last: Page | None = None
        for place in range(start.segment, len(self.segments)):
            segment, last_before, last = self.segments[place], last, None
            if window.may_reach(segment, self._next_event(place)):
                if place > start.segment:
                    self._check_order(place, last_before)
                chunks = window.chunks(segment)
                if place == start.segment:
                    chunks = chunks[chunks >= start.chunk]
                for page, batch in batches_of(segment, chunks):
                    chosen = window.choose(batch)
                    if len(chosen):
                        if on_page is not None:
                            on_page(segment, page)
                        yield chosen
                    passage.reached(segment, page)
                    last = page
            passage.passed(segment, is_read=last is not None)

    def commits(self, first_segment: int = 0) -> Iterator[Commit]:
        """Yield the commits of the whole log, in order, each checked to follow the one before.

        Raises:
            CorruptLogError: One does not, or cannot be read.
        """
        previous = self.segments[first_segment].header.hash_so_far
        for segment, page in self.pages(Position(first_segment, 0)):
            for commit in page.commits():
                if commit.previous_hash != previous:
                    problem = f"the commit of event {commit.first_event} does not follow the last"
                    raise CorruptLogError(segment.path, page.offset, problem)
                previous = commit.hash
                yield commit

    def last_commit(self) -> Commit | None:
        """Return the log's last commit; None in a log without any."""
        return next((c for s in reversed(self.segments) if (c := last_commit(s))), None)

    def last_log_time_ns(self) -> int:
        """Return the log time of the last record, keyframes included; 0 in an empty log."""
        for segment in reversed(self.segments):
            if len(segment.chunks):
                return int(page_at(segment, len(segment.chunks) - 1).heads["log_time"].max())
        return 0

    def event_known_at(self, known_at_ns: int) -> int:
        """Return the last event number known at that recorded time, whole commits; -1: none.

        A commit is known from the log time of its first record on.
        """
        places = range(len(self.segments))
        early = bisect_right(places, known_at_ns, key=self._start_ns)
        for segment in reversed(self.segments[:early]):
            for chunk in reversed(range(segment.chunks.starting_by(known_at_ns))):
                page = page_at(segment, chunk)
                numbers = page.event_numbers(recorded_by_ns=known_at_ns)
                if len(numbers):
                    last = int(numbers[-1])
                    commit = page.commit_holding(last) or commit_of(segment, last)
                    if commit is not None:
                        return commit.last_event
        return -1

    def event(self, number: int) -> RecordedEvent:
        """Return the event of that number.

        Raises:
            LogError: There is none.
        """
        for batch in self.batches(Window(first_event=number, before_event=number + 1)):
            (recorded,) = batch
            return recorded
        raise self._no_event(number)

    def commit_at(self, number: int) -> Commit:
        """Return the commit that holds an event, with its note.

        Raises:
            LogError: There is no such event.
        """
        place = self.segment_of(number)
        commit = None if place is None else commit_of(self._among_neighbours(place), number)
        if commit is None:
            raise self._no_event(number)
        return commit

    def _no_event(self, number: int) -> LogError:
        return LogError(f"{self.folder}: there is no event {number}.")

    def segment_of(self, number: int) -> int | None:
        """Return the place of the segment that holds an event, or would; None: none begins yet."""
        behind = bisect_right(self.segments, number, key=lambda s: s.header.first_event)
        return behind - 1 if behind else None

    def _among_neighbours(self, place: int) -> Segment:
        """Return a segment that fits the one before and the one behind it.

        Raises:
            CorruptLogError: It does not.
        """
        for before, segment in pairwise(self.segments[max(0, place - 1) : place + 2]):
            check_adjoins(segment, before)
        return self.segments[place]

    def _start_ns(self, place: int) -> int:
        """Return the log time of a segment's first record."""
        rows = self._among_neighbours(place).chunks.rows
        return int(rows["start_ns"][0]) if len(rows) else 0

    def retractions(self, *, limit: int | None = None) -> Retractions:
        """Return what was taken back by the events up to the number `limit`."""
        if self._retractions is None:
            found = Retractions()
            for batch in self.batches(Window(kinds=bits_of_kinds([Retracted]))):
                found.apply(batch)
            self._retractions = found  # once it is whole: others ask, and reading may be cut short
        return self._retractions if limit is None else self._retractions.up_to(limit)

    def segments_by(self, at_ns: int) -> int:
        """Return the place of the last segment before which all events had happened by then."""
        if self._latest_ns is None:
            greatest = [segment.span[1] for segment in self.segments]
            self._latest_ns = np.maximum.accumulate(np.array(greatest, np.int64))
        by = int(np.searchsorted(self._latest_ns, at_ns, "right"))
        return min(by, len(self.segments) - 1)

    def _next_event(self, place: int) -> int | None:
        """Return the number of the first event behind a segment; None: it is the last."""
        if place + 1 < len(self.segments):
            return self.segments[place + 1].header.first_event
        return None

    def _check_order(self, place: int, last: Page | None) -> None:
        """Check that a segment follows the one before it, by hash if that one's end was read.

        Args:
            place: Its own.
            last: The last page that was read of the one before; None: none was.
        """
        segment, before = self.segments[place], self.segments[place - 1]
        commit = None if last is None else last.last_commit()
        if commit is not None and commit.last_event + 1 == segment.header.first_event:
            check_follows(segment, commit, before)
        else:
            check_adjoins(segment, before)

    def _check_counts(self) -> None:
        """Check that each segment holds all events up to the next one, as far as is counted."""
        if not self._are_counted:
            for before, segment in pairwise(self.segments):
                check_counts(segment, before)
            self._are_counted = True


MOST_MAPPED = 2**24
"""So much of what was read of mapped files stays on the process's account."""


class _Passage:
    """How far the reading of segments, one behind the other, has come."""

    def __init__(self, segments: Sequence[Segment], progress: Progress | None) -> None:
        self._progress = progress
        self._done = 0
        """Bytes of the segments that were passed."""
        self._todo = sum(len(segment.file) for segment in segments) if progress else 0
        self._kept_from = 0
        """In the segment that is read: what lies before was let go of."""

    def reached(self, segment: Segment, page: Page) -> None:
        """Take note of a page that was used, and all before it."""
        if page.offset - self._kept_from > MOST_MAPPED:
            segment.mapped.let_go(self._kept_from, page.offset)
            self._kept_from = page.offset
        if self._progress:
            self._progress(self._done + page.offset, self._todo)

    def passed(self, segment: Segment, *, is_read: bool) -> None:
        """Take note of a segment's end."""
        self._done += len(segment.file)
        if is_read and self._done > MOST_MAPPED:
            segment.mapped.let_go(self._kept_from, len(segment.file))
        self._kept_from = 0
        if self._progress:
            self._progress(self._done, self._todo)


def segment_paths(folder: Path) -> list[Path]:
    """Return the segment files of a log, by name.

    Raises:
        NotALogError: There is no folder, or no segment in it.
        LogAccessError: It cannot be read.
    """
    return [folder / name for name, _ in list_segments(folder)]


def check_is_log(folder: Path) -> None:
    """Return if a segment of ours lies in a folder: then it is a log's, however damaged.

    Raises:
        NotALogError: There is none.
        CorruptLogError: All there are are damaged in their heads.
        LogAccessError: They cannot be read.
    """
    *others, last = segment_paths(folder)
    for path in others:
        with suppress(LogError):
            read_head(path, map_file(path).data)
            return
    read_head(last, map_file(last).data)


def read_chunk(segment: Segment, chunk: StoredChunk) -> bytes | memoryview:
    """Return a chunk's records, CRC checked.

    Raises:
        CorruptLogError: They are not what was written.
    """
    try:
        return chunk.records(segment.file)
    except ChunkDamage as damage:
        raise CorruptLogError(segment.path, chunk.offset, str(damage)) from None
