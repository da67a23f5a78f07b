"""The events about some doors: from the tables where there are any, else from the log."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from pathlib import Path

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.events import KINDS
from semmap_log.errors import StaleIndexError
from semmap_log.log.replay.read_model.segment_tables import FOLDER, SegmentTables, has_pyarrow
from semmap_log.store.reading.reader import LogReader, OnPage
from semmap_log.store.reading.segment_reading import end_of
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.window import Window

FEW_CHUNKS = 2
"""So few of a segment are read from the log sooner than a table is opened."""

OnRows = Callable[[Segment, SegmentTables, EventBatch], None]
"""Told of all rows about the doors in a segment, before those outside the window are left out."""


def about(
    batch: EventBatch, doors: Collection[int] | None, *, with_newer: bool = False
) -> EventBatch:
    """Return the events of a batch that are about some doors; None: all.

    Args:
        batch: The events.
        doors: The doors.
        with_newer: And those of kinds unknown here, which may be about any.
    """
    if doors is None:
        return batch
    chosen = batch.of_doors(doors)
    if with_newer:
        chosen |= batch.kind > len(KINDS)
    return batch.select(chosen)


def events_about(
    reader: LogReader,
    window: Window,
    doors: Collection[int] | None,
    *,
    with_newer: bool = False,
    progress: Progress | None = None,
    on_page: OnPage | None = None,
    on_rows: OnRows | None = None,
) -> Iterator[EventBatch]:
    """Yield the events of a window about some doors, numbers ascending, retracted ones included.

    Args:
        reader: Of the log.
        window: Which events.
        doors: Those; None: all events, which the log tells sooner.
        with_newer: Yield events of unknown kinds, too, which may be about any door.
        progress: Told how far the reading is.
        on_page: Called with the records of each batch that comes from the log.
        on_rows: Called with what comes from a table.

    Raises:
        CorruptLogError: A chunk is not what was written, or events are missing.
    """
    reader.check_horizon(window)
    tables = {} if doors is None else _tables(reader, window)

    def read(first: int, before: int | None = None) -> Iterator[EventBatch]:
        """Yield what the log itself has, from an event on, before another."""
        part = _cut(window, first, before)
        if part is None:
            return
        found = reader.batches(
            part,
            doors=doors,
            progress=progress,
            on_page=on_page,
            with_newer=with_newer,
            is_part=True,
        )
        for batch in found:
            chosen = about(batch, doors, with_newer=with_newer)
            if len(chosen):
                yield chosen

    at = 0
    for segment in reader.segments if tables else ():
        found = tables.get(segment.header.first_event)
        if found is None:
            continue
        rows = _rows(found, doors or (), with_commits=on_rows is not None)
        if rows is None:
            continue
        yield from read(at, segment.header.first_event)
        at = end_of(segment)
        chosen = window.choose(rows)
        if len(chosen):
            if on_rows is not None:
                on_rows(segment, found, rows)
            yield chosen
    yield from read(at)


def _cut(window: Window, first: int, before: int | None) -> Window | None:
    """Return the part of a window from an event on, before another; None: there is none."""
    least = max(first, window.first_event or 0)
    bounds = [bound for bound in (before, window.before_event) if bound is not None]
    behind = min(bounds, default=None)
    if behind is not None and behind <= least:
        return None
    if not first and before is None:
        return window
    return replace(window, first_event=least, before_event=behind)


def _tables(reader: LogReader, window: Window) -> dict[int, SegmentTables]:
    """Return the tables that are worth asking, by the first events of their segments."""
    if not has_tables(reader):
        return {}
    found = {}
    for place, segment in enumerate(reader.segments):
        behind = reader.segments[place + 1 : place + 2]
        next_event = behind[0].header.first_event if behind else None
        is_closed = segment.closed and segment.told is None
        if not (is_closed and window.may_reach(segment, next_event)):
            continue
        if len(window.chunks(segment)) > FEW_CHUNKS and (tables := tables_of(reader, segment)):
            found[segment.header.first_event] = tables
    return found


def has_tables(reader: LogReader) -> bool:
    """Tell whether a log may have tables, and there is what reads them."""
    folder = reader.given / FOLDER
    return isinstance(folder, Path) and folder.is_dir() and has_pyarrow()


def tables_of(reader: LogReader, segment: Segment) -> SegmentTables | None:
    """Return the tables of a segment; None: it has none that can be used."""
    folder = reader.given / FOLDER
    is_whole = segment.closed and segment.told is None and segment.header.trimmed is None
    if not is_whole or segment.has_unknown_events:
        return None
    assert isinstance(folder, Path), "`has_tables` said so"
    try:
        return SegmentTables.of(folder, segment)
    except StaleIndexError as error:
        not_used(error)
        return None


def _rows(
    tables: SegmentTables, doors: Collection[int], *, with_commits: bool
) -> EventBatch | None:
    try:
        if with_commits:
            tables.commits  # noqa: B018 - read now: a damaged one is not used
        return tables.about(doors)
    except StaleIndexError as error:
        not_used(error)
        return None


def not_used(error: StaleIndexError) -> None:
    """Tell who wants to know that a table is not used."""
    import logging

    logging.getLogger("semmap_log").info("%s It is not used; the log itself is read.", error)
