"""The parts of a log, with what their events have in common: so that a query reads few of them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from semmap_log.core.batches.distinct import distinct
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import end_of
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.window import numbers_of

MOST_RUNS = 256
"""Parts of a segment: a live one has a chunk for every commit."""


class LogPart(NamedTuple):
    """A range of events; all bounds are inclusive, times nanoseconds UTC."""

    first_event: int
    last_event: int
    happened_ns: tuple[int, int]
    """When they happened, as far as that counts: never after recording."""
    recorded_ns: tuple[int, int]


def segment_parts(reader: LogReader) -> Iterator[LogPart]:
    """Yield the segments that have events.

    Raises:
        CorruptLogError: A summary is damaged.
    """
    for segment in reader.segments:
        first, end = segment.header.first_event, end_of(segment)
        if first < end:
            yield LogPart(first, end - 1, segment.span, segment.recorded)


def parts_of_segment(reader: LogReader, part: LogPart) -> Iterator[LogPart]:
    """Yield runs of chunks of the segment that is this part.

    Raises:
        CorruptLogError: Its index is damaged.
    """
    place = reader.segment_of(part.first_event)
    assert place is not None, "`segment_parts` gave it"
    yield from _runs(reader.segments[place])


def _runs(segment: Segment) -> Iterator[LogPart]:
    firsts, ends = numbers_of(segment)
    chunks = np.flatnonzero(segment.spans["events"])
    starts = distinct(np.linspace(0, len(chunks), MOST_RUNS, endpoint=False).astype(np.intp))
    spans, rows = segment.spans[chunks], segment.chunks.rows[chunks]
    columns = (
        np.minimum.reduceat(firsts[chunks], starts),
        np.maximum.reduceat(ends[chunks], starts),
        np.minimum.reduceat(spans["least"], starts),
        np.maximum.reduceat(spans["greatest"], starts),
        np.minimum.reduceat(rows["start_ns"], starts),
        np.maximum.reduceat(rows["end_ns"], starts),
    )
    for first, end, least, greatest, start, last in zip(
        *(c.tolist() for c in columns), strict=True
    ):
        yield LogPart(first, end - 1, (least, greatest), (start, last))
