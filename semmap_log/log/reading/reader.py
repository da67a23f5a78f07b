"""The log being read: all segments as one order of events. Needs no lock and no write access."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import numpy as np

from semmap_log.commits import Commit, Note
from semmap_log.errors import CorruptLogError, LogError
from semmap_log.event_batch import EventBatch, RecordedEvent
from semmap_log.events import Retracted
from semmap_log.log import keyframes
from semmap_log.log.chunks import ChunkDamage, StoredChunk
from semmap_log.log.header import LogInfo
from semmap_log.log.pages import Page
from semmap_log.log.reading.mapping import map_file
from semmap_log.log.reading.scan import Segment, open_segment, read_head
from semmap_log.log.reading.segment_folder import SegmentFolder, list_segments
from semmap_log.log.reading.segment_reading import (
    chunk_of,
    commit_of,
    last_commit,
    page_at,
    pages_of,
)
from semmap_log.log.reading.segment_set import check_adjoins, check_counts, check_follows
from semmap_log.projections.door_map import DoorMapState
from semmap_log.projections.retraction import Retractions

Progress = Callable[[int, int], None]
"""Called with (bytes done, bytes in all)."""


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
        self.refresh()

    def refresh(self) -> None:
        """Take in what was written since; what is known is not read again.

        Raises:
            NotALogError: The log is gone.
            CorruptLogError: A segment is damaged, missing, or from elsewhere.
            LogAccessError: A segment cannot be read.
        """
        if self._only is not None:
            self.segments = [open_segment(self._only)]
            return
        found = self._files.look()
        self.segments, self.leftovers = found.segments, found.leftovers

    @property
    def info(self) -> LogInfo:
        """What was fixed when the log was made."""
        return self.segments[0].header.info

    def pages(
        self, first_segment: int = 0, progress: Progress | None = None, *, first_chunk: int = 0
    ) -> Iterator[tuple[Segment, Page]]:
        """Yield all records, in order, small chunks joined to pages of about a MiB.

        Raises:
            CorruptLogError: A chunk is not what was written, or a segment does not follow the last.
        """
        segments = self.segments[first_segment:]
        todo = sum(len(segment.file) for segment in segments)
        done = 0
        last: Page | None = None
        for i, segment in enumerate(segments):
            if i > 0:
                before = segments[i - 1]
                commit = last.last_commit() if last is not None else None
                check_follows(segment, commit or last_commit(before), before)
            last = None
            for page in pages_of(segment, first_chunk if i == 0 else 0):
                yield segment, page
                last = page
                if progress:
                    progress(done + page.offset, todo)
            done += len(segment.file)
        if progress:
            progress(done, todo)

    def batches(
        self, *, limit: int | None = None, first_segment: int = 0, progress: Progress | None = None
    ) -> Iterator[EventBatch]:
        """Yield all events up to the event number `limit`, retracted ones included.

        Raises:
            CorruptLogError: A chunk is not what was written, or events are missing.
        """
        expected = self.segments[first_segment].header.first_event
        for segment, page in self.pages(first_segment, progress):
            batch = page.events()
            if not len(batch):
                continue
            if batch.number[0] != expected or (np.diff(batch.number) != 1).any():
                raise CorruptLogError(
                    segment.path,
                    page.offset,
                    f"expected event {expected} next, got {int(batch.number[0])} or a later gap",
                )
            expected += len(batch)
            if limit is not None and batch.number[-1] >= limit:
                if batch.number[0] <= limit:
                    yield batch.select(batch.number <= limit)
                return
            yield batch

    def commits(self, first_segment: int = 0) -> Iterator[Commit]:
        """Yield the commits of the whole log, in order, each checked to follow the one before.

        Raises:
            CorruptLogError: One does not, or cannot be read.
        """
        previous = self.segments[first_segment].header.hash_so_far
        for segment, page in self.pages(first_segment):
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
                    return self._commit_of(segment, int(numbers[-1])).last_event
        return -1

    def event(self, number: int) -> RecordedEvent:
        """Return the event of that number.

        Raises:
            LogError: There is none.
        """
        segment, chunk = self._chunk_of(number)
        batch = page_at(segment, chunk).events()
        (recorded,) = batch.select(batch.number == number)
        return recorded

    def said_about(self, number: int) -> tuple[Note, bytes]:
        """Return the note and the command id of the commit that holds an event.

        Raises:
            LogError: There is no such event.
        """
        segment, _ = self._chunk_of(number)
        commit = self._commit_of(segment, number)
        return commit.note, commit.command_id

    def segment_of(self, number: int) -> int | None:
        """Return the place of the segment that holds an event, or would; None: none begins yet."""
        behind = bisect_right(self.segments, number, key=lambda s: s.header.first_event)
        return behind - 1 if behind else None

    def _chunk_of(self, number: int) -> tuple[Segment, int]:
        """Return the segment and the place of the chunk that holds an event."""
        place = self.segment_of(number)
        if place is not None:
            segment = self._among_neighbours(place)
            chunk = chunk_of(segment, number)
            if chunk is not None:
                return segment, chunk
        raise LogError(f"{self.folder}: there is no event {number}.")

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
        retractions = Retractions()
        for before, segment in zip([None, *self.segments], self.segments, strict=False):
            if before is not None:
                check_counts(segment, before)
            if segment.counts is not None and not segment.counts.get(Retracted.kind):
                continue
            for page in pages_of(segment):
                if (page.heads["channel_id"] == Retracted.kind).any():
                    batch = page.events()
                    retractions.apply(
                        batch if limit is None else batch.select(batch.number <= limit)
                    )
        return retractions

    def keyframe(self, segment: Segment) -> DoorMapState | None:
        """Return the state at a segment's head; None if its keyframe cannot be used."""
        if not len(segment.chunks):
            return None
        stored = page_at(segment, 0).keyframes()
        return keyframes.decode(stored[0]) if stored else None

    def _commit_of(self, segment: Segment, event: int) -> Commit:
        commit = commit_of(segment, event)
        if commit is None:
            raise CorruptLogError(segment.path, 0, f"event {event} belongs to no commit")
        return commit


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
