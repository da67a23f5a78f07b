"""Typical hours, days and weeks as maps of cells in a terminal, readable without colours, too.

A cell is a digit: 0 stands for a probability below .1, 9 for .9 and more; where there are colours,
they say the same.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.analysis.beliefs.door_beliefs import TypicalWeek, WeekPattern
from semmap_log.analysis.probabilities.evidence.coverage import DAY_NAMES, HOURS
from semmap_log.views import belief_words
from semmap_log.views.column_table import ColumnTable, TableColumn, TextPicture
from semmap_log.views.event_words import printable
from semmap_log.views.palette import Rgb, ink_on, shade
from semmap_log.views.tables import ABSENT, OTHER_STATE_COLOUR, SHORTEST_NAME

NEVER_SEEN = "·"
LITTLE_SEEN = "?"
LEGEND = (
    f"tenths of P(open), 0: below .1, 9: from .9 on; {NEVER_SEEN}: never seen then, "
    f"{LITTLE_SEEN}: too little"
)

WIDE, NARROW = 3, 2
"""Columns of text a cell: of a map of its own, and of one of many rows."""
FULL_WIDTH = 80
"""Columns of text in which seven days stand side by side."""

NAMES = [TableColumn("", "id", right=True), TableColumn("", "name", least=8)]


def week_maps(weeks: Sequence[TypicalWeek]) -> RenderableType:
    """Return a map for each door, 7 rows of 24 cells."""

    def drawn(width: int) -> RenderableType:
        cell = _cell_width(width, WIDE, beside=len("Mon "))
        parts: list[RenderableType] = []
        for week in weeks:
            parts += [_title(week), *_map(week, cell), Text()]
        return Group(*parts)

    table = _machine_table("weekday", "hour")
    for week in weeks:
        for day, name in enumerate(DAY_NAMES):
            _tell(table, week, week.hours.taken(day), [(name, str(hour)) for hour in range(HOURS)])
    return Group(TextPicture(drawn, table), *_notes(weeks))


def hour_rows(weeks: Sequence[TypicalWeek]) -> RenderableType:
    """Return a row of 24 cells for each door: its typical day."""

    def drawn(width: int) -> RenderableType:
        cell = _cell_width(width, NARROW, beside=len("123 ") + SHORTEST_NAME + 1)
        table = ColumnTable([*NAMES, TableColumn("", _scale(cell).plain)])
        for week in weeks:
            is_seen = np.asarray(week.is_seen.any(axis=0))
            cells = _row(week.by_hour(), is_seen, cell) if week.is_known else _unknown(week)
            table.add(*_names(week), cells)
        return table

    table = _machine_table("hour")
    for week in weeks:
        _tell(table, week, week.by_hour(), [(str(hour),) for hour in range(HOURS)])
    return Group(TextPicture(drawn, table), *_notes(weeks))


def hour_table(weeks: Sequence[TypicalWeek], day: int, hour: int) -> RenderableType:
    """Return P(open) and its interval in one hour of the week, a row for each door."""
    table = ColumnTable(
        [
            TableColumn("door_id", "id", right=True), TableColumn("name", "name", least=8),
            TableColumn("", "P(open)"),
            *(TableColumn(name) for name in ("p_open", "low", "high")),
        ]
    )  # fmt: skip
    for week in weeks:
        cell = week.hours.taken((day, hour))
        numbers = float(cell.p_open), float(cell.low), float(cell.high)
        if cell.is_known:
            exact = [f"{value:.4f}" for value in numbers]
            table.add(*_names(week), belief_words.with_interval(*numbers), *exact)
        elif week.is_known and not week.is_seen[day, hour]:
            never = Text("never seen then", style=OTHER_STATE_COLOUR)
            table.add(*_names(week), never, *[ABSENT] * 3)
        else:
            table.add(*_names(week), _unknown(week), *[ABSENT] * 3)
    legend = f"typical of {DAY_NAMES[day]} {hour:02}:00 to {hour + 1:02}:00; 90 % interval"
    return Group(table, *_notes(weeks, legend))


def weekday_rows(weeks: Sequence[TypicalWeek]) -> RenderableType:
    """Return P(open) and its interval for the seven days, two lines for each door."""

    def drawn(width: int) -> RenderableType:
        return _days_across(weeks) if width >= FULL_WIDTH else _days_below(weeks)

    table = _machine_table("weekday")
    for week in weeks:
        _tell(table, week, week.by_weekday(), [(name,) for name in DAY_NAMES])
    return Group(TextPicture(drawn, table), *_notes(weeks, legend="P(open), and its 90 % interval"))


def _days_across(weeks: Sequence[TypicalWeek]) -> ColumnTable:
    table = ColumnTable([*NAMES, *(TableColumn("", day) for day in DAY_NAMES)])
    for week in weeks:
        days = week.by_weekday()
        cells = [
            f"{belief_words.short_number(p)}\n{belief_words.interval(low, high)}"
            if known
            else NEVER_SEEN
            for p, low, high, known in zip(
                days.p_open, days.low, days.high, days.is_known, strict=True
            )
        ]
        if week.is_known:
            table.add(*_names(week), *cells)
        else:
            number, name = _names(week)
            table.add(number, name.append("\n").append(_unknown(week)), *[NEVER_SEEN] * 7)
    return table


def _days_below(weeks: Sequence[TypicalWeek]) -> ColumnTable:
    """Return the same, a row a day, for narrow terminals."""
    table = ColumnTable([*NAMES, TableColumn("", "day"), TableColumn("", "P(open)")])
    for week in weeks:
        days, names = week.by_weekday(), _names(week)
        if not week.is_known:
            table.add(*names, "", _unknown(week))
            continue
        for day, name in enumerate(DAY_NAMES):
            p, low, high = days.p_open[day], days.low[day], days.high[day]
            said = belief_words.with_interval(p, low, high) if days.is_known[day] else NEVER_SEEN
            table.add(*(names if day == 0 else ("", "")), name, said)
    return table


def _machine_table(*of: str) -> ColumnTable:
    """Return the table for programs: a row a cell, whose place in the week `of` names."""
    names = ("door_id", "name", *of, "p_open", "low", "high")
    return ColumnTable([TableColumn(name) for name in names])


def _tell(
    table: ColumnTable, week: TypicalWeek, cells: WeekPattern, places: Sequence[tuple[str, ...]]
) -> None:
    """Add a row for each cell; cells with too little evidence have no numbers."""
    numbers = zip(places, cells.p_open, cells.low, cells.high, cells.is_known, strict=True)
    names = _names(week)  # once: a name from a stranger's log may be long
    for place, p_open, low, high, is_known in numbers:
        known = [f"{value:.4f}" for value in (p_open, low, high)]
        table.add(*names, *place, *(known if is_known and week.is_known else [ABSENT] * 3))


def _cell_width(width: int, wanted: int, *, beside: int) -> int:
    """Return how many columns of text a cell may take, with `beside` columns next to the cells."""
    return max(1, min(wanted, (width - beside) // HOURS))


def _title(week: TypicalWeek) -> Text:
    return Text(f"{week.door.door_id} {printable(week.door.label)}", style="bold")


def _names(week: TypicalWeek) -> tuple[str, Text]:
    return str(week.door.door_id), Text(printable(week.door.label))


def _unknown(week: TypicalWeek) -> Text:
    return Text(f"UNKNOWN, {belief_words.why_unknown(week.evidence)}", style=OTHER_STATE_COLOUR)


def _map(week: TypicalWeek, width: int) -> list[Text]:
    if not week.is_known:
        return [_unknown(week)]
    rows = [Text("    ").append(_scale(width))]
    for day, name in enumerate(DAY_NAMES):
        cells = _row(week.hours.taken(day), week.is_seen[day], width)
        rows.append(Text(f"{name} ").append(cells))
    return rows


def _scale(width: int) -> Text:
    """Return the hours above the cells, each third one."""
    return Text("".join(f"{hour:<{3 * width}}" for hour in range(0, HOURS, 3)), style="dim")


def _row(cells: WeekPattern, is_seen: NDArray[np.bool_], width: int) -> Text:
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
    known = belief_words.moment_text(first.known_ns, first.tz)
    notes = [legend, f"hours of {first.tz}, as known at {known}"]
    notes += belief_words.never_seen_lines(weeks)
    return [Text(note, style="dim") for note in notes]
