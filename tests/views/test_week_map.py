"""Maps of cells in a terminal."""

from __future__ import annotations

import dataclasses
import io

import numpy as np
import pytest
from rich.console import Console, RenderableType

import semmap_log as sl
from semmap_log.analysis.beliefs.door_beliefs import TypicalWeek, typical_weeks
from semmap_log.views.belief_words import short_number
from semmap_log.views.palette import VIRIDIS, ink_on, shade
from semmap_log.views.week_map import hour_rows, week_maps, weekday_rows
from tests.analysis.beliefs.patrolled import patrolled


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> sl.DoorLog:
    return patrolled(tmp_path_factory.mktemp("maps") / "log")


@pytest.fixture(scope="module")
def front(log: sl.DoorLog) -> TypicalWeek:
    return typical_weeks(log, doors=["front"])[0]


def printed(shown: RenderableType, *, terminal: bool = False) -> str:
    out = io.StringIO()
    Console(file=out, width=80, force_terminal=terminal, color_system="truecolor" if terminal
            else None).print(shown)  # fmt: skip
    return out.getvalue()


def test_on_a_terminal_the_digits_have_colours(front: TypicalWeek) -> None:
    """The same digits, on a ground that says the same, in ink that can be read on it."""
    coloured = printed(week_maps([front]), terminal=True)

    red, green, blue = shade(front.hours.p_open[0, 10])
    assert f"48;2;{red};{green};{blue}m" in coloured


def test_a_cell_too_little_seen_is_neither_known_nor_unseen(front: TypicalWeek) -> None:
    """It was looked at, but not often enough: a question mark."""
    known = front.hours.is_known.copy()
    known[0, 7] = False
    week = dataclasses.replace(front, hours=dataclasses.replace(front.hours, is_known=known))

    monday = next(row for row in printed(week_maps([week])).splitlines() if row[:3] == "Mon")

    assert ["·", "?"] == monday[4:].split()[6:8]


def test_digits_are_tenths(front: TypicalWeek) -> None:
    """0 below .1, 9 from .9 on."""
    p_open = np.tile(np.array([0.001, 0.0999, 0.1, 0.55, 0.8999, 0.9, 0.999, 0.5]), 21)
    everywhere = np.ones((7, 24), bool)
    hours = dataclasses.replace(front.hours, p_open=p_open.reshape(7, 24), is_known=everywhere)

    shown = printed(week_maps([dataclasses.replace(front, hours=hours)]))

    monday = next(row for row in shown.splitlines() if row[:3] == "Mon")
    assert ["0", "0", "1", "5", "8", "9", "9", "5"] == monday[4:].split()[:8]


def test_the_days_show_their_interval(front: TypicalWeek) -> None:
    """P(open), and under it where it lies."""
    days = front.by_weekday()

    shown = printed(weekday_rows([front]))

    numbers, intervals = (row.split() for row in shown.splitlines()[1:3])
    assert [short_number(p) for p in days.p_open] == numbers[-7:]
    assert 7 == sum("-" in word for word in intervals)


def test_a_door_never_seen_has_words_instead(log: sl.DoorLog) -> None:
    """In each of the maps."""
    weeks = typical_weeks(log, doors=["attic"])

    for shown in (week_maps(weeks), hour_rows(weeks), weekday_rows(weeks)):
        assert "UNKNOWN, never seen" in printed(shown)


def test_shades_run_from_dark_to_bright() -> None:
    """Each a little lighter than the one before, also in grey; and ink stays readable on all."""
    shades = np.array([shade(p) for p in np.linspace(0, 1, 50)], float)
    grey = shades @ (0.299, 0.587, 0.114)
    inks = np.array([ink_on(tuple(s)) for s in shades]) @ (0.299, 0.587, 0.114)

    assert (np.diff(grey) > 0).all()
    assert (np.abs(grey - inks) > 100).all()
    assert (tuple(VIRIDIS[0]), tuple(VIRIDIS[-1])) == (shade(0.0), shade(1.0))


def test_shades_are_matplotlib_s_viridis() -> None:
    """So that terminal, plot and viewer show the same colour for the same number."""
    colormaps = pytest.importorskip("matplotlib", reason="semmap-log[plots]").colormaps

    for p in np.linspace(0, 1, 21):
        np.testing.assert_allclose(np.array(colormaps["viridis"](p)[:3]) * 255, shade(p), atol=6)
