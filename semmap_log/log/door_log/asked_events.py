"""Which events of a log are asked about, and what is told of each."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.history import HistoryEntry, history
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.moments import Moment
from semmap_log.log.replay.change_finder import ChangeFinder
from semmap_log.log.replay.read_model.events_about import SegmentTables, events_about
from semmap_log.store.kind_bits import Page
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import SaidFinder
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.window import Window


def entries(
    reader: LogReader,
    window: Window,
    doors: Collection[DoorId] | None = None,
    *,
    with_newer: bool = True,
) -> Iterator[HistoryEntry]:
    """Yield the events of a window with who and why and what they changed, retracted ones marked.

    Args:
        reader: Of the log.
        window: Which events.
        doors: Only those about these; None: all.
        with_newer: And those of kinds unknown here, which may be about any.
    """
    finder, changes = SaidFinder(reader.commit_at), ChangeFinder(reader, doors)
    retractions = reader.retractions(with_newer=with_newer)

    def look_at(segment: Segment, page: Page) -> None:
        finder.look_at(segment, page)
        changes.look_at(segment, page)

    def look_at_rows(segment: Segment, tables: SegmentTables, rows: EventBatch) -> None:
        finder.take(tables.commits)
        changes.look_at_rows(segment, rows, retractions.numbers)

    batches = events_about(
        reader, window, doors, with_newer=with_newer, on_page=look_at, on_rows=look_at_rows
    )
    return history(batches, finder.said_of, retractions, changes.changes_in)


def comes_after(one: Moment, other: Moment) -> bool:
    """Tell whether a moment is later than another of its sort."""
    if one.ns is not None and other.ns is not None:
        return one.ns > other.ns
    return one.event is not None and other.event is not None and one.event > other.event


def between(first: Moment, second: Moment) -> Window:
    """Return what comes after the first moment, up to and with the second."""
    return Window(
        happened_from_ns=_next(first.ns),
        happened_before_ns=_next(second.ns),
        first_event=_next(first.event),
        before_event=_next(second.event),
    )


def _next(number: int | None) -> int | None:
    return None if number is None else number + 1
