"""The log being read: all segments as one order of events. Needs no lock and no write access."""

from __future__ import annotations

import stat
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from semmap_log.commits import Commit, Note
from semmap_log.errors import CorruptLogError, LogAccessError, LogError, NotALogError
from semmap_log.event_batch import EventBatch, RecordedEvent
from semmap_log.events import Retracted
from semmap_log.log import keyframes
from semmap_log.log.bag_metadata import statistics_of
from semmap_log.log.chunks import ChunkDamage, StoredChunk
from semmap_log.log.form import CHUNK_BYTES
from semmap_log.log.header import LogInfo
from semmap_log.log.pages import Page
from semmap_log.log.scan import Segment, map_file, open_segment, read_head
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
            CorruptLogError: A segment is damaged.
            LogAccessError: A segment cannot be read.
        """
        self.folder = folder
        self._only = only
        self._known: dict[tuple[str, int, int], Segment] = {}
        self.segments: list[Segment] = []
        self.refresh()

    def refresh(self) -> None:
        """Take in what was written since; closed segments that are known are not read again."""
        paths = [self._only] if self._only else segment_paths(self.folder)
        known: dict[tuple[str, int, int], Segment] = {}
        for path in paths:
            try:
                status = path.stat()
            except OSError as error:
                raise LogAccessError(f"{path}: cannot be read: {error.strerror}.") from error
            key = (path.name, status.st_ino, status.st_size)
            known[key] = self._known.get(key) or open_segment(path)
        self._known = known
        self.segments = sorted(
            known.values(), key=lambda s: (s.header.first_event, s.header.number)
        )
        if self._only is None:
            _check_complete(self.folder, self.segments)

    @property
    def info(self) -> LogInfo:
        """What was fixed when the log was made."""
        return self.segments[0].header.info

    def pages(
        self, first_segment: int = 0, progress: Progress | None = None
    ) -> Iterator[tuple[Segment, Page]]:
        """Yield all records, in order, small chunks joined to pages of about a MiB.

        Raises:
            CorruptLogError: A chunk is not what was written.
        """
        todo = sum(chunk.length for s in self.segments[first_segment:] for chunk in s.chunks)
        done = 0
        for segment in self.segments[first_segment:]:
            for chunks in _groups(segment.chunks):
                yield segment, _page(segment, chunks)
                done += sum(chunk.length for chunk in chunks)
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
            if batch.number[0] != expected or batch.number[-1] != expected + len(batch) - 1:
                raise CorruptLogError(
                    segment.path,
                    0,
                    f"expected event {expected} next, got {int(batch.number[0])}; "
                    "a segment is missing, or from another log",
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
        for segment in reversed(self.segments):
            for chunk in reversed(segment.chunks):
                commits = _chunk_page(segment, chunk).commits()
                if commits:
                    return commits[-1]
        return None

    def last_log_time_ns(self) -> int:
        """Return the log time of the last record, keyframes included; 0 in an empty log."""
        for segment in reversed(self.segments):
            if segment.chunks:
                page = _chunk_page(segment, segment.chunks[-1])
                return int(page.heads["log_time"].max())
        return 0

    def event_known_at(self, known_at_ns: int) -> int:
        """Return the last event number known at that recorded time, whole commits; -1: none.

        A commit is known from the log time of its first record on.
        """
        found = -1
        for segment in reversed(self.segments):
            early = [i for i, chunk in enumerate(segment.chunks) if chunk.start_ns <= known_at_ns]
            for i in reversed(early):
                page = _chunk_page(segment, segment.chunks[i])
                batch = page.events()
                known = batch.number[batch.recorded_ns <= known_at_ns]
                if len(known):
                    found = int(known[-1])
                    return self._commit_of(segment, i, found).last_event
        return found

    def event(self, number: int) -> RecordedEvent:
        """Return the event of that number.

        Raises:
            LogError: There is none.
        """
        segment, i = self._chunk_of(number)
        batch = _chunk_page(segment, segment.chunks[i]).events()
        (recorded,) = batch.select(batch.number == number)
        return recorded

    def said_about(self, number: int) -> tuple[Note, bytes]:
        """Return the note and the command id of the commit that holds an event.

        Raises:
            LogError: There is no such event.
        """
        commit = self._commit_of(*self._chunk_of(number), number)
        return commit.note, commit.command_id

    def _chunk_of(self, number: int) -> tuple[Segment, int]:
        """Return the segment and the place of the chunk that holds an event."""
        behind = bisect_right(self.segments, number, key=lambda s: s.header.first_event)
        for segment in reversed(self.segments[:behind]):
            first = bisect_right(segment.chunks, number, key=lambda c: _first_number(segment, c))
            for i in reversed(range(first)):
                batch = _chunk_page(segment, segment.chunks[i]).events()
                if len(batch) and batch.number[-1] < number:
                    break
                if len(batch):
                    return segment, i
        raise LogError(f"{self.folder}: there is no event {number}.")

    def retractions(self, *, limit: int | None = None) -> Retractions:
        """Return what was taken back by the events up to the number `limit`."""
        retractions = Retractions()
        for segment in self.segments:
            if segment.closed:
                counts = statistics_of(segment.path, segment.file).counts
                if not counts.get(Retracted.kind):
                    continue
            for chunk in segment.chunks:
                page = _chunk_page(segment, chunk)
                if (page.heads["channel_id"] == Retracted.kind).any():
                    batch = page.events()
                    retractions.apply(
                        batch if limit is None else batch.select(batch.number <= limit)
                    )
        return retractions

    def keyframe(self, segment: Segment) -> DoorMapState | None:
        """Return the state at a segment's head; None if its keyframe cannot be used."""
        if not segment.chunks:
            return None
        stored = _chunk_page(segment, segment.chunks[0]).keyframes()
        return keyframes.decode(stored[0]) if stored else None

    def _commit_of(self, segment: Segment, first_chunk: int, event: int) -> Commit:
        """Return the commit that holds `event`, looking from a chunk on."""
        for chunk in segment.chunks[first_chunk:]:
            for commit in _chunk_page(segment, chunk).commits():
                if commit.last_event >= event:
                    return commit
        raise CorruptLogError(segment.path, 0, f"event {event} belongs to no commit")


