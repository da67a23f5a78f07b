"""Events as tables in whatever order they are had soonest: from the read model, else from the log.

A segment's table is read whole, of few columns, before any of its rows is given away: one that
turns out to be damaged is not used, and the log itself tells the same.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING

from semmap_log.core.arrow.table_columns import RETRACTED, THEN, Column
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.io.prefetch import ahead
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.model.doors import DoorId
from semmap_log.errors import StaleIndexError
from semmap_log.log.door_log.asked_tables import event_tables, names_then
from semmap_log.log.replay.read_model.events_about import has_tables, not_used, tables_of
from semmap_log.log.replay.read_model.segment_tables import SegmentTables
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import end_of
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.window import Window

if TYPE_CHECKING:
    from semmap_log.core.arrow.arrow_sdk import pa

WORTH_A_TABLE = 1 / 4
"""Where chunks with so many of a segment's events would be read, its table is, all of it."""


def unordered_tables(
    reader: LogReader,
    windows: Sequence[Window],
    columns: Sequence[Column],
    doors: Collection[DoorId] | None = None,
) -> Iterator[pa.Table]:
    """Yield the events of some windows, retracted ones included, and perhaps others.

    Args:
        reader: Of the log.
        windows: Ranges of event numbers, ascending and apart from each other.
        columns: Of the tables.
        doors: Only events about these need be there; None: all.

    Raises:
        CorruptLogError: A chunk is not what was written, or events are missing.
    """
    from semmap_log.core.arrow.stored_rows import stored_columns

    needed = stored_columns(columns) if doors is None and has_tables(reader) else None
    if needed is None:
        for window in windows:
            yield from event_tables(reader, window, columns, doors=doors)
        return
    steps = list(
        chain.from_iterable(_steps(reader, segment, windows) for segment in reader.segments)
    )
    rows = ahead(
        partial(_rows_of, step.tables, needed) for step in steps if step.tables is not None
    )
    table_of_rows = _maker(reader, columns)
    for step in steps:
        found = next(rows) if step.tables is not None else None
        if found is not None:
            yield table_of_rows(found)
            continue
        for window in step.windows:
            yield from event_tables(reader, window, columns)


@dataclass(frozen=True, slots=True)
class _Step:
    """What is read of a segment: its tables if they are whole, else some windows."""

    tables: SegmentTables | None
    windows: list[Window]


def _steps(reader: LogReader, segment: Segment, windows: Sequence[Window]) -> Iterator[_Step]:
    """Yield how a segment is read; nothing if it is in no window."""
    first, end = segment.header.first_event, end_of(segment)
    inside = [part for window in windows if (part := _within(window, first, end)) is not None]
    if not inside:
        return
    wanted = sum(int(segment.spans["events"][w.chunks(segment)].sum()) for w in inside)
    is_worth_it = wanted >= WORTH_A_TABLE * (end - first)
    yield _Step(tables_of(reader, segment) if is_worth_it else None, inside)


def _within(window: Window, first: int, end: int) -> Window | None:
    """Return the part of a window that lies in a range of events; None: there is none."""
    least = max(first, window.first_event or 0)
    before = end if window.before_event is None else min(end, window.before_event)
    if least >= before:
        return None
    return replace(window, first_event=least, before_event=before, only_kept=True)


def _rows_of(tables: SegmentTables, needed: Collection[str]) -> pa.Table | None:
    try:
        return tables.all_rows(needed)
    except StaleIndexError as error:
        not_used(error)
        return None


def _maker(reader: LogReader, columns: Sequence[Column]) -> Callable[[pa.Table], pa.Table]:
    """Return what makes a table of such columns of a segment's rows."""
    from semmap_log.core.arrow.arrow_sdk import pa
    from semmap_log.core.arrow.stored_rows import stored_column, stored_events
    from semmap_log.core.arrow.table import column_of, texts_array

    known = reader.retractions()
    wanted = {column.name for column in columns}
    names = names_then(reader, known, wanted, None) if THEN[0] in columns else None

    def of_rows(rows: pa.Table) -> pa.Table:
        made = {column.name: stored_column(rows, column.name) for column in columns}
        lacking = [column for column in columns if made[column.name] is None]
        if lacking:
            batch = EventBatch(**stored_events(rows))
            made |= {column.name: of_batch(batch, column) for column in lacking}
        return pa.table(made)

    def of_batch(batch: EventBatch, column: Column) -> pa.Array:
        if column == THEN[0]:
            assert names is not None, "they were asked for"
            return texts_array(*names.door_names(batch))
        return pa.array(known.hidden(batch)) if column == RETRACTED else column_of(batch, column)

    return of_rows
