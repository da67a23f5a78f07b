"""Events of a log as Arrow tables, one batch after another: only the columns that are requested.

The tables come in whatever order is fastest: from the read model, else from the log. A segment's
table is read whole, with few columns, before any of its rows is returned: one that turns out to be
damaged is not used, and the log itself is read instead.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING

from semmap_log.core.arrow.table import HISTORY_COLUMNS, RETRACTED, SAID, THEN, Column
from semmap_log.core.batches.event_batch import EventBatch, Retractions
from semmap_log.core.folds.door_changes import NamesAsOf, affected_levels
from semmap_log.core.io.prefetch import ahead
from semmap_log.core.io.progress import Progress
from semmap_log.core.model import events
from semmap_log.core.model.commits import NOTE_TEXTS
from semmap_log.core.model.doors import DoorId
from semmap_log.errors import CommandError, StaleIndexError
from semmap_log.log.replay.read_model.events_about import (
    SegmentTables,
    events_about,
    has_tables,
    not_used,
    tables_of,
)
from semmap_log.store.pages import kinds_mask
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import NoteFinder, end_of
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.window import Window

if TYPE_CHECKING:
    from semmap_log.core.arrow.arrow_sdk import pa
    from semmap_log.core.arrow.history_table import TextsAsOf


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
    from semmap_log.core.arrow.history_table import stored_columns

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
    """Return the part of a window that lies in a range of events, or None."""
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
    from semmap_log.core.arrow.history_table import stored_column, stored_events
    from semmap_log.core.arrow.table import column_of, texts_array

    known = reader.retractions()
    wanted = {column.name for column in columns}
    names = names_as_of(reader, known, wanted, None) if THEN[0] in columns else None

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


_DOOR_NAME, _LEVEL_NAME = (column.name for column in THEN)


def columns_called(names: Collection[str] | None) -> tuple[Column, ...]:
    """Return the columns of these names, in their order; None: all.

    Raises:
        CommandError: There is no such column, or one is named twice.
    """
    if names is None:
        return HISTORY_COLUMNS
    known = {column.name: column for column in HISTORY_COLUMNS}
    names = [names] if isinstance(names, str) else list(names)
    for place, name in enumerate(names):
        if name not in known or name in names[:place]:
            got = f"{name!r} twice" if name in known else repr(name)
            raise CommandError(f"columns: expected some of {', '.join(known)}, got {got}.")
    return tuple(known[name] for name in names)


def event_tables(
    reader: LogReader,
    window: Window,
    columns: Sequence[Column],
    *,
    doors: Collection[DoorId] | None = None,
    retracted: bool = True,
    limit: int | None = None,
    progress: Progress | None = None,
) -> Iterator[pa.Table]:
    """Yield the events of a window, numbers ascending, a table a batch; none is empty.

    Args:
        reader: Of the log.
        window: Which events.
        columns: Of the tables: `columns_called`.
        doors: Only events about these; None: all.
        retracted: Retracted events, too.
        limit: What was called how, and taken back, by the events up to this number; None: by all.
        progress: Called with the progress of the reading.

    Raises:
        MissingExtraError: pyarrow is not installed.
    """
    from semmap_log.core.arrow.history_table import history_table

    wanted = {column.name for column in columns}
    known = reader.retractions(limit=limit)
    names = (
        names_as_of(reader, known, wanted, limit) if wanted & {_DOOR_NAME, _LEVEL_NAME} else None
    )
    finder = NoteFinder(reader.commit_at, with_notes=not wanted.isdisjoint(NOTE_TEXTS))
    says = any(column in SAID for column in columns)

    def look_at_rows(_: Segment, tables: SegmentTables, __: EventBatch) -> None:
        finder.take(tables.commits)

    batches = events_about(
        reader, window, doors, progress=progress, on_page=finder.look_at if says else None,
        on_rows=look_at_rows if says else None,
    )  # fmt: skip
    for found in batches:
        batch = found if retracted else known.visible(found)
        if len(batch):
            yield history_table(
                batch,
                columns,
                retracted=known.hidden(batch),
                commits=finder.commits_of(batch.number) if says else None,
                then=_texts_as_of(batch, names, wanted),
            )


def _texts_as_of(batch: EventBatch, names: NamesAsOf | None, wanted: Collection[str]) -> TextsAsOf:
    if names is None:
        return {}
    asked = {_DOOR_NAME: names.door_names, _LEVEL_NAME: names.level_names}
    return {name: texts_of(batch) for name, texts_of in asked.items() if name in wanted}


def names_as_of(
    reader: LogReader, known: Retractions, wanted: Collection[str], limit: int | None
) -> NamesAsOf:
    """Return what gives the names of doors and levels at the time of events.

    Events that set them are rare except updates, which most logs with one level need not read.

    Args:
        reader: Of the log.
        known: What was taken back.
        wanted: Names of columns.
        limit: The number of the last event that counts; None: all do.
    """
    names, levels = NamesAsOf(), {0}
    before = None if limit is None else limit + 1

    def take(batches: Iterable[EventBatch]) -> None:
        for batch in batches:
            levels.update(affected_levels(batch))
            names.apply(known.visible(batch))

    with_levels = _LEVEL_NAME in wanted
    kinds = [
        *events.ADDING_KINDS,
        events.DoorAnnotated,
        *([events.LevelAdded, events.FloorMap] if with_levels else []),
    ]
    take(reader.batches(Window(kinds=kinds_mask(kinds), before_event=before)))
    if with_levels and len(levels) > 1:  # doors are only on known levels
        take(_moves(reader, before))
    return names


def _moves(reader: LogReader, before: int | None) -> Iterator[EventBatch]:
    """Yield the events that may put doors elsewhere, and what stands for those that are gone."""
    kinds = kinds_mask(kind for kind in events.POSE_KINDS if kind not in events.ADDING_KINDS)
    window = Window(kinds=kinds, before_event=before)
    if reader.horizon:
        from semmap_log.log.replay.state import events_at_horizon

        yield from events_at_horizon(reader, window, None)
        window = replace(window, first_event=reader.horizon)
    yield from reader.batches(window)
