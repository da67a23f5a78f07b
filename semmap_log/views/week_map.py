"""Typical hours, days and weeks as maps of cells in a terminal, readable without colours, too.

A cell is a digit: 0 stands for a probability below .1, 9 for .9 and more; where there are colours,
they say the same.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from semmap_log.beliefs.typical_week import Pattern, TypicalWeek
from semmap_log.probabilities.evidence.coverage import DAY_NAMES, HOURS
from semmap_log.views.belief_words import (
    interval,
    moment_in_words,
    never_seen_lines,
    short_number,
    why_unknown,
)
from semmap_log.views.event_words import printable
from semmap_log.views.palette import Rgb
from semmap_log.views.tables import OTHER_STATE_COLOUR, SHORTEST_NAME
from semmap_log.views.week_shades import ink_on, shade

NEVER_SEEN = "·"
LITTLE_SEEN = "?"
LEGEND = (
    f"tenths of P(open), 0: below .1, 9: from .9 on; {NEVER_SEEN}: never seen then, "
    f"{LITTLE_SEEN}: too little"
)

WIDE, NARROW = 3, 2
"""Columns of text a cell: of a map of its own, and of one of many rows."""


def week_maps(weeks: Sequence[TypicalWeek]) -> RenderableType:
    """Return a map for each door, 7 rows of 24 cells."""
    parts: list[RenderableType] = []
    for week in weeks:
        parts += [_title(week), *_map(week), Text()]
    return Group(*parts, *_notes(weeks))


def hour_rows(weeks: Sequence[TypicalWeek]) -> RenderableType:
    """Return a row of 24 cells for each door: its typical day."""
    table = _table()
    table.add_column(_scale(NARROW), no_wrap=True, min_width=HOURS * NARROW)
    for week in weeks:
        is_seen = np.asarray(week.is_seen.any(axis=0))
        cells = _row(week.by_hour(), is_seen, NARROW) if week.is_known else _unknown(week)
        table.add_row(*_names(week), cells)
    return Group(table, *_notes(weeks))


def weekday_rows(weeks: Sequence[TypicalWeek]) -> RenderableType:
    """Return P(open) and its interval for the seven days, two lines for each door."""
    table = _table()
    for day in DAY_NAMES:
        table.add_column(day, no_wrap=True)
    for week in weeks:
        days = week.by_weekday()
        cells = [
            f"{short_number(p)}\n{interval(low, high)}" if known else NEVER_SEEN
            for p, low, high, known in zip(
                days.p_open, days.low, days.high, days.is_known, strict=True
            )
        ]
        if week.is_known:
            table.add_row(*_names(week), *cells)
        else:
            number, name = _names(week)
            table.add_row(number, name.append("\n").append(_unknown(week)), *[NEVER_SEEN] * 7)
    return Group(table, *_notes(weeks, legend="P(open), and its 90 % interval"))


def _title(week: TypicalWeek) -> Text:
    return Text(f"{week.door.door_id} {printable(week.door.label)}", style="bold")


def _table() -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("id", justify="right", no_wrap=True)
    table.add_column("name", overflow="fold", min_width=SHORTEST_NAME)
    return table


def _names(week: TypicalWeek) -> tuple[str, Text]:
    return str(week.door.door_id), Text(printable(week.door.label))


def _unknown(week: TypicalWeek) -> Text:
    return Text(f"UNKNOWN, {why_unknown(week.evidence)}", style=OTHER_STATE_COLOUR)


def _map(week: TypicalWeek) -> list[Text]:
    if not week.is_known:
        return [_unknown(week)]
    rows = [Text("    ").append(_scale(WIDE))]
    for day, name in enumerate(DAY_NAMES):
        cells = _row(week.hours.taken(day), week.is_seen[day], WIDE)
        rows.append(Text(f"{name} ").append(cells))
    return rows


def _scale(width: int) -> Text:
    """Return the hours above the cells, each third one."""
    return Text("".join(f"{hour:<{3 * width}}" for hour in range(0, HOURS, 3)), style="dim")


def _row(cells: Pattern, is_seen: NDArray[np.bool_], width: int) -> Text:
    row = Text()
    for p, known, seen in zip(cells.p_open, cells.is_known, is_seen, strict=True):
        if known:
            colour = shade(p)
            row.append(f"{_digit(p):<{width}}", _style(ink_on(colour), colour))
        else:
            row.append(f"{LITTLE_SEEN if seen else NEVER_SEEN:<{width}}", "dim")
    return row


def _style(ink: Rgb, ground: Rgb) -> str:
    return "rgb({},{},{}) on rgb({},{},{})".format(*ink, *ground)


def _digit(probability: float) -> int:
    return min(int(np.floor(probability * 10)), 9)


def _notes(weeks: Sequence[TypicalWeek], legend: str = LEGEND) -> list[Text]:
    first = weeks[0]
    known = moment_in_words(first.known_ns, first.tz)
    notes = [legend, f"hours of {first.tz}, by {first.estimator}, as known at {known}"]
    notes += never_seen_lines((week.door, week.evidence) for week in weeks)
    return [Text(note, style="dim") for note in notes]
