"""Which round of a patrol was the last.

Also when a log ends: the latest happened time in it, found without a replay; and which events of a
log are queried, with the notes of each.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch, Retractions
from semmap_log.core.folds.door_changes import STATE, chosen_of
from semmap_log.core.folds.history import HistoryEntry, history
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import STATE_KINDS, PatrolFinished, PatrolStarted
from semmap_log.core.model.meaning import Presence
from semmap_log.core.model.moments import Moment
from semmap_log.log.replay.change_finder import ChangeFinder
from semmap_log.log.replay.read_model.events_about import SegmentTables, events_about
from semmap_log.store.pages import Page, kinds_mask
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import NoteFinder, batches_of
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.window import Window


def last_patrol(reader: LogReader, kind: type[PatrolStarted | PatrolFinished]) -> int:
    """Return the greatest number of a round that began, or ended; 0: none did."""
    hidden = reader.retractions()
    batches = map(hidden.visible, reader.batches(Window(kinds=kinds_mask([kind]))))
    return max((int(batch[kind]["patrol"].max()) for batch in batches if len(batch)), default=0)


def latest_happened_ns(reader: LogReader, *, of_states: bool = False) -> int:
    """Return the latest happened time of all events that are not retracted; 0: there are none.

    It is known from what is read of each segment anyway, when its events happened. Only where
    something is retracted the chunks are looked into that could hold the latest. No event counts as
    later than it was recorded: so the last segment often is enough.

    Args:
        reader: Of the log.
        of_states: Only of events that say in which state a door is, not of notes, new doors or
            maps. The chunks that could hold the latest are looked into.
    """
    hidden = reader.retractions(with_newer=True)
    latest_ns = 0
    for segment in reversed(reader.segments):
        latest_ns = max(latest_ns, _latest_in(segment, hidden, latest_ns, of_states=of_states))
        if latest_ns >= segment.recorded[0]:
            break
    return latest_ns


def _latest_in(segment: Segment, hidden: Retractions, known_ns: int, *, of_states: bool) -> int:
    """Return the latest time in a segment; any earlier one where it is not later than another."""
    if not hidden.ranges and not of_states:
        return segment.span[1]
    latest_ns, greatest_ns = known_ns, segment.spans["greatest"]
    for chunk in np.argsort(-greatest_ns).tolist():
        if greatest_ns[chunk] <= latest_ns:
            break
        for _, batch in batches_of(segment, np.array([chunk])):
            visible = hidden.visible(batch)
            happened_ns = visible.folds_ns[_states_of(visible)] if of_states else visible.folds_ns
            latest_ns = max(latest_ns, int(happened_ns.max(initial=0)))
    return latest_ns


def _states_of(batch: EventBatch) -> np.ndarray:
    """Return which events say in which state a door is that is there already, (n,) bool."""
    says = np.zeros(len(batch), np.bool_)
    for kind in STATE_KINDS:
        if kind.effect.presence is Presence.STAYS and kind in batch:
            says[batch.where(kind)[chosen_of(batch, kind, setting=STATE)]] = True
    return says


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
    finder, changes = NoteFinder(reader.commit_at), ChangeFinder(reader, doors)
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
    return history(batches, finder.note_texts_of, retractions, changes.changes_in)


def comes_after(one: Moment, other: Moment) -> bool:
    """Return whether a moment is later than another of its sort."""
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
