"""The log being read: all segments as one order of events. Needs no lock and no write access."""

from __future__ import annotations

import warnings
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterator, Sequence
from copy import copy
from itertools import pairwise
from pathlib import Path, PurePath
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch, RecordedEvent, Retractions
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.commits import Commit
from semmap_log.core.model.events import MAX_EVENT, Retracted
from semmap_log.core.model.moments import format_utc
from semmap_log.errors import CorruptLogError, HorizonError, HorizonWarning, LogError
from semmap_log.store.folder import LogFolder
from semmap_log.store.header import LogInfo, TrimReason
from semmap_log.store.pages import (
    COMMIT_BIT,
    EVENT_BITS,
    EXPIRING_BITS,
    KEYFRAME_BIT,
    Page,
    kinds_mask,
)
from semmap_log.store.reading.newer_events import (
    NewerEvents,
    ReadProgress,
    SegmentsAhead,
    without_newer,
)
from semmap_log.store.reading.segment_folder import SegmentFolder, store_at
from semmap_log.store.reading.segment_reading import (
    PageAtHand,
    batches_of,
    commit_of,
    end_of,
    last_commit,
    page_at,
    pages_of,
)
from semmap_log.store.reading.segment_scan import Segment, open_segment
from semmap_log.store.reading.segment_set import SegmentStore, check_adjoins, check_follows
from semmap_log.store.reading.window import EVERYTHING, Window

OnPage = Callable[[Segment, Page], None]
"""Called with the records in which the events of the next batch lie."""


class ChunkPlace(NamedTuple):
    """A place between two chunks of a log."""

    segment: int
    chunk: int
    """The chunk after it."""


BEGINNING = ChunkPlace(0, 0)