def _check_complete(folder: Path, segments: Sequence[Segment]) -> None:
    """Check what the heads of the segments say: all of one log, none missing, one live at most.

    Raises:
        CorruptLogError: Names the segment at which something is wrong.
    """
    ids = {segment.header.info.log_id for segment in segments}
    if len(ids) > 1:
        raise CorruptLogError(folder, 0, f"segments of {len(ids)} logs lie in one folder")
    number = 0
    for segment in segments:
        found = segment.header.number
        if found != number:
            problem = f"expected segment {number} of the log next, got segment {found}"
            hint = "it is there twice" if found < number else "one is missing"
            raise CorruptLogError(segment.path, 0, f"{problem}: {hint}")
        if not segment.closed and segment is not segments[-1]:
            problem = "not closed, and segments follow it: it was cut"
            raise CorruptLogError(segment.path, segment.whole_end, problem)
        number = segment.header.last_number + 1


def segment_paths(folder: Path) -> list[Path]:
    """Return the segment files of a log, by name.

    Raises:
        NotALogError: There is no folder, or no segment in it.
    """
    try:
        status = folder.stat()
    except FileNotFoundError:
        message = f"{folder}: no such log. To make one: semmap-log init {folder}"
        raise NotALogError(message) from None
    except OSError as error:
        raise LogAccessError(f"{folder}: cannot be read: {error.strerror}.") from error
    if not stat.S_ISDIR(status.st_mode):
        raise NotALogError(f"{folder}: a log is a folder, this is a file.")
    paths = sorted(folder.glob("*.mcap"))
    if not paths:
        raise NotALogError(f"{folder}: a folder without segments (*.mcap), so not a log.")
    return paths


def check_is_log(folder: Path) -> None:
    """Return if the folder's segments are a log's, by a look at their heads alone.

    Raises:
        NotALogError: There is no log, or one file is not of it.
    """
    for path in segment_paths(folder):
        read_head(path, map_file(path))


def read_chunk(segment: Segment, chunk: StoredChunk) -> bytes | memoryview:
    """Return a chunk's records, CRC checked.

    Raises:
        CorruptLogError: They are not what was written.
    """
    try:
        return chunk.records(segment.file)
    except ChunkDamage as damage:
        raise CorruptLogError(segment.path, chunk.offset, str(damage)) from None


def _first_number(segment: Segment, chunk: StoredChunk) -> int:
    """Return the event number of a chunk's first record (a keyframe: of the last event in it)."""
    page = _chunk_page(segment, chunk)
    after_first = int(page.heads["sequence"][0]) - (segment.header.first_event - 1)
    return (after_first & 0xFFFF_FFFF) + segment.header.first_event - 1


def _groups(chunks: Sequence[StoredChunk]) -> Iterator[list[StoredChunk]]:
    """Yield chunks in groups of about a MiB of records: small ones are read together."""
    group: list[StoredChunk] = []
    size = 0
    for chunk in chunks:
        group.append(chunk)
        size += chunk.size
        if size >= CHUNK_BYTES:
            yield group
            group, size = [], 0
    if group:
        yield group


def _chunk_page(segment: Segment, chunk: StoredChunk) -> Page:
    return _page(segment, [chunk])


def _page(segment: Segment, chunks: list[StoredChunk]) -> Page:
    parts = [read_chunk(segment, chunk) for chunk in chunks]
    records = parts[0] if len(parts) == 1 else b"".join(parts)
    return Page(records, segment.header.first_event, segment.path, chunks[0].offset)
