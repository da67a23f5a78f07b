"""The last changes in words: when, which door, what; who and why."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from semmap_log.core.folds.history import HistoryEntry, history
from semmap_log.core.model.object_classes import ObjectClass
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.store.reading.window import Window
from semmap_log.views.event_words import state_told_by, words_of
from semmap_log.views.excerpt.door_rows import sorted_by_stamp
from semmap_log.views.report.page_doors import PageDoor
from semmap_log.views.report.page_events import MOST_CHANGES, Rows
from semmap_log.views.tables import class_in
from semmap_log.views.tail_lines import LATE_NS
from semmap_log.views.zone_times import Span


def changes_of(
    log: DoorLog, told: Rows, page_doors: Sequence[PageDoor], span: Span
) -> list[dict[str, Any]]:
    """Return the last changes, the latest first.

    Args:
        log: Where from.
        told: Rows of `STAMP`, of events that are told whatever they say.
        page_doors: The doors, with their changes of state.
        span: Of the page.
    """
    stamps = np.unique(np.concatenate([told, *(page_door.changes for page_door in page_doors)]))
    latest = sorted_by_stamp(stamps)[-MOST_CHANGES:]["number"]
    objects = log.objects()
    lines = {
        entry.number: _line(entry, class_in(objects, entry.door_id), span)
        for entry in _entries(log, latest[latest >= 0])
    }
    doors = {None, *(page_door.door_id for page_door in page_doors)}
    in_turn = [lines[number] for number in reversed(latest.tolist()) if number in lines]
    return [line for line in in_turn if line["door"] in doors]


def _entries(log: DoorLog, numbers: Rows) -> Iterator[HistoryEntry]:
    """Yield the events of these numbers, ascending, with who and why: in one reading."""
    if not len(numbers):
        return
    finder = log.said_finder()
    window = Window(first_event=int(numbers.min()), before_event=int(numbers.max()) + 1)
    batches = (
        batch.select(np.isin(batch.number, numbers))
        for batch in log.batches_in(window, on_page=finder.look_at)
    )
    found = (batch for batch in batches if len(batch))
    yield from history(found, finder.said_of, log.retractions())


def _line(entry: HistoryEntry, of: ObjectClass, span: Span) -> dict[str, Any]:
    state = state_told_by(entry.event)
    late_ns = entry.recorded_ns - entry.folds_ns
    return {
        "event": entry.number,
        "t": span.since_begin(entry.folds_ns),
        "door": entry.door_id,
        "what": words_of(entry.event, of),
        "state": None if state is None else int(state),
        "actor": entry.actor,
        "source": entry.source,
        "reason": entry.reason,
        "recorded": span.since_begin(entry.recorded_ns) if late_ns > LATE_NS else None,
    }