class LogReader:
    """A log as it was when it was opened, or last refreshed."""

    def __init__(
        self, place: LogFolder | PurePath | SegmentStore, *, only: Path | None = None
    ) -> None:
        """Open the log in a folder, or in another place.

        Args:
            place: Where it lies.
            only: A file, if only one segment of it is wanted.

        Raises:
            NotALogError: There is no log.
            CorruptLogError: A segment is damaged, missing, or from elsewhere.
            LogAccessError: A segment cannot be read.
        """
        self._store = store_at(place)
        self._only = only
        self._files = SegmentFolder(self._store)
        self.segments: list[Segment] = []
        self.leftovers: list[PurePath] = []
        """Files whose segments were merged into another: for the next writer to remove."""
        self._retractions: Retractions | None = None
        self._newer: NewerEvents | None = None
        self._has_warned = self._has_warned_of_horizon = False
        """Whether the user was warned that events of a later version are left out."""
        self._latest_ns: NDArray[np.int64] | None = None
        """Of each segment and those before it, the latest happened time."""
        self._is_in_order = False
        self._at_hand: PageAtHand | None = None
        """What finding out what was known has read: the next question is mostly about that."""
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
            LogError: Another log lies there now.
        """
        if self._only is not None:
            segments = [open_segment(self._only)]
        else:
            found = self._files.look()
            self._check_same_log(found.segments[0])
            segments, self.leftovers = found.segments, found.leftovers
        if self.segments != segments:
            self._set_segments(segments)

    def with_copy(self, copied: Segment, sources: Sequence[Segment]) -> LogReader:
        """Return the log with the copy of adjacent segments in their place."""
        reader = copy(self)
        first = self.segments.index(sources[0])
        reader._set_segments(  # noqa: SLF001 - a reader, too
            [*self.segments[:first], copied, *self.segments[first + len(sources) :]]
        )
        return reader

    def _set_segments(self, segments: list[Segment]) -> None:
        self.segments = segments
        self._retractions, self._newer = None, None
        self._latest_ns, self._is_in_order = None, False

    def anew(self) -> LogReader:
        """Return another reader of the same log, as it is now; what was read is read again.

        Raises:
            LogError: As for a first one.
        """
        return LogReader(self._store, only=self._only)

    @property
    def folder(self) -> PurePath:
        """The log's folder, as it was given: for messages."""
        return self._store.path

    @property
    def given(self) -> PurePath:
        """The same, whatever becomes of the working directory."""
        return self._store.given

    @property
    def info(self) -> LogInfo:
        """What was fixed when the log was made."""
        return self.segments[0].header.info

    def pages(
        self, start: ChunkPlace = BEGINNING, progress: Progress | None = None
    ) -> Iterator[tuple[Segment, Page]]:
        """Yield all records, in order, in pages of a few MiB.

        Raises:
            CorruptLogError: A chunk is not what was written, or a segment does not follow the last.
        """
        self._check_order()
        last: Page | None = None
        before: Segment | None = None
        reading = ReadProgress(self.segments[start.segment :], progress)
        ahead = SegmentsAhead(self.segments, lambda _: True, takes_all=True)
        for place, segment in enumerate(self.segments[start.segment :], start.segment):
            ahead.at(place)
            if before is not None:
                commit = last.last_commit() if last is not None else None
                check_follows(segment, commit or last_commit(before), before)
            last = None
            for page in pages_of(segment, start.chunk if before is None else 0):
                yield segment, page
                last = page
                reading.reached(segment, page)
            reading.passed(segment, is_read=True)
            before = segment

    def batches(
        self,
        window: Window = EVERYTHING,
        *,
        start: ChunkPlace = BEGINNING,
        doors: Collection[int] | None = None,
        progress: Progress | None = None,
        on_page: OnPage | None = None,
        with_newer: bool = False,
        is_part: bool = False,
    ) -> Iterator[EventBatch]:
        """Yield the events of a window, numbers ascending, retracted ones included.

        Chunks that cannot contain any are not read. Whether events of kinds unknown here touch the
        question is not checked: `check_known` does that.

        Args:
            window: Which events.
            start: What comes before is not read.
            doors: Events about others may be left out, which saves reading their columns.
            progress: Called with the progress of the reading.
            on_page: Called with the records of each batch that follows.
            with_newer: Yield events of unknown kinds, too.
            is_part: Whether it is part of a question for which `check_horizon` was called.

        Raises:
            CorruptLogError: A chunk is not what was written, or events are missing.
            HorizonError: Some were taken out, since they were older than the log is kept.
        """
        self._check_order()
        if self.horizon and not is_part and start <= self.horizon_place():
            self.check_horizon(window)
        reading = ReadProgress(self.segments[start.segment :], progress)
        last: Page | None = None

        def is_wanted(place: int) -> bool:
            return window.may_reach(self.segments[place], self._next_event(place))

        ahead = SegmentsAhead(self.segments, is_wanted, takes_all=window == EVERYTHING)
        at_hand, self._at_hand = self._at_hand, None  # kept for one question, not for ever
        for place in range(start.segment, len(self.segments)):
            segment, last_before, last = self.segments[place], last, None
            if is_wanted(place):
                ahead.at(place)
                if last_before is not None:
                    self._check_follows(place, last_before)
                chunks = window.chunks(segment)
                if place == start.segment:
                    chunks = chunks[chunks >= start.chunk]
                for page, batch in batches_of(segment, chunks, doors=doors, at_hand=at_hand):
                    chosen = window.choose(batch if with_newer else without_newer(batch))
                    if len(chosen):
                        if on_page is not None:
                            on_page(segment, page)
                        yield chosen
                    reading.reached(segment, page)
                    last = page
            reading.passed(segment, is_read=last is not None)

    def commits(self, first_segment: int = 0) -> Iterator[Commit]:
        """Yield the commits of the whole log, in order, each checked to follow the one before.

        Raises:
            CorruptLogError: One does not, or cannot be read.
        """
        previous = self.segments[first_segment].header.hash_so_far
        for segment, page in self.pages(ChunkPlace(first_segment, 0)):
            may_lack = segment.header.trimmed is not None
            for commit in page.commits():
                if commit.previous_hash != previous and not may_lack:
                    problem = f"the commit of event {commit.first_event} does not follow the last"
                    raise CorruptLogError(segment.path, page.offset, problem)
                previous = commit.hash
                yield commit

    def last_commit(self) -> Commit | None:
        """Return the log's last commit; None in a log without any."""
        return next((c for s in reversed(self.segments) if (c := last_commit(s))), None)

    def last_event(self) -> int:
        """Return the number of the log's last event; -1: there is none. No chunk is read for it."""
        return end_of(self.segments[-1]) - 1

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
        self._check_order()
        if self.horizon and known_at_ns < self.horizon_ns:
            raise self.horizon_error()
        expired = self.horizon - 1  # all of that was known by then, whatever is left of it
        early = bisect_right(self.segments, known_at_ns, key=lambda s: s.recorded[0])
        for segment in reversed(self.segments[:early]):
            found = self._known_in(segment, known_at_ns)
            if segment.header.trimmed is not None:  # the first record may be gone
                found = max(found, _known_by_commits(segment, known_at_ns))
            if found >= 0:
                return max(found, expired)
        return expired

    def _known_in(self, segment: Segment, known_at_ns: int) -> int:
        """Return the last event of a segment whose commit has a record by then; -1: none."""
        with_events = segment.chunks[: segment.chunks.starting_by(known_at_ns)].having(EVENT_BITS)
        for chunk in reversed(with_events.tolist()):
            page = page_at(segment, chunk)
            numbers = page.event_numbers(recorded_by_ns=known_at_ns)
            if len(numbers):
                last = int(numbers[-1])
                commit = page.commit_holding(last) or commit_of(segment, last)
                if commit is not None:
                    self._at_hand = PageAtHand(segment, chunk, page)
                    return commit.last_event
        return -1

    def event(self, number: int) -> RecordedEvent:
        """Return the event of that number.

        Raises:
            LogError: There is no such event.
        """
        for batch in self.batches(self.window_of(number), with_newer=True):
            (recorded,) = batch
            return recorded
        raise self.no_event(number)

    def window_of(self, first: int, last: int | None = None) -> Window:
        """Return the window of one event, or of several; those left before the horizon included."""
        end = (first if last is None else last) + 1
        return Window(first_event=first, before_event=end, is_of_numbers=True)

    def commit_at(self, number: int) -> Commit:
        """Return the commit that holds an event, with its note.

        Raises:
            LogError: There is no such event.
        """
        commit = self.find_commit(number)
        if commit is None:
            raise self.no_event(number)
        return commit

    def find_commit(self, number: int) -> Commit | None:
        """Return the same; None: there is no such event."""
        self._check_order()
        place = self.segment_of(number)
        return None if place is None else commit_of(self.segments[place], number)

    def no_event(self, number: int) -> LogError:
        """Return the error that there is no event of that number, and which is the last."""
        last = self.last_event()
        if 0 <= number < self.horizon:
            return self.horizon_error()
        if 0 <= number <= last:
            return LogError(f"{self.folder}: event {number} was taken out of the log on purpose.")
        there = "the log has none yet" if last < 0 else f"the last is event {last}"
        return LogError(f"{self.folder}: there is no event {number}; {there}.")

    def segment_of(self, number: int) -> int | None:
        """Return the place of the segment that holds an event, or would; None: none begins yet."""
        behind = bisect_right(self.segments, number, key=lambda s: s.header.first_event)
        return behind - 1 if behind else None

    @property
    def horizon(self) -> int:
        """Number of the first event that can be queried; 0: all can."""
        trimmed = self.segments[0].header.trimmed
        return 0 if trimmed is None else trimmed.horizon

    @property
    def horizon_ns(self) -> int:
        """When the last commit before the horizon was closed; -1: all can be queried.

        This moment itself can be queried: the keyframe at the horizon is the state of it, and what
        is gone was recorded, and counted, earlier.
        """
        if not self.horizon:
            return -1
        place = self.horizon_place()
        if not place.chunk:
            return self.segments[0].recorded[1]
        return int(self.segments[place.segment].chunks.rows["end_ns"][place.chunk - 1])

    def horizon_place(self) -> ChunkPlace:
        """Return the place of the keyframe that holds the state at the horizon.

        Raises:
            CorruptLogError: It is not there.
        """
        base = self.segments[0]
        if self.horizon == end_of(base) and len(self.segments) > 1:
            return ChunkPlace(1, 0)
        is_keyframe = base.chunks.rows["kinds"] == KEYFRAME_BIT
        found = np.flatnonzero(is_keyframe & (base.next_events == self.horizon))
        if not len(found):
            problem = f"the keyframe before event {self.horizon}, its horizon, is not there"
            raise CorruptLogError(base.path, None, problem)
        return ChunkPlace(0, int(found[0]))

    @property
    def first_whole_event(self) -> int:
        """Number of the first event after all that was thinned or is no longer kept."""
        lost = TrimReason.THINNED | TrimReason.EXPIRED
        ends = [s.header.trimmed.next_event for s in self.segments
                if s.header.trimmed is not None and s.header.trimmed.reasons & lost]  # fmt: skip
        return max(ends, default=0)

    def check_horizon(self, window: Window) -> None:
        """Check that a question can be answered by what is left of the log; warn if some is gone.

        One that names no beginning, or wants only what is kept, is about what there is.

        Raises:
            HorizonError: It begins, or ends, before the horizon.
        """
        if not self._reaches_before(window):
            return
        ends = (window.before_event or MAX_EVENT) < self.horizon or any(
            end is not None and end <= self.horizon_ns
            for end in (window.happened_before_ns, window.recorded_before_ns)
        )
        if not window.only_kept and (ends or window.has_beginning):
            raise self.horizon_error()
        if not self._has_warned_of_horizon:
            self._has_warned_of_horizon = True
            warnings.warn(HorizonWarning(f"{self.folder}: {self._horizon_words()}."), stacklevel=3)

    def check_reaches_horizon(self, start: ChunkPlace) -> None:
        """Check that nothing after a place is gone because of its age.

        Raises:
            HorizonError: Something is.
        """
        if self.horizon and start <= self.horizon_place():
            raise self.horizon_error()

    def _reaches_before(self, window: Window) -> bool:
        return (
            not window.is_of_numbers
            and (window.first_event or 0) < self.horizon
            and bool(window.kinds & EXPIRING_BITS)
            and (window.recorded_from_ns is None or window.recorded_from_ns < self.horizon_ns)
            and (window.happened_from_ns is None or window.happened_from_ns < self.horizon_ns)
        )

    def horizon_error(self) -> HorizonError:
        """Return the error that this moment is gone for its age; it names what can be queried."""
        return HorizonError(f"{self.folder}: {self._horizon_words()}; ask about a later moment.")

    def _horizon_words(self) -> str:
        return (
            f"history begins at event {self.horizon}, recorded after {format_utc(self.horizon_ns)}"
            "; what was before is no longer kept"
        )

    @property
    def newer_events(self) -> NewerEvents:
        """What in the log is of kinds that a later version has added.

        Raises:
            CorruptLogError: A summary is damaged, or a chunk that holds some.
        """
        if self._newer is None:
            self._newer = NewerEvents.of(self.segments)
        return self._newer

    def check_known(self, limit: int | None = None) -> None:
        """Check that no event up to a number, of a kind unknown here, can affect an answer.

        Raises:
            NewerLogError: One can.
        """
        newer = self.newer_events
        if newer.reach(limit):
            raise newer.refusal(self.folder)
        if newer.counts and newer.first is None and not self._has_warned:
            self._has_warned = True
            warnings.warn(newer.warning(self.folder), stacklevel=3)

    def retractions(self, *, limit: int | None = None, with_newer: bool = False) -> Retractions:
        """Return what was taken back by the events up to the number `limit`.

        Args:
            limit: None: by all.
            with_newer: Even where an event of an unknown kind may have taken back others: for who
                shows events as they were recorded.

        Raises:
            NewerLogError: There is such an event.
        """
        if not with_newer:
            self.check_known(limit)
        if self._retractions is None:
            found = Retractions()
            for batch in self.batches(Window(kinds=kinds_mask([Retracted]))):
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

    def _check_same_log(self, found: Segment) -> None:
        log_id = found.header.info.log_id
        if self.segments and log_id != self.info.log_id:
            raise LogError(
                f"{self.folder}: the log was replaced by another one (expected the id "
                f"{self.info.log_id}, got {log_id}); reopen it."
            )

    def _next_event(self, place: int) -> int | None:
        """Return the number of the first event after a segment; None: it is the last."""
        if place + 1 < len(self.segments):
            return self.segments[place + 1].header.first_event
        return None

    def _check_follows(self, place: int, last: Page) -> None:
        """Check that a segment follows the one before it by hash, if that one's end was read.

        Args:
            place: Its own.
            last: The last page that was read of the one before.
        """
        segment, commit = self.segments[place], last.last_commit()
        if commit is not None and commit.last_event + 1 == segment.header.first_event:
            check_follows(segment, commit, self.segments[place - 1])

    def _check_order(self) -> None:
        """Check that the segments are consecutive ones of one log, as their heads show."""
        if not self._is_in_order:
            for before, segment in pairwise(self.segments):
                check_adjoins(segment, before)
            self._is_in_order = True


def _known_by_commits(segment: Segment, known_at_ns: int) -> int:
    """Return the last event of the commits that were recorded by then, as they say; -1: none."""
    behind = segment.chunks.starting_by(known_at_ns) + 1
    for chunk in reversed(segment.chunks[:behind].having(COMMIT_BIT).tolist()):
        known = [c for c in page_at(segment, chunk).commits() if c.recorded_ns <= known_at_ns]
        if known:
            return known[-1].last_event
    return -1
