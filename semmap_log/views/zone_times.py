"""The page's clock: whole milliseconds, and a zone's offsets, so that no browser needs its own.

A change at a nanosecond counts from the next whole millisecond on, so that at each whole
millisecond the page shows just what a replay of that moment returns. It also holds the hint for a
log that has no events yet.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from functools import partial
from typing import TYPE_CHECKING
from zoneinfo import ZoneInfo

from semmap_log.core.model.moments import zone
from semmap_log.core.texts import command_line

if TYPE_CHECKING:
    from semmap_log.log import DoorLog


MS_NS = 10**6
DAY_MS = 86_400_000


def first_ms(ns: int) -> int:
    """Return the first whole millisecond at or after an instant."""
    return -(-ns // MS_NS)


@dataclass(frozen=True, slots=True)
class Span:
    """The span of the slider, milliseconds since the Unix epoch, both ends included."""

    begin_ms: int
    end_ms: int

    def since_begin(self, ns: int) -> int:
        """Return when an instant begins to count, milliseconds after the begin."""
        return first_ms(ns) - self.begin_ms

    def widened(self, ms: int) -> Span:
        """Return the span widened by `ms` at both ends."""
        return Span(self.begin_ms - ms, self.end_ms + ms)


def zone_offsets(span: Span, tz: str) -> list[tuple[int, int]]:
    """Return (from when, milliseconds since the epoch; ahead of UTC, seconds), ascending.

    Raises:
        MomentError: There is no such zone.
    """
    place = zone(tz)
    found = [(span.begin_ms, _offset_s(span.begin_ms, place))]
    for day_ms in (*range(span.begin_ms + DAY_MS, span.end_ms, DAY_MS), span.end_ms):
        if (offset_s := _offset_s(day_ms, place)) != found[-1][1]:
            found.append((_change_ms(max(day_ms - DAY_MS, span.begin_ms), day_ms, place), offset_s))
    return found


def from_utc(offset_s: int) -> str:
    """Return how far clocks are ahead of UTC in words: `UTC+1`, `UTC-3:30`, `UTC`."""
    hours, minutes = divmod(abs(offset_s) // 60, 60)
    if not (hours or minutes):
        return "UTC"
    return f"UTC{'-' if offset_s < 0 else '+'}{hours}" + (f":{minutes:02}" if minutes else "")


def _change_ms(before_ms: int, after_ms: int, place: ZoneInfo) -> int:
    """Return the first millisecond with the later of two offsets."""
    old_s = _offset_s(before_ms, place)
    while after_ms - before_ms > 1:
        middle_ms = (before_ms + after_ms) // 2
        if _offset_s(middle_ms, place) == old_s:
            before_ms = middle_ms
        else:
            after_ms = middle_ms
    return after_ms


def _offset_s(ms: int, place: ZoneInfo) -> int:
    offset = datetime.fromtimestamp(ms // 1000, place).utcoffset()
    assert offset is not None
    return offset.days * 86_400 + offset.seconds


NOT_IN_THIS_PART = (
    "No door is in this part of the log. To see more of it, leave out --since, --until or --door."
)


def how_to_begin(log: DoorLog) -> str | None:
    """Return the commands that fill an empty log; None: it has events."""
    if log.last_event() >= 0:
        return None
    line = partial(_line, log)
    return (
        "The log has no events yet. To begin, one of:\n"
        f"  {line('import')} FILE   # a building, a door database, a CSV, a bag\n"
        f"  {line('add')} --x 2 --y 1.5 --theta 0 --width 0.9 --name front\n"
        f"  {line('record')}   # events as JSON lines, or from ROS"
    )


def _line(log: DoorLog, verb: str) -> str:
    return command_line(verb, log.path)
