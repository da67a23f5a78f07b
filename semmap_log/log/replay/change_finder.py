"""What events changed, found where the events are read: the map is folded during the reading."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.history import Changes, changes_of
from semmap_log.core.model.events import Retracted
from semmap_log.log.replay.state import state_at
from semmap_log.store.pages import Page
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import end_of
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.window import Window

FAR = 20_000
"""Events; a state further away is requested again rather than folded up to."""


class ChangeFinder:
    """Finds what one batch after another changed; quick where they come in order."""

    def __init__(self, reader: LogReader, doors: Collection[int] | None = None) -> None:
        """Begin.

        Args:
            reader: Of the log.
            doors: Only changes of these are returned; None: of all.
        """
        self._reader = reader
        self._doors = None if doors is None else list(doors)
        self._state: DoorMapState | None = None
        self._next = 0
        """Number of the first event that is not in the state."""
        self._changes: Changes = {}

    def look_at(self, _: Segment, page: Page) -> None:
        """Take note of the records in which the events of the next batch lie."""
        self._changes = {}
        found = page.events(doors=self._doors)
        for begin, last in _runs(page.event_numbers()):
            first = max(begin, self._reader.horizon)  # what doors were before is not known
            if last < first:
                continue
            self._take_in(
                found.select((found.number >= first) & (found.number <= last)), first, last
            )

    def look_at_rows(self, segment: Segment, rows: EventBatch, retracted: list[int]) -> None:
        """Take note of all the events about the doors in a segment.

        Args:
            segment: The segment.
            rows: The events.
            retracted: Numbers of all Retracted events of the log.
        """
        self._changes = {}
        first, end = max(segment.header.first_event, self._reader.horizon), end_of(segment)
        rows = rows.select(rows.number >= first)
        borders = np.array(sorted(n for n in retracted if first <= n < end), np.int64)
        begin = first
        if self._next != first:
            self._state = None
        for part in _cut(rows, np.searchsorted(rows.number, borders).tolist()):
            before = borders[borders < part.number[0]]
            if self._state is None or (len(before) and before[-1] >= begin):
                self._state = self._state_at(int(part.number[0]) - 1)
            self._changes |= changes_of(part, self._state)
            self._state.apply(part)
            begin = int(part.number[-1]) + 1
        if len(borders) and borders[-1] >= begin:
            self._state = None
        self._next = end

    def changes_in(self, _: EventBatch) -> Changes:
        """Return what the events of the page that was looked at changed."""
        return self._changes

    def _take_in(self, batch: EventBatch, first: int, last: int) -> None:
        """Take in all events from the first to the last, of which others doors' are left out."""
        begin = first
        for part in _up_to_retractions(batch):
            self._changes |= self._taken(part, begin)
            begin = self._next
        if self._state is not None and self._next == begin:
            self._next = last + 1

    def _taken(self, batch: EventBatch, first: int) -> Changes:
        """Return what events changed, as the log knew its doors then, and take them in."""
        last = int(batch.number[-1])
        state = self._state_before(first)
        mine = self._about_doors(batch)
        found = changes_of(mine, state)
        state.apply(mine)
        self._state, self._next = state, last + 1
        if Retracted in batch:  # what it hides can only be left out by another fold
            self._state = None
        return found

    def _state_before(self, event: int) -> DoorMapState:
        state = self._state
        if state is None or not 0 <= event - self._next <= FAR:
            return self._state_at(event - 1)
        if event > self._next:
            window = Window(first_event=self._next, before_event=event)
            batches = list(self._reader.batches(window))
            if any(Retracted in batch for batch in batches):
                return self._state_at(event - 1)
            for batch in batches:
                state.apply(self._about_doors(batch))
        return state

    def _state_at(self, event: int) -> DoorMapState:
        return state_at(self._reader, limit=event, with_newer=True)

    def _about_doors(self, batch: EventBatch) -> EventBatch:
        if self._doors is None:
            return batch
        return batch.select(batch.of_doors(self._doors))


def _runs(numbers: NDArray[np.int64]) -> Iterator[tuple[int, int]]:
    """Yield the first and the last of ascending numbers that follow each other."""
    if len(numbers):
        borders = np.flatnonzero(np.diff(numbers) != 1)
        firsts = numbers[np.append(0, borders + 1)].tolist()
        yield from zip(firsts, numbers[np.append(borders, -1)].tolist(), strict=True)


def _up_to_retractions(batch: EventBatch) -> Iterator[EventBatch]:
    """Yield a batch in parts that end with a retraction, or at its end."""
    yield from _cut(batch, (batch.where(Retracted) + 1).tolist() if Retracted in batch else [])


def _cut(batch: EventBatch, borders: list[int]) -> Iterator[EventBatch]:
    if not borders:
        if len(batch):
            yield batch
        return
    places = np.arange(len(batch))
    for start, end in zip([0, *borders], [*borders, len(batch)], strict=True):
        if start < end:
            yield batch.select((places >= start) & (places < end))
