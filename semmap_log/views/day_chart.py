"""A day of the doors in a terminal: a line of bars a door, readable without colours, too.

The higher a bar, the more of its half hour the door was open, of the time in which that was known.
"""

from __future__ import annotations

import math

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from semmap_log.day import Day
from semmap_log.doors import DoorState
from semmap_log.moments import format_local
from semmap_log.projections.time_shares import TimeShares
from semmap_log.views.event_words import printable
from semmap_log.views.tables import OTHER_STATE_COLOUR, STATE_COLOURS

BARS = "▁▂▃▄▅▆▇█"
"""Closed all the time; six in between; open all the time."""
NOT_KNOWN, NOT_THERE = "·", " "
LEGEND = f"{BARS[0]} closed  {BARS[3]} partly  {BARS[-1]} open  {NOT_KNOWN} unknown"
NAME_WIDTH = 30
"""So that 48 bars fit 80 columns."""
EVERY_HOURS = 3


def day_chart(day: Day, most: int | None) -> RenderableType:
    """Return a row a door, in 80 columns; the liveliest where there are more than `most`."""
    shown = list(day.doors) if most is None else day.liveliest(most)
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column(day.date, max_width=NAME_WIDTH, overflow="fold")
    table.add_column(_scale(day), no_wrap=True)
    for door in shown:
        table.add_row(Text(printable(door.label)), _bars(door.shares))
    left_out = len(day.doors) - len(shown)
    doors = "door" if left_out == 1 else "doors"
    more = f"; {left_out} {doors} that changed less: --all-doors" if left_out else ""
    return Group(table, Text(f"{LEGEND}{more}", style="dim"))


def _bars(shares: TimeShares) -> Text:
    line = Text()
    for opened, there in zip(shares.opened.tolist(), shares.there.tolist(), strict=True):
        if not there:
            line.append(NOT_THERE)
        elif math.isnan(opened):
            line.append(NOT_KNOWN, style=OTHER_STATE_COLOUR)
        else:
            mostly = DoorState.OPEN if opened >= 0.5 else DoorState.CLOSED
            line.append(_bar(opened), style=STATE_COLOURS[mostly])
    return line


def _bar(opened: float) -> str:
    """Return the bar of a share; the lowest and the highest mean all of the time."""
    if opened in {0.0, 1.0}:
        return BARS[-1] if opened else BARS[0]
    between = BARS[1:-1]
    return between[min(int(opened * len(between)), len(between) - 1)]


def _scale(day: Day) -> str:
    """Return the hours above the bars, as the building's clocks show them."""
    line, last = [" "] * len(day.edges_ns), ""
    for place, start_ns in enumerate(day.edges_ns[:-1].tolist()):
        hour, minute = format_local(start_ns, day.tz)[len("2026-03-08 ") :].split(":")[:2]
        if minute == "00" and int(hour) % EVERY_HOURS == 0 and hour != last:  # it may come twice
            line[place : place + 2] = last = hour
    return "".join(line)[: len(day.edges_ns) - 1]
