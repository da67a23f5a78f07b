"""Plots of typical weeks: what is drawn, asked of matplotlib itself."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="not installed: pip install 'semmap-log[plots]'")

from semmap_log.analysis.beliefs.door_beliefs import TypicalWeek, typical_weeks
from semmap_log.core.model.doors import DoorId
from semmap_log.errors import FormatError, MissingExtraError, OutputError
from semmap_log.views.plots.figures import letters_of
from semmap_log.views.plots.typical_weeks import MOST_PANELS, UNSURE, draw_weeks, plot_weeks
from tests.analysis.beliefs.patrolled import patrolled


@pytest.fixture(scope="module")
def weeks(tmp_path_factory: pytest.TempPathFactory) -> list[TypicalWeek]:
    return typical_weeks(patrolled(tmp_path_factory.mktemp("plots") / "log"))


def test_cells_are_coloured_where_known_and_hatched_elsewhere(weeks: list[TypicalWeek]) -> None:
    """The colours are the probabilities; under what is masked lies a hatched ground."""
    front = weeks[0]

    panel = draw_weeks([front], "week").axes[0]

    (mesh,) = panel.collections
    drawn = mesh.get_array()
    np.testing.assert_array_equal(~front.hours.is_known, np.ma.getmaskarray(drawn))
    np.testing.assert_array_equal(front.hours.p_open[front.hours.is_known], np.ma.compressed(drawn))
    assert ["////"] == [ground.get_hatch() for ground in panel.patches]
    assert mesh.get_zorder() > panel.patches[0].get_zorder()


def test_unsure_cells_bear_a_dot(weeks: list[TypicalWeek]) -> None:
    """Those that are known, and whose interval is wide."""
    hours = weeks[0].hours

    panel = draw_weeks([weeks[0]], "week").axes[0]

    days, at = np.nonzero(hours.is_known & (hours.high - hours.low > UNSURE))
    (dots,) = panel.lines
    np.testing.assert_array_equal(np.column_stack([at, days]) + 0.5, dots.get_xydata())


def test_hours_have_their_band(weeks: list[TypicalWeek]) -> None:
    """A step and a band for each hour that was seen; the eleven others are hatched."""
    hours = weeks[0].by_hour()

    panel = draw_weeks([weeks[0]], "hour").axes[0]

    band, line = panel.patches[-2:]
    known = np.where(hours.is_known, 1, np.nan)
    np.testing.assert_array_equal(hours.p_open * known, line.get_data().values)
    np.testing.assert_array_equal(hours.high * known, band.get_data().values)
    np.testing.assert_array_equal(hours.low * known, band.get_data().baseline)
    assert 11 == sum(patch.get_hatch() == "////" for patch in panel.patches)


@pytest.mark.parametrize("doors", [1, 3, 19])
def test_each_door_has_a_panel_with_its_name(doors: int, weeks: list[TypicalWeek]) -> None:
    """Zone, estimator and moment stand above; a door never seen says so in its title."""
    shown = [weeks[i % 3] for i in range(doors)]

    figure = draw_weeks(shown, "week")

    titles = [panel.get_title(loc="left") for panel in figure.axes]
    names = ["front", "store", "attic: UNKNOWN, never seen"]
    assert [names[i % 3] for i in range(doors)] == [title for title in titles if title]
    assert "as known at 2026-03-29 19:30" in figure.get_suptitle()
    assert "hour of the day, Europe/Vienna; dot: " in figure.get_supxlabel()


@pytest.mark.slow
def test_the_same_plot_is_the_same_file(weeks: list[TypicalWeek], tmp_path: Path) -> None:
    """No time, no random names in it."""
    for name in ("a.svg", "b.svg", "a.png", "b.png"):
        plot_weeks(weeks, tmp_path / name)

    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_what_cannot_be_written_is_an_error(weeks: list[TypicalWeek], tmp_path: Path) -> None:
    """Another format, a folder that is not there; nothing is left behind."""
    with pytest.raises(FormatError, match=r"x\.gif: expected a name that ends in \.png or \.svg"):
        plot_weeks(weeks, tmp_path / "x.gif")
    with pytest.raises(OutputError, match="could not be written"):
        plot_weeks(weeks, tmp_path / "no" / "x.png")

    assert [] == list(tmp_path.iterdir())


def test_without_matplotlib_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if it had never been installed."""
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for name in ("figures", "typical_weeks"):
        monkeypatch.delitem(sys.modules, f"semmap_log.views.plots.{name}", raising=False)
        monkeypatch.delattr(f"semmap_log.views.plots.{name}", raising=False)

    with pytest.raises(MissingExtraError, match=r"pip install 'semmap-log\[plots\]'"):
        import semmap_log.views.plots.typical_weeks  # noqa: F401


def test_a_name_without_letters_gives_way_to_the_number(weeks: list[TypicalWeek]) -> None:
    """In a .png, whose fonts have no hieroglyphs; an .svg keeps them, for whoever has the font."""
    door = replace(weeks[0].door, annotations={"name": "\U00013000 hall"})
    hieroglyph = replace(weeks[0], door=door)

    png, svg = (
        draw_weeks([hieroglyph], "week", letters_of(Path(name))).axes[0].get_title(loc="left")
        for name in ("x.png", "x.svg")
    )

    assert (f"door {door.door_id}", "\U00013000 hall") == (png, svg)


def test_of_hundreds_of_doors_the_first_are_drawn_and_counted(weeks: list[TypicalWeek]) -> None:
    """As many as have lanes on a page of the report; it says how many there are."""
    page = resources.files("semmap_log.views.report").joinpath("page")
    lanes = re.search(
        r"LANES_ON_A_PAGE = (\d+)", page.joinpath("lanes.js").read_text(encoding="utf-8")
    )

    figure = draw_weeks([weeks[0]] * (MOST_PANELS + 50), "weekday")

    assert lanes is not None
    assert int(lanes[1]) == MOST_PANELS
    assert MOST_PANELS == sum(panel.get_title(loc="left") == "front" for panel in figure.axes)
    assert figure.get_suptitle().endswith(f"; the first {MOST_PANELS} of {MOST_PANELS + 50} doors")


def test_titles_tell_doors_of_one_name_apart(weeks: list[TypicalWeek]) -> None:
    other = replace(weeks[0], door=replace(weeks[0].door, door_id=DoorId(77)), level_name="L2")

    figure = draw_weeks([replace(weeks[0], level_name="L1"), other], "week")

    assert ["L1/front", "L2/front"] == [p.get_title(loc="left") for p in figure.axes[:2]]
