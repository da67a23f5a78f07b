"""A door's timeline for people: a row an interval, and how much of the time it was open.

A sighting holds only for a time: how much of an interval the door was not seen has its own column.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from rich.text import Text

from semmap_log.core.folds.sighting_hold import Hold
from semmap_log.core.folds.timeline import Interval, Timeline
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.moments import DAY_NS, SECOND_NS, format_local, format_short
from semmap_log.core.model.object_classes import DOOR, ObjectClass
from semmap_log.core.texts import counted
from semmap_log.views.column_table import CellValue, ColumnTable, TableColumn, with_line_end
from semmap_log.views.tables import state_in_words

PAGE_ROWS = 500
TIME_WIDTH = len("2026-03-02 08:00:00")
UNITS = ((DAY_NS, "d"), (3600 * SECOND_NS, "h"), (60 * SECOND_NS, "min"), (SECOND_NS, "s"))
"""Nanoseconds in a unit, and its name."""


def timeline_pages(timeline: Timeline, *, tz: str, of: ObjectClass = DOOR) -> Iterator[ColumnTable]:
    """Yield the intervals as tables whose columns line up; the first has the head.

    Args:
        timeline: A door's.
        tz: IANA zone of the times.
        of: What it is the timeline of.
    """
    waiting = iter(timeline)
    page = list(islice(waiting, PAGE_ROWS))
    is_first = True
    while page or is_first:
        yield _page(page, of, tz=tz, show_header=is_first)
        page, is_first = list(islice(waiting, PAGE_ROWS)), False


def timeline_totals(timeline: Timeline, *, tz: str, of: ObjectClass = DOOR) -> Text:
    """Return how much of the known time the door was open, and how the timeline ends, in words.

    What comes after a sighting that no longer holds is not known: the door was not seen since.
    """
    opened, closed = timeline.total_ns(DoorState.OPEN), timeline.total_ns(DoorState.CLOSED)
    known, whole = opened + closed, int(timeline.duration_ns.sum())
    not_seen = int(timeline.not_seen_ns.sum())
    is_open, is_closed = (of.word(s).lower() for s in (DoorState.OPEN, DoorState.CLOSED))
    said = f"never known to be {is_open} or {is_closed} for any time"
    if known:
        said = (
            f"{is_open} {opened / known:.1%}, {is_closed} {closed / known:.1%} "
            f"of the {duration(known)} in which that was known"
        )
        if whole > known:
            said += f" ({known / whole:.1%})"
    if not_seen:
        said += f"\nnot seen for {duration(not_seen)} ({not_seen / whole:.1%})"
    if (since_ns := timeline.not_seen_since_ns) is not None:
        said += f", not since {format_local(since_ns, tz)}"
    end = format_local(int(timeline.end_ns[-1]), tz)
    ending = "removed at" if timeline.removed else "up to"
    return Text(f"{said}\n{hold_in_words(timeline.hold)}\n{ending} {end} ({tz})", style="dim")


def hold_in_words(hold: Hold | None) -> str:
    """Return how long a sighting of a door holds, and why."""
    if hold is None:
        return "a sighting holds until the next report"
    if hold.is_measured:
        gaps = f"{counted(hold.gaps, 'median gap')} between looks"
        return f"a sighting holds for {duration(hold.ns)} ({gaps})"
    tell = "tells" if hold.looks == 1 else "tell"
    looks = f"{counted(hold.looks, 'look')} {tell} no median gap"
    gaps = f"{counted(hold.gaps, 'gap')} of {duration(hold.gap_ns)}"
    return f"a sighting holds for {duration(hold.ns)} ({gaps}, as {looks})"


def duration(ns: int) -> str:
    """Return a length of time in its largest unit and the next: `2 d 3 h`, `5 min`, `0.250 s`."""
    if ns < 10 * SECOND_NS:
        return f"{ns / SECOND_NS:.3f} s" if ns % SECOND_NS else f"{ns // SECOND_NS} s"
    place = next(i for i, (unit_ns, _) in enumerate(UNITS) if ns >= unit_ns)
    parts = []
    for unit_ns, name in UNITS[place : place + 2]:
        count, ns = divmod(ns, unit_ns)
        parts.append(f"{count} {name}" if count else "")
    return " ".join(filter(None, parts))


def _page(intervals: list[Interval], of: ObjectClass, *, tz: str, show_header: bool) -> ColumnTable:
    table = ColumnTable(COLUMNS, has_head=show_header)
    for interval in intervals:
        ends = interval.start_ns, interval.end_ns
        table.add(
            *(CellValue(_drawn_time(ns, tz), format_local(ns, tz)) for ns in ends),
            duration(interval.duration_ns),
            f"{interval.duration_ns / SECOND_NS:.3f}",
            state_in_words(interval.state, of),
            str(interval.sightings),
            str(interval.event),
            _not_seen(interval),
        )
    return table


def _not_seen(interval: Interval) -> CellValue:
    """Return the share of an interval in which no sighting held; for programs, seconds."""
    share = f"{interval.not_seen_ns / interval.duration_ns:.0%}" if interval.not_seen_ns else ""
    return CellValue(share, f"{interval.not_seen_ns / SECOND_NS:.3f}")


def _drawn_time(ns: int, tz: str) -> str:
    """Return an instant; an offset stands in a line of its own."""
    return with_line_end(format_short(ns, tz), TIME_WIDTH)


COLUMNS = [
    TableColumn("since", "since", width=TIME_WIDTH),
    TableColumn("until", "until", width=TIME_WIDTH, yields=1),
    TableColumn("", "lasted", width=len("23 h 59 min"), right=True),
    TableColumn("seconds"),
    TableColumn("state", "state", width=len(DoorState.UNKNOWN.name)),
    TableColumn("seen", "seen", width=5, right=True, yields=2),
    TableColumn("event", "event", width=len("9999999"), right=True, yields=3),
    TableColumn("not_seen_seconds", "unseen", width=len("unseen"), right=True, yields=1),
]
