"""When to go to a door, for people."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.analysis.beliefs.best_times import BestTime, LikelyHours
from semmap_log.analysis.probabilities.evidence.coverage import DAY_NAMES, HOURS, spans_in_short
from semmap_log.core.model.moments import SECOND_NS, format_short
from semmap_log.views.belief_words import moment_in_words, why_unknown, with_interval
from semmap_log.views.column_table import ColumnTable, TableColumn
from semmap_log.views.event_words import printable
from semmap_log.views.timeline_table import duration


def best_time_table(found: BestTime) -> RenderableType:
    """Return the best hours of the week, the next ones, the wait, and what nobody knows."""
    now, label = found.now, printable(found.now.door.label)
    if not found.is_known:
        return Text(f"{label}: UNKNOWN, {why_unknown(now.evidence)}.")
    next_ones = [_from_to(window, found.tz) for window in found.next_ones]
    of_the_week = [_of_week(window) for window in found.of_the_week]
    return Group(
        _table(f"{label} {found.state}, from now on", found.next_ones, next_ones, name="next"),
        Text(),
        _table("in a typical week", found.of_the_week, of_the_week, name="of_the_week"),
        *(Text(line, style="dim") for line in _notes(found)),
    )


def _table(
    title: str, windows: Sequence[LikelyHours], when: Sequence[str], *, name: str
) -> ColumnTable:
    table = ColumnTable([
        TableColumn(name, title, least=len("Mon 2026-03-02 08:00 to Tue 09:00")),
        TableColumn("", "P (90 % interval)"),
        TableColumn("p"),
        TableColumn("low"),
        TableColumn("high"),
    ], gap=2)  # fmt: skip
    for window, said in zip(windows, when, strict=True):
        numbers = (window.probability, window.low, window.high)
        table.add(said, with_interval(*numbers), *(f"{number:.4f}" for number in numbers))
    return table


def _from_to(window: LikelyHours, tz: str) -> str:
    """Return `Mon 2026-03-02 08:00 to 12:00`, with the day again where it is another."""
    start, end = (format_short(ns, tz, seconds=False) for ns in (window.start_ns, window.end_ns))
    last_hour = window.first_hour + window.hours
    day = DAY_NAMES[window.first_hour // HOURS]
    last_date, _, until = end.partition(" ")
    if not start.startswith(last_date) and until != "00:00":
        until = f"{DAY_NAMES[last_hour // HOURS % 7]} {until}"
    return f"{day} {start} to {'24:00' if until == '00:00' else until}"


def _of_week(window: LikelyHours) -> str:
    """Return `Mon 08:00 to 12:00`."""
    first, last = window.first_hour, window.first_hour + window.hours
    until = f"{(last - 1) % HOURS + 1:02}:00"
    if (last - 1) // HOURS != first // HOURS:
        until = f"{DAY_NAMES[(last - 1) // HOURS % 7]} {until}"
    return f"{DAY_NAMES[first // HOURS]} {first % HOURS:02}:00 to {until}"


def _wait(found: BestTime) -> str:
    """Return `2 h 10 min (1 h 40 min to 3 h)`, the interval where there is a wait."""
    assert found.wait_s is not None
    assert found.wait_interval_s is not None
    mean, least, most = (
        duration(round(seconds) * SECOND_NS) for seconds in (found.wait_s, *found.wait_interval_s)
    )
    return mean if least == most else f"{mean} ({least} to {most})"


def _notes(found: BestTime) -> list[str]:
    now = found.now
    said = with_interval(now.p_open, now.low, now.high) if now.is_known else "UNKNOWN"
    notes = [f"now, {moment_in_words(now.known_ns, found.tz)} ({found.tz}): P(open) {said}"]
    if found.wait_s is not None:
        notes.append(f"expected wait until {found.state}: {_wait(found)}")
    if found.never_seen.any():
        notes.append(f"left out, never seen then: {spans_in_short(found.never_seen)}")
    return notes
