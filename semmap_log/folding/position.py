"""How far a fold has come in a log, and whether that is still a place in it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from semmap_log.commits import Commit
from semmap_log.errors import CorruptLogError
from semmap_log.event_batch import EventBatch
from semmap_log.events import Retracted
from semmap_log.log.reading.reader import LogReader, Progress
from semmap_log.log.reading.segment_reading import chunk_of, commit_of, pages_of
from semmap_log.projections.retraction import Retractions

NO_EVENT = -1


class Retraction(NamedTuple):
    """A Retracted event: its number, and the range that it hides."""

    number: int
    first_event: int
    last_event: int


@dataclass(frozen=True, slots=True)
class Position:
    """The end of a whole commit, up to which events were taken in; by number, never by time."""

    event: int = NO_EVENT
    """The last event of the commit; -1: the log's beginning."""
    commit_hash: bytes = bytes(32)
    """Of the commit: by the chain of hashes, of everything before it, too."""
    latest_ns: int = 0
    """The latest time by which an event that was taken in is ordered."""
    retractions: tuple[Retraction, ...] = ()
    """Those recorded so far, so that what they hide was left out."""

    def is_in(self, reader: LogReader) -> bool:
        """Tell whether the log, as it is now, has come by here."""
        if self.event == NO_EVENT:
            return True
        commit = commit_at(reader, self.event)
        return commit is not None and (commit.last_event, commit.hash) == (
            self.event,
            self.commit_hash,
        )

    def is_touched_by(self, later: Iterable[Retraction]) -> bool:
        """Tell whether one of these retractions hides an event that was taken in."""
        return any(
            one.first_event <= self.event and not self._leaves_out(one)
            for one in later
            if one.number > self.event
        )

    def _leaves_out(self, later: Retraction) -> bool:
        """Tell whether an earlier retraction hides all of it that was taken in."""
        last = min(later.last_event, self.event)
        return any(
            one.first_event <= later.first_event and last <= one.last_event
            for one in self.retractions
        )


def commit_at(reader: LogReader, event: int) -> Commit | None:
    """Return the commit that holds an event; None: there is no such event."""
    place = reader.segment_of(event)
    return None if place is None else commit_of(reader.segments[place], event)


def retractions_behind(
    reader: LogReader, event: int, limit: int | None = None
) -> tuple[Retraction, ...]:
    """Return the retractions with numbers behind `event`, and up to `limit`."""
    found: list[Retraction] = []
    for place, first_chunk in _places_behind(reader, event):
        segment = reader.segments[place]
        if segment.counts is not None and not segment.counts.get(Retracted.kind):
            continue
        for page in pages_of(segment, first_chunk):
            if not (page.heads["channel_id"] == Retracted.kind).any():
                continue
            batch = page.events()
            numbers = batch.number[batch.where(Retracted)].tolist()
            rows = batch[Retracted]
            ranges = zip(
                numbers, rows["first_event"].tolist(), rows["last_event"].tolist(), strict=True
            )
            found += [
                Retraction(*one)
                for one in ranges
                if event < one[0] and (limit is None or one[0] <= limit)
            ]
    return tuple(found)


def hiding(retractions: Iterable[Retraction]) -> Retractions:
    """Return what leaves out the events that these retractions hide."""
    hidden = Retractions()
    hidden.ranges = [(one.first_event, one.last_event) for one in retractions]
    return hidden


def events_behind(
    reader: LogReader, event: int, limit: int | None = None, progress: Progress | None = None
) -> Iterator[EventBatch]:
    """Yield all events with numbers behind `event`, and up to `limit`, retracted ones included.

    Raises:
        CorruptLogError: A chunk is not what was written, or events are missing.
    """
    place, first_chunk = next(_places_behind(reader, event), (None, 0))
    if place is None:
        return
    expected = max(event + 1, reader.segments[0].header.first_event)
    for segment, page in reader.pages(place, progress, first_chunk=first_chunk):
        batch = page.events()
        batch = batch.select(batch.number >= expected)
        if not len(batch):
            continue
        if batch.number[0] != expected or (np.diff(batch.number) != 1).any():
            problem = f"expected event {expected} next, got {int(batch.number[0])} or a later gap"
            raise CorruptLogError(segment.path, page.offset, problem)
        expected += len(batch)
        if limit is not None and expected > limit:
            batch = batch.select(batch.number <= limit)
            if len(batch):
                yield batch
            return
        yield batch


def _places_behind(reader: LogReader, event: int) -> Iterator[tuple[int, int]]:
    """Yield the places of the segments with events behind a number, and of their chunks to begin.

    None if no event is behind it.
    """
    place = reader.segment_of(event + 1)
    if place is None:  # the log begins later
        place, chunk = 0, 0
    else:
        found = chunk_of(reader.segments[place], event + 1)
        if found is None:
            return
        chunk = found
    yield place, chunk
    for later in range(place + 1, len(reader.segments)):
        yield later, 0
