"""The last changes in words: when, which door, what; who and why."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from semmap_log.door_log import DoorLog
from semmap_log.views.event_lines import LATE_NS
from semmap_log.views.event_words import state_told_by, words_of
from semmap_log.views.report.doors import DoorStory
from semmap_log.views.report.gathering import MOST_CHANGES, Rows, in_order
from semmap_log.views.report.times import Span


def changes_of(
    log: DoorLog, told: Rows, stories: Sequence[DoorStory], span: Span
) -> list[dict[str, Any]]:
    """Return the last changes, the latest first.

    Args:
        log: Where from.
        told: Rows of `STAMP`, of events that are told whatever they say.
        stories: The doors, with their changes of state.
        span: Of the page.
    """
    stamps = np.unique(np.concatenate([told, *(story.changes for story in stories)]))
    doors = {story.door_id for story in stories}
    latest = in_order(stamps)[-MOST_CHANGES:]
    lines = [_line(log, number, span) for number in latest["number"].tolist() if number >= 0]
    return [line for line in reversed(lines) if line["door"] is None or line["door"] in doors]


def _line(log: DoorLog, number: int, span: Span) -> dict[str, Any]:
    entry = log.entry(number)
    state = state_told_by(entry.event)
    counts_ns = min(entry.happened_ns, entry.recorded_ns)
    late_ns = entry.recorded_ns - counts_ns
    return {
        "event": number,
        "t": span.since_begin(counts_ns),
        "door": entry.door_id,
        "what": words_of(entry.event),
        "state": None if state is None else int(state),
        "actor": entry.actor,
        "source": entry.source,
        "reason": entry.reason,
        "recorded": span.since_begin(entry.recorded_ns) if late_ns > LATE_NS else None,
    }
