"""Events of kinds that a later version of this program has added: how many, and what they touch.

Their meaning is not known. Those whose kind is marked as changing nothing are left out of every
answer except a list of events; after the first of another kind, every answer may be wrong.

This module also prefetches segments, since each request to a store takes a while, and reports how
far the reading of a log has come, without keeping in memory what was read.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePath

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.events import KINDS
from semmap_log.errors import NewerLogError, NewerLogWarning
from semmap_log.store.byte_layout import FORMAT_VERSION, kinds_of
from semmap_log.store.newer import is_later_kind, name_of
from semmap_log.store.pages import UNKNOWN_BIT, Page
from semmap_log.store.reading.page_reading import read_page
from semmap_log.store.reading.segment_scan import Segment


@dataclass(frozen=True, slots=True)
class NewerEvents:
    """What of a log is unknown here."""

    counts: dict[str, int]
    """Kind -> how many events."""
    first: int | None = None
    """Number of the first event that may have changed more than itself."""
    first_kind: str = ""
    """What it is called."""
    minor: int = 0
    """The greatest minor version that has written to the log."""

    @classmethod
    def of(cls, segments: Sequence[Segment]) -> NewerEvents:
        """Look for them in all segments of a log; those without any are not read.

        Raises:
            CorruptLogError: A summary is damaged, or a chunk that holds some.
        """
        counts: Counter[str] = Counter()
        first: tuple[int | None, str] = None, ""
        for segment in segments:
            if segment.has_unknown_events:
                counts.update(_counts(segment))
                if first[0] is None:
                    first = _first(segment)
        return cls(dict(counts), *first, max(segment.header.minor for segment in segments))

    def reach(self, limit: int | None) -> bool:
        """Return whether they may change what is known as of an event; None: as of the end."""
        return self.first is not None and (limit is None or self.first <= limit)

    def refusal(self, log: PurePath) -> NewerLogError:
        """Return the error of whoever would need to know what they mean."""
        before = f"; what was known before it: --event {self.first - 1}" if self.first else ""
        return NewerLogError(
            f"{log}: written by a newer version of semmap-log (format {FORMAT_VERSION}."
            f"{self.minor}): event {self.first} is of kind {self.first_kind}, unknown here, and "
            "may affect the answer. Nothing is damaged: install the newer version. "
            f"These still answer: history, tail, show, info, verify{before}."
        )

    def warning(self, log: PurePath) -> NewerLogWarning:
        """Return the warning for answers that leave them out."""
        return NewerLogWarning(
            f"{log}: left out, since a newer version of semmap-log has written them: "
            f"{self.as_text()}; by its own mark they change nothing else."
        )

    def as_text(self) -> str:
        """Return how many there are of each kind."""
        return ", ".join(f"{count} {kind}" for kind, count in self.counts.items())


def without_newer(batch: EventBatch) -> EventBatch:
    """Return the events of a batch whose kinds are known."""
    if not unknown_kinds(batch):
        return batch
    return batch.select(batch.kind <= len(KINDS))


def unknown_kinds(batch: EventBatch) -> set[int]:
    """Return the numbers of the unknown kinds in a batch."""
    return set(filter(is_later_kind, batch.objects))


def _counts(segment: Segment) -> Counter[str]:
    """Return how many events of each unknown kind are in a segment."""
    counts = segment.counts
    if counts is None:
        counts = Counter[int]()
        for kinds, _ in _kinds_and_numbers(segment):
            counts.update(kinds)
    names = segment.newer.names
    return Counter({name_of(c, names): n for c, n in counts.items() if is_later_kind(c) and n})


def _first(segment: Segment) -> tuple[int | None, str]:
    """Return number and name of a segment's first event that is not marked as harmless."""
    newer = segment.newer
    if newer.channels and {c for c, _ in newer.channels} <= newer.harmless:
        return None, ""
    for kinds, numbers in _kinds_and_numbers(segment):
        for kind, number in zip(kinds, numbers, strict=True):
            if kind not in newer.harmless:
                return number, name_of(kind, newer.names)
    return None, ""


