"""Finding things in one segment: pages, the chunk of an event, the commit of an event."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator

from semmap_log.commits import Commit
from semmap_log.log.form import CHUNK_BYTES
from semmap_log.log.pages import Page
from semmap_log.log.reading.page_reading import read_page
from semmap_log.log.reading.scan import Segment


def pages_of(segment: Segment, first_chunk: int = 0) -> Iterator[Page]:
    """Yield a segment's records from a chunk on, small chunks joined to pages of about a MiB.

    Raises:
        CorruptLogError: A chunk is not what was written.
    """
    for group in segment.chunks[first_chunk:].groups(CHUNK_BYTES):
        yield read_page(group, segment.header.first_event)


def page_at(segment: Segment, chunk: int) -> Page:
    """Return the records of one chunk.

    Raises:
        CorruptLogError: They are not what was written.
    """
    return read_page(segment.chunks[chunk : chunk + 1], segment.header.first_event)


def last_commit(segment: Segment) -> Commit | None:
    """Return a segment's last commit; None: it has none."""
    for chunk in reversed(range(len(segment.chunks))):
        commit = page_at(segment, chunk).last_commit()
        if commit is not None:
            return commit
    return None


def chunk_of(segment: Segment, event: int) -> int | None:
    """Return the place of the chunk that holds an event; None: the segment does not hold it."""
    places = range(len(segment.chunks))
    behind = bisect_right(places, event, key=lambda place: _first_number(segment, place))
    for chunk in reversed(places[:behind]):
        numbers = page_at(segment, chunk).event_numbers()
        if len(numbers) and numbers[0] <= event:  # else: a keyframe of `event`, then later events
            return chunk if event <= numbers[-1] else None
    return None


def commit_of(segment: Segment, event: int) -> Commit | None:
    """Return the commit that holds an event; None: the segment does not hold it."""
    chunk = chunk_of(segment, event)
    if chunk is None:
        return None
    pages = (page_at(segment, place) for place in range(chunk, len(segment.chunks)))
    return next((commit for page in pages if (commit := page.commit_holding(event))), None)


def _first_number(segment: Segment, chunk: int) -> int:
    """Return the event number of a chunk's first record (a keyframe: of the last event in it)."""
    before = segment.header.first_event - 1
    sequence = int(page_at(segment, chunk).heads["sequence"][0])
    return before + ((sequence - before) & 0xFFFF_FFFF)
