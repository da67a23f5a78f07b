"""The day's chart: bars of the right height, in 80 columns, readable without colours."""

from __future__ import annotations

import io
import re

import numpy as np
import pytest
from rich.console import Console

from semmap_log.analysis.day import SLOT_NS, Day, DoorDay
from semmap_log.core.folds.timeline import TimeShares
from semmap_log.core.model.doors import DoorId
from semmap_log.views.day_chart import day_chart

MIDNIGHT_NS = 1_772_406_000 * 10**9
"""2026-03-02T00:00 in Vienna."""


def day_of(*doors: tuple[str, list[float]]) -> Day:
    """Return a day of doors, each with its shares of the first half hours; 9: not there."""
    made = []
    for number, (label, given) in enumerate(doors):
        opened = np.array([*given, *[9.0] * (48 - len(given))])
        there = opened != 9
        shares = TimeShares(np.where(there, opened, np.nan), 1.0 * there, 1.0 * there)
        made.append(DoorDay(DoorId(number + 1), label, len(given), shares))
    return Day("Europe/Vienna", MIDNIGHT_NS + SLOT_NS * np.arange(49), made)


def printed(
    day: Day, most: int | None = None, *, colours: bool = False, width: int = 80
) -> list[str]:
    """Return the lines as a terminal has them."""
    out = io.StringIO()
    system = "standard" if colours else None
    Console(file=out, width=width, force_terminal=colours, color_system=system).print(
        day_chart(day, most)
    )
    return out.getvalue().splitlines()


def test_the_higher_the_bar_the_longer_it_was_open() -> None:
    """The lowest and the highest bar stand for all of the half hour, and for nothing else."""
    day = day_of(("front", [0.0, 0.001, 0.5, 0.999, 1.0, np.nan]))

    head, row, legend = printed(day)

    assert "front ▁▂▅▇█·" == " ".join(row.split())
    assert ["2026-03-02", "00", "03", "06", "09", "12", "15", "18", "21"] == head.split()
    assert 6 == head.index(" 03 ") - head.index(" 00 ")
    assert row.index("▁") == head.index(" 00 ") + 1
    assert legend.startswith("▁ closed")


def test_an_hour_that_comes_twice_is_written_once() -> None:
    """Havana's midnight of 1 November 2026; the hours behind it stand over their bars."""
    begin_ns = 1_793_505_600 * 10**9  # 04:00 UTC
    shares = TimeShares(np.ones(50), np.ones(50), np.ones(50))
    doors = [DoorDay(DoorId(1), "front", 50, shares)]

    head = printed(Day("America/Havana", begin_ns + SLOT_NS * np.arange(51), doors))[0]

    assert ["2026-11-01", "00", "03", "06", "09", "12", "15", "18", "21"] == head.split()
    assert 8 == head.index(" 03 ") - head.index(" 00 ")


def test_the_liveliest_doors_are_drawn_and_the_others_counted() -> None:
    """In the order of their ids; the rest is not hidden."""
    day = day_of(("a", [1.0]), ("b", [1.0, 0.0, 1.0]), ("c", []), ("d", [0.0, 1.0]))

    lines = printed(day, 2)

    assert ["b", "d"] == [line.split()[0] for line in lines[1:3]]
    assert "2 doors that changed less: --all-doors" in lines[-1]
    assert 4 == len(printed(day)[1:-1])


def test_it_fits_a_terminal_whatever_doors_are_called() -> None:
    """Long names and names of wide letters go on in the next line."""
    day = day_of(("L1_" + "x" * 90, [1.0] * 48), ("門" * 40, [0.0]), ("\x1b[31mred", [0.5]))

    lines = printed(day)

    assert all(len(line) + sum(c == "門" for c in line) <= 80 for line in lines)
    assert not any("\x1b" in line for line in lines)
    assert any("█" * 48 in line for line in lines)


def test_colours_say_the_same() -> None:
    """Mostly open is green, mostly closed red, unknown yellow."""
    _, row, _ = printed(day_of(("front", [0.9, 0.1, np.nan])), colours=True)

    assert [("32", "▇"), ("31", "▂"), ("33", "·")] == re.findall("\x1b\\[(3.)m(.)", row)


@pytest.mark.parametrize(("width", "bars"), [(80, 47), (50, 24), (30, 12), (22, 6)])
def test_a_day_of_47_half_hours_has_bars_in_any_width(width: int, bars: int) -> None:
    """Lord Howe's clocks change by half an hour."""
    begin_ns = 1_759_584_600 * 10**9
    open_till_noon = np.array([1.0] * 23 + [0.0] * 24)
    shares = TimeShares(open_till_noon, np.ones(47), np.ones(47))
    day = Day(
        "Australia/Lord_Howe", begin_ns + SLOT_NS * np.arange(48),
        [DoorDay(DoorId(1), "front", 2, shares)],
    )  # fmt: skip

    head, row, *_ = printed(day, width=width)
    drawn = row[len(head.split()[0]) + 1 :]

    assert head.startswith("2025-10-05 00")
    assert bars == len(drawn)
    assert ("█", "▁") == (drawn[0], drawn[-1])
    assert len(head.rstrip()) <= width
