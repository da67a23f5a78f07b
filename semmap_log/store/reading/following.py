"""Commits as they come, in order: no gap, no repeat, whatever becomes of the files meanwhile.

A position is an event number, never a time or a place in a file: segments roll, are recovered,
rechunked and merged, and the numbers stay.
"""

from __future__ import annotations

import operator
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch, RecordedEvent
from semmap_log.core.model.commits import Commit
from semmap_log.store.pages import Page
from semmap_log.store.reading.newer_events import unknown_kinds, without_newer
from semmap_log.store.reading.reader import ChunkPlace, LogReader
from semmap_log.store.reading.segment_reading import chunk_of
from semmap_log.store.reading.segment_scan import Segment


@dataclass(frozen=True, slots=True)
class FollowedCommit:
    """A commit with its events."""

    commit: Commit
    batch: EventBatch
    """Its events; without those that the follower had already, if it began in the middle."""

    def __iter__(self) -> Iterator[RecordedEvent]:
        return iter(self.batch)


def follow(
    reader: LogReader,
    after: int,
    *,
    poll_s: float,
    stop: Callable[[], bool] | None = None,
    with_newer: bool = False,
) -> Iterator[FollowedCommit]:
    """Yield every whole commit that has events after a number, then new ones as they are written.

    Args:
        reader: Of the log; it is refreshed.
        after: Number of the last event that is not wanted any more; -1: all are.
        poll_s: How long to wait before looking again, when nothing was new.
        stop: Called before each look; once it returns True, what is there then is the end.
        with_newer: As for `commits_after`.

    Raises:
        NewerLogError: A commit has an event of an unknown kind that may change others.
        CorruptLogError: The log is damaged; or it is no continuation of what it was.
        LogError: Another log lies there now.
    """
    seen: list[Segment] = []
    while True:
        is_last_look = stop is not None and stop()
        reader.refresh()
        if not are_same(seen, reader.segments):
            seen = reader.segments
            for followed in commits_after(reader, after, with_newer=with_newer):
                after = followed.commit.last_event
                yield followed
        if is_last_look:
            return
        time.sleep(poll_s)


def commits_after(
    reader: LogReader, event: int, *, with_newer: bool = False
) -> Iterator[FollowedCommit]:
    """Yield the whole commits that a log has after an event, as of its last refresh.

    Args:
        reader: Of the log.
        event: Its number; a commit that it is in the middle of comes with the rest of its events.
        with_newer: Yield events of kinds unknown here, too, whatever they may change.

    Raises:
        NewerLogError: A commit has an event of an unknown kind that may change others.
        CorruptLogError: A chunk is not what was written.
    """
    first = max(event + 1, 0)
    place = reader.segment_of(first)
    if place is None or first > reader.last_event():
        return
    segment = reader.segments[place]
    chunk = chunk_of(segment, first)
    start = ChunkPlace(place, len(segment.chunks) if chunk is None else chunk)
    parts: list[EventBatch] = []
    for source, page in reader.pages(start):
        cutter = _Cutter(source, page, first)
        for commit in page.commits():
            parts.append(cutter.up_to(commit.last_event))
            if commit.last_event >= first:
                batch = _joined(parts)
                if not with_newer and _may_change_others(batch, source):
                    raise reader.newer_events.refusal(reader.folder)
                yield FollowedCommit(commit, batch if with_newer else without_newer(batch))
            parts = []
        parts.append(cutter.rest())


def are_same(some: list[Segment], others: list[Segment]) -> bool:
    """Return whether nothing was written in between: a segment that grew is another object."""
    return len(some) == len(others) and all(map(operator.is_, some, others))


def _may_change_others(batch: EventBatch, segment: Segment) -> bool:
    """Return whether it contains events of unknown kinds that are not marked as harmless."""
    unknown = unknown_kinds(batch)
    return bool(unknown) and not unknown <= segment.newer.harmless


class _Cutter:
    """Cuts the events of a page into parts that follow each other."""

    def __init__(self, segment: Segment, page: Page, first: int) -> None:
        """Take the events of a page of a segment, from a number on."""
        batch = page.events(names=segment.newer.names if segment.has_unknown_events else {})
        self._batch = batch.select(batch.number >= first) if len(batch) else batch
        self._places = {
            kind: np.flatnonzero(self._batch.kind == kind)
            for kind in (*self._batch.columns, *self._batch.objects)
        }
        self._at = 0

    def up_to(self, last_event: int) -> EventBatch:
        """Return what comes next, up to the event of that number."""
        return self._up_to_place(int(np.searchsorted(self._batch.number, last_event, "right")))

    def rest(self) -> EventBatch:
        """Return all that comes yet."""
        return self._up_to_place(len(self._batch))

    def _up_to_place(self, end: int) -> EventBatch:
        batch, start, self._at = self._batch, self._at, end
        spans = {}
        for kind, places in self._places.items():
            first, last = np.searchsorted(places, (start, end)).tolist()
            if first < last:
                spans[kind] = slice(first, last)
        return EventBatch(
            batch.number[start:end],
            batch.kind[start:end],
            batch.happened_ns[start:end],
            batch.recorded_ns[start:end],
            {
                kind: batch.columns[kind][span]
                for kind, span in spans.items()
                if kind in batch.columns
            },
            {
                kind: batch.objects[kind][span]
                for kind, span in spans.items()
                if kind in batch.objects
            },
        )


def _joined(parts: list[EventBatch]) -> EventBatch:
    """Return batches that follow each other as one."""
    filled = [part for part in parts if len(part)] or parts[:1]
    if len(filled) == 1:
        return filled[0]
    kinds = {kind for part in filled for kind in part.columns}
    return EventBatch(
        np.concatenate([part.number for part in filled]),
        np.concatenate([part.kind for part in filled]),
        np.concatenate([part.happened_ns for part in filled]),
        np.concatenate([part.recorded_ns for part in filled]),
        {
            kind: np.concatenate([p.columns[kind] for p in filled if kind in p.columns])
            for kind in kinds
        },
        {
            kind: [event for p in filled for event in p.objects.get(kind, ())]
            for kind in {kind for part in filled for kind in part.objects}
        },
    )
