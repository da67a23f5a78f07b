"""Rounds as bars: from where one starts to where it is finished."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semmap_log.folds.patrol_rounds import ROUND_KINDS, rounds
from semmap_log.views.zone_times import MS_NS, Span

if TYPE_CHECKING:
    from semmap_log.door_log.door_log import DoorLog


def rounds_of(log: DoorLog, span: Span) -> list[list[Any]]:
    """Return [from when, till when, what it is called, who drove] for each round of the page.

    Times are None where nobody told them.
    """

    def when(ns: int | None) -> int | None:
        return None if ns is None else span.since_begin(ns)

    since_ns, until_ns = span.begin_ms * MS_NS, span.end_ms * MS_NS + 1
    return [
        [when(each.start_ns), when(each.end_ns), each.label, each.actor]
        for each in rounds(log.history(kinds=ROUND_KINDS))
        if each.overlaps(since_ns, until_ns)
    ]
