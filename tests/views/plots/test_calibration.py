"""Reliability diagrams: what is drawn, asked of matplotlib itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="not installed: pip install 'semmap-log[plots]'")

from semmap_log.analysis.beliefs.evaluation import Evaluation, evaluate
from semmap_log.analysis.beliefs.protocol import Protocol
from semmap_log.analysis.probabilities.belief_fold import by_name
from semmap_log.analysis.probabilities.scores import BINS
from semmap_log.views.plots.calibration import draw_calibration, plot_calibration
from tests.analysis.beliefs.patrolled import patrolled


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Evaluation:
    log = patrolled(tmp_path_factory.mktemp("calibration") / "log")
    methods = [by_name(name) for name in ("schedule", "hour_of_day", "constant", "count", "last")]
    return evaluate(log, methods, Protocol(prequential=True))


@pytest.mark.slow
def test_a_dot_stands_where_a_bin_says_and_what_came(found: Evaluation) -> None:
    """At the mean forecast and the share that came; the fullest bin has the greatest dot."""
    diagram = draw_calibration(found, name="x").axes[0]

    rows = found.reliability["schedule"].rows()
    (dots,) = diagram.collections
    np.testing.assert_allclose([row[:2] for row in rows], dots.get_offsets())
    assert np.argmax([row[2] for row in rows]) == np.argmax(dots.get_sizes())


def test_the_bars_count_the_forecasts_of_each_bin(found: Evaluation) -> None:
    """Ten of them, all panels to one scale, with the number above each that is not empty."""
    figure = draw_calibration(found, name="x")

    counts = found.reliability["schedule"].count
    bars = figure.axes[4]
    assert counts.tolist() == [bar.get_height() for bar in bars.patches]
    assert BINS == len(bars.patches)
    assert np.count_nonzero(counts) == len(bars.texts)
    most = max(found.reliability[name].count.max() for name in found.reliability)
    assert all(figure.axes[i].get_ylim()[1] > most for i in (4, 5, 6, 7, 12))


def test_axes_and_lines_have_their_names(found: Evaluation) -> None:
    """Each estimator its panel, with its figures; forecasts along, outcomes up; one legend."""
    figure = draw_calibration(found, name="a$b")

    shown = [axes for axes in figure.axes if axes.get_visible()]
    titles = [axes.get_title() for axes in shown if axes.get_title()]
    assert ["schedule", "hour_of_day", "constant", "count", "last"] == titles
    assert f"Brier {found.mean['hour_of_day'].brier:.4f}" in shown[1].texts[0].get_text()
    assert {"forecast P(open)", ""} == {axes.get_xlabel() for axes in shown}
    assert {"share next read as open", "forecasts", ""} == {axes.get_ylabel() for axes in shown}
    (legend,) = figure.legends
    assert ["perfect: as forecast, so it came", "forecasts of a bin; area: how many"] == [
        text.get_text() for text in legend.get_texts()
    ]
    assert "a\\$b, 2 doors\nknown at each forecast: " in figure.get_suptitle()


@pytest.mark.slow
def test_the_same_diagram_is_the_same_file(found: Evaluation, tmp_path: Path) -> None:
    """No time, no random names in it."""
    for name in ("a.svg", "b.svg"):
        plot_calibration(found, tmp_path / name, name="x")

    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
