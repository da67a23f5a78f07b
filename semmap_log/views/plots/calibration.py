"""Reliability diagrams: how often doors were open where so much was forecast."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from semmap_log.analysis.beliefs.evaluation import Evaluation
from semmap_log.analysis.probabilities.scores import BINS, Reliability, Scores
from semmap_log.core.texts import counted
from semmap_log.views.event_words import printable
from semmap_log.views.palette import PLOT_BARS, PLOT_CURVE, PLOT_MARKS
from semmap_log.views.plots.figures import new_figure, save_figure
from semmap_log.views.timeline_table import known_text

PANEL_IN, ROW_IN = 2.6, 3.5
HEAD_IN, FOOT_IN = 0.5, 0.3
COLUMNS = 4
HEIGHTS = (3.0, 1.0)
"""Of a diagram, and of the bars below it."""
LEAST_AREA, MOST_AREA = 6.0, 120.0
"""Points squared: the dots of an almost empty bin, and of the fullest."""


def plot_calibration(evaluation: Evaluation, path: Path, *, name: str) -> None:
    """Draw a panel for each estimator into a .png or .svg.

    On the diagonal, outcomes came as often as forecast. The bars below, and the area of the dots,
    show how many forecasts lie in each bin.

    Args:
        evaluation: The evaluation; diagrams are of all doors together, figures their mean.
        path: The file; what is there is replaced once the new one is whole.
        name: The log's name.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FormatError: The name ends in neither .png nor .svg.
        OutputError: The file cannot be written; what was there stays.
    """
    save_figure(draw_calibration(evaluation, name=name), path)


def draw_calibration(evaluation: Evaluation, *, name: str) -> Any:
    """Return the figure."""
    found, mean = evaluation.reliability, evaluation.mean
    columns = min(COLUMNS, len(found))
    rows = math.ceil(len(found) / columns)
    figure = new_figure(max(2, columns) * PANEL_IN, rows * ROW_IN + HEAD_IN + FOOT_IN,
                        layout="constrained")  # fmt: skip
    pairs = list(_panels(figure, rows, columns))
    most = max(float(reliability.count.max()) for reliability in found.values())
    for (diagram, bars), (estimator, reliability) in zip(pairs, found.items(), strict=False):
        _draw(diagram, reliability)
        _draw_counts(bars, reliability, most)
        diagram.set_title(printable(estimator), fontsize=9, fontweight="bold", pad=16)
        diagram.annotate(_figures(mean[estimator]), (0.5, 1), (0, 5), fontsize=8, ha="center",
                         xycoords="axes fraction", textcoords="offset points")  # fmt: skip
    for pair in pairs[len(found) :]:
        for panel in pair:
            panel.set_visible(False)
    outcome = "share found open" if evaluation.is_truth else "share next read as open"
    for diagram, bars in pairs[::columns]:
        diagram.set_ylabel(outcome, fontsize=9)
        bars.set_ylabel("forecasts", fontsize=9)
    for _, bars in pairs[max(len(found) - columns, 0) : len(found)]:
        bars.set_xlabel("forecast P(open)", fontsize=9)
        bars.tick_params(labelbottom=True)
    handles, labels = pairs[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, fontsize=8, frameon=False)
    figure.suptitle(_title(evaluation, name), fontsize=10)
    return figure


def _panels(figure: Any, rows: int, columns: int) -> Iterator[tuple[Any, Any]]:
    """Yield a diagram and the bars below it, from left to right, row by row."""
    panels = figure.subplots(2 * rows, columns, sharex=True, sharey="row", squeeze=False,
                             height_ratios=HEIGHTS * rows)  # fmt: skip
    for row in range(rows):
        yield from zip(panels[2 * row], panels[2 * row + 1], strict=True)


def _draw(panel: Any, found: Reliability) -> None:
    rows = found.rows()
    said, came = [row[0] for row in rows], [row[1] for row in rows]
    most = max((row[2] for row in rows), default=1)
    area = [LEAST_AREA + MOST_AREA * row[2] / most for row in rows]
    panel.plot([0, 1], [0, 1], color=PLOT_MARKS, linewidth=1, linestyle="--",
               label="perfect: as forecast, so it came")  # fmt: skip
    panel.plot(said, came, color=PLOT_CURVE, linewidth=1)
    panel.scatter(said, came, s=area, color=PLOT_CURVE, linewidth=0, zorder=3, clip_on=False,
                  label="forecasts of a bin; area: how many")  # fmt: skip
    ticks = np.linspace(0, 1, 6)
    panel.set(xlim=(0, 1), ylim=(0, 1), xticks=ticks, yticks=ticks)
    panel.set_axisbelow(True)
    panel.grid(color=PLOT_BARS, alpha=0.4, linewidth=0.6)
    panel.tick_params(labelsize=7)


def _draw_counts(panel: Any, found: Reliability, most: float) -> None:
    """Draw how many forecasts lie in each bin, on a scale that shows small counts next to large."""
    edges = np.arange(BINS) / BINS
    panel.bar(edges, found.count, 1 / BINS, align="edge", color=PLOT_BARS, edgecolor="white",
              linewidth=0.5)  # fmt: skip
    for edge, count in zip(edges, found.count.tolist(), strict=True):
        if count:
            panel.annotate(_short(int(count)), (edge + 0.5 / BINS, count), (0, 1), fontsize=6,
                           textcoords="offset points", ha="center", color=PLOT_MARKS)  # fmt: skip
    panel.set_yscale("log")
    panel.set(ylim=(0.8, 8 * max(most, 1.0)))
    panel.tick_params(labelsize=7)
    panel.minorticks_off()


def _title(evaluation: Evaluation, name: str) -> str:
    doors = len(evaluation.doors)
    of = "" if doors == 1 else f", {counted(doors, 'door')}"
    called = printable(name).replace("$", r"\$")
    return f"Forecast, and what came: {called}{of}\n{known_text(evaluation)}"


def _figures(scores: Scores) -> str:
    return f"Brier {scores.brier:.4f}, ECE {scores.ece:.3f}, bias {scores.bias:+.3f}"


def _short(count: int) -> str:
    """Return a number of forecasts in a few characters: 912, 1.2k, 12k, 1.2M."""
    if count < 1000:
        return str(count)
    scaled, unit = (count / 1e3, "k") if count < 1e6 else (count / 1e6, "M")
    return f"{scaled:.1f}{unit}" if scaled < 9.95 else f"{scaled:.0f}{unit}"