def _kinds_and_numbers(segment: Segment) -> Iterator[tuple[list[int], list[int]]]:
    """Yield kinds and numbers of a segment's unknown events, chunk by chunk."""
    for place in segment.chunks.having(UNKNOWN_BIT).tolist():
        page = read_page(segment.chunks[place : place + 1], segment.header.first_event)
        kinds = kinds_of(page.heads["channel_id"])
        kinds = kinds[kinds > 0]
        is_unknown = np.array([is_later_kind(kind) for kind in range(2**8)])[kinds]
        yield kinds[is_unknown].tolist(), page.event_numbers()[is_unknown].tolist()


MOST_SEGMENTS = 32
"""So many are on their way at a time."""
MOST_BYTES = 2**23
"""And so many bytes: a part of what a process keeps of what it has fetched."""
SMALL_BYTES = 2**20
"""A smaller segment comes whole, since a request costs more than its bytes."""
END_BYTES = 2**16
"""Of a large one only both ends are fetched ahead: they show what chunks it has."""


class SegmentsAhead:
    """The way through segments that a manifest lists, with the next ones prefetched.

    Like the read-ahead of an operating system it begins with few, and doubles them while the
    reading continues, so that a question that ends early has not paid for much.
    """

    def __init__(
        self, segments: Sequence[Segment], is_wanted: Callable[[int], bool], *, takes_all: bool
    ) -> None:
        """Request nothing yet.

        Args:
            segments: In the order in which they are read.
            is_wanted: Called with a place in them: whether anything of it will be read, as far as
                the manifest knows.
            takes_all: Whether all of it is read then, rather than some chunks.
        """
        self._segments = segments
        self._is_wanted = is_wanted
        self._whole_bytes = MOST_BYTES // 2 if takes_all else SMALL_BYTES
        self._next = 0
        self._most = 1

    def at(self, place: int) -> None:
        """Ask for what follows a segment that is read now."""
        self._next = max(self._next, place + 1)
        coming = sum(map(self._bytes_of, self._segments[place + 1 : self._next]))
        end = min(place + 1 + self._most, len(self._segments))
        self._most = min(2 * self._most, MOST_SEGMENTS)
        while self._next < end and coming < MOST_BYTES:
            segment = self._segments[self._next]
            if segment.told is not None and self._is_wanted(self._next):
                coming += self._bytes_of(segment)
                self._ask(segment)
            self._next += 1

    def _bytes_of(self, segment: Segment) -> int:
        return segment.size if segment.size <= self._whole_bytes else 2 * END_BYTES

    def _ask(self, segment: Segment) -> None:
        if segment.size <= self._whole_bytes:
            segment.source.will_need(0, segment.size)
        else:
            segment.source.will_need(0, END_BYTES)
            segment.source.will_need(segment.size - END_BYTES, segment.size)


MOST_MAPPED = 2**24
"""So much of what was read of mapped files stays on the process's account."""


class ReadProgress:
    """The way through segments, in order."""

    def __init__(self, segments: Sequence[Segment], progress: Progress | None) -> None:
        self._progress = progress
        self._done = 0
        """Bytes of the segments that were passed."""
        self._todo = sum(segment.size for segment in segments) if progress else 0
        self._kept_from = 0
        """In the segment that is being read: earlier bytes were released."""

    def reached(self, segment: Segment, page: Page) -> None:
        """Take note of a page that was used, and all before it."""
        if page.offset - self._kept_from > MOST_MAPPED:
            segment.source.let_go(self._kept_from, page.offset)
            self._kept_from = page.offset
        if self._progress:
            self._progress(self._done + page.offset, self._todo)

    def passed(self, segment: Segment, *, is_read: bool) -> None:
        """Take note of a segment's end."""
        self._done += segment.size
        if is_read and self._done > MOST_MAPPED:
            segment.source.let_go(self._kept_from, segment.size)
        self._kept_from = 0
        if self._progress:
            self._progress(self._done, self._todo)
