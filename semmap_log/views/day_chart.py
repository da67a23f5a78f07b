"""A day of the doors in a terminal: a line of bars a door, readable without colours, too.

The higher a bar, the more of its half hour (in narrow terminals: of its one, two or four hours) the
door was open, of the time in which that was known.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.analysis.day import Day
from semmap_log.core.folds.timeline import TimeShares
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.moments import format_local
from semmap_log.core.texts import counted
from semmap_log.views.column_table import GAP, ColumnTable, TableColumn, TextPicture
from semmap_log.views.event_words import printable
from semmap_log.views.tables import ABSENT, OTHER_STATE_COLOUR, SHORTEST_NAME, STATE_COLOURS

BARS = "▁▂▃▄▅▆▇█"
"""Closed all the time; six in between; open all the time."""
NOT_KNOWN, NOT_THERE = "·", " "
LEGEND = f"{BARS[0]} closed  {BARS[3]} partly  {BARS[-1]} open  {NOT_KNOWN} unknown"
NAME_WIDTH = 30
"""So that 48 bars fit 80 columns."""
EVERY_HOURS = 3
SLOTS_A_BAR = (1, 2, 4, 8)


def day_chart(day: Day, most: int | None) -> RenderableType:
    """Return a row a door; drawn, only the liveliest where there are more than `most`."""
    shown = list(day.doors) if most is None else day.liveliest(most)
    left_out = len(day.doors) - len(shown)
    more = f"; {counted(left_out, 'door')} that changed less: --all-doors" if left_out else ""

    def drawn(width: int) -> RenderableType:
        every = _half_hours_a_bar(width, len(day.edges_ns) - 1)
        table = ColumnTable([
            TableColumn("", day.date, least=SHORTEST_NAME, most=NAME_WIDTH),
            TableColumn("", _scale(day, every)),
        ])  # fmt: skip
        for door in shown:
            table.add(Text(printable(door.label)), _bars(door.shares, every))
        return Group(table, Text(f"{LEGEND}{more}", style="dim"))

    return TextPicture(drawn, _told(day))


def _told(day: Day) -> ColumnTable:
    """Return all doors for programs: how much of each half hour they were open."""
    starts = [format_local(ns, day.tz) for ns in day.edges_ns[:-1].tolist()]
    table = ColumnTable([TableColumn(name) for name in ("door_id", "name", "changes", *starts)])
    for door in day.doors:
        opened = (f"{share:.4f}" for share in door.shares.opened.tolist())
        cells = (ABSENT if share == "nan" else share for share in opened)
        table.add(str(door.door_id), door.label, str(door.changes), *cells)
    return table


def _half_hours_a_bar(width: int, slots: int) -> int:
    """Return how many half hours make one bar, so that all bars fit next to a name."""
    fitting = (n for n in SLOTS_A_BAR if SHORTEST_NAME + GAP + math.ceil(slots / n) <= width)
    return next(fitting, SLOTS_A_BAR[-1])


def _bars(shares: TimeShares, every: int) -> Text:
    """Return a bar for each half hour, or for so many of them together."""
    line = Text()
    known = _together(shares.known, every)
    opened_known = np.where(known > 0, _together(shares.opened, every), 0) * known
    with np.errstate(invalid="ignore"):
        opened_shares = opened_known.sum(axis=1) / known.sum(axis=1)
    is_there = _together(shares.there, every).max(axis=1)
    if every == 1:
        opened_shares = shares.opened
    for opened, there in zip(opened_shares.tolist(), is_there.tolist(), strict=True):
        if not there:
            line.append(NOT_THERE)
        elif math.isnan(opened):
            line.append(NOT_KNOWN, style=OTHER_STATE_COLOUR)
        else:
            mostly = DoorState.OPEN if opened >= 0.5 else DoorState.CLOSED
            line.append(_bar(opened), style=STATE_COLOURS[mostly])
    return line


def _together(shares: NDArray[np.float64], every: int) -> NDArray[np.float64]:
    """Return rows of `every` half hours; a day of 47 of them ends within one."""
    return np.pad(shares, (0, -len(shares) % every)).reshape(-1, every)


def _bar(opened: float) -> str:
    """Return the bar of a share; the lowest and the highest mean all of the time."""
    if opened in {0.0, 1.0}:
        return BARS[-1] if opened else BARS[0]
    between = BARS[1:-1]
    return between[min(int(opened * len(between)), len(between) - 1)]


def _scale(day: Day, every: int) -> str:
    """Return the hours above the bars, as the building's clocks show them."""
    bars = math.ceil((len(day.edges_ns) - 1) / every)
    line, last = [" "] * (bars + 1), ""
    step = EVERY_HOURS * max(1, every // 2)
    for place, start_ns in enumerate(day.edges_ns[:-1].tolist()):
        hour, minute = format_local(start_ns, day.tz)[len("2026-03-08 ") :].split(":")[:2]
        at = place // every
        has_room = at == 0 or line[at - 1] == " "  # a day may have lost an hour
        if minute == "00" and int(hour) % step == 0 and hour != last and has_room:
            line[at : at + 2] = last = hour  # once, though it may come twice
    return "".join(line)[:bars]
