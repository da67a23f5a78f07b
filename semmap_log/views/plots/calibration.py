"""Reliability diagrams: what came where so much was said, and how often that was said."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from semmap_log.probabilities.scores import BINS, Reliability, Scores
from semmap_log.views.event_words import printable
from semmap_log.views.plots.sdk import new_figure, save_figure

PANEL_IN = 2.6
COLUMNS = 4
INK, GREY = "#31688e", "#c8c8d0"
MOST_AREA = 160.0
"""Points squared: the dot of the fullest bin."""


def plot_calibration(
    reliability: Mapping[str, Reliability], mean: Mapping[str, Scores], path: Path, *, title: str
) -> None:
    """Draw a panel for each estimator into a .png or .svg.

    On the diagonal as much came as was said. A dot's area is the share of the forecasts in its
    bin; the bars below show the same.

    Args:
        reliability: Estimator -> diagram, all doors together.
        mean: Estimator -> its figures, mean over doors.
        path: The file; what is there is replaced once the new one is whole.
        title: What was evaluated, one line.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FormatError: The name ends in neither .png nor .svg.
        OutputError: The file cannot be written; what was there stays.
    """
    columns = min(COLUMNS, len(reliability))
    rows = math.ceil(len(reliability) / columns)
    size = max(2, columns) * PANEL_IN, rows * PANEL_IN * 1.15 + 0.6
    figure = new_figure(*size, layout="constrained")
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for panel, (name, found) in zip(panels.ravel(), reliability.items(), strict=False):
        _draw(panel, found)
        panel.set_title(f"{printable(name)}\n{_figures(mean[name])}", fontsize=8)
    for panel in panels.ravel()[len(reliability) :]:
        panel.set_visible(False)
    figure.suptitle(printable(title), fontsize=9)
    figure.supxlabel("said: P(open)", fontsize=9)
    figure.supylabel("came: share open", fontsize=9)
    save_figure(figure, path)


def _draw(panel: Any, found: Reliability) -> None:
    share = found.count / max(found.count.sum(), 1)
    edges = np.arange(BINS) / BINS
    panel.bar(edges, 0.3 * share, 1 / BINS, align="edge", color=GREY, linewidth=0)
    panel.plot([0, 1], [0, 1], color=GREY, linewidth=1, zorder=1)
    rows = found.rows()
    said, came = [row[0] for row in rows], [row[1] for row in rows]
    area = [6 + MOST_AREA * row[2] / max(row[2] for row in rows) for row in rows]
    panel.plot(said, came, color=INK, linewidth=1, zorder=2)
    panel.scatter(said, came, s=area, color=INK, alpha=0.75, linewidth=0, zorder=3)
    for (p, frequency, count), size in zip(rows, area, strict=True):
        panel.annotate(
            _short(count), (p, frequency), (0, 2 + size**0.5 / 2), textcoords="offset points",
            fontsize=5, ha="center", color="#555560",
        )  # fmt: skip
    panel.set(xlim=(0, 1), ylim=(0, 1.05), aspect="equal")
    panel.tick_params(labelsize=7)


def _figures(scores: Scores) -> str:
    return f"Brier {scores.brier:.4f}, ECE {scores.ece:.3f}, bias {scores.bias:+.3f}"


def _short(count: int) -> str:
    """Return a number of forecasts in a few characters: 912, 12k, 1.2M."""
    if count < 1000:
        return str(count)
    return f"{count / 1e3:.0f}k" if count < 1e6 else f"{count / 1e6:.1f}M"
