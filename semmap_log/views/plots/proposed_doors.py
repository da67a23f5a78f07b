"""Proposed doors over walls and what the laser saw, numbered as in their table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import cos, sin
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.proposing.proposals import Proposal
from semmap_log.core.model.doors import Door
from semmap_log.views.palette import PLOT_BARS, PLOT_CURVE, PLOT_PROPOSED, PLOT_WALLS
from semmap_log.views.plots.figures import new_figure, save_figure

Floats = NDArray[np.float64]

LONG_IN, LEAST_IN, MOST_IN = 11.0, 4.0, 11.0
MOST_POINTS = 60_000
"""Of where beams ended."""
AROUND_EDGE_M = 1.0
"""Margin around the building; what few stray beams met beyond it is not shown."""
STRAY = 0.5
"""Per cent of where beams ended, on each side."""
LABEL_M = 0.5
"""From a door's middle to its number."""


def plot_proposed(
    proposals: Sequence[Proposal], doors: Sequence[Door], path: Path, *,
    walls: Mapping[int, Floats], ends: Mapping[int, Floats], title: str,
) -> None:  # fmt: skip
    """Draw a panel for each level into a .png or .svg.

    Args:
        proposals: Numbered from 1, in this order.
        doors: Doors that the log has already.
        path: The file; what is there is replaced once the new one is whole.
        walls: Level -> (n, 2) m, of floor plans.
        ends: Level -> (n, 2) m, where beams ended.
        title: Above all.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FormatError: The name ends in neither .png nor .svg.
        OutputError: The file cannot be written; what was there stays.
    """
    levels = sorted(ends)
    shown = {
        level: extent_of(
            ends[level],
            walls.get(level),
            [each.middle for each in proposals if each.level == level],
        )
        for level in levels
    }
    span = np.max([np.ptp(corners, axis=0) for corners in shown.values()], axis=0)
    tall = float(np.clip(LONG_IN * span[1] / max(span[0], 1e-6), LEAST_IN, MOST_IN))
    figure = new_figure(LONG_IN, tall * len(levels) + 0.8, layout="constrained")
    panels = np.atleast_1d(figure.subplots(len(levels), 1))
    for level, panel in zip(levels, panels, strict=True):
        _draw_points(panel, ends[level], walls.get(level))
        for door in doors:
            if door.is_placed and door.level == level:
                _draw_line(panel, (door.x, door.y, door.theta, door.width), PLOT_CURVE)
        for number, each in enumerate(proposals, start=1):
            if each.level == level:
                _draw_line(
                    panel, (each.x, each.y, each.theta, each.width), PLOT_PROPOSED, str(number)
                )
        panel.set_aspect("equal")
        panel.set(xlim=shown[level][:, 0], ylim=shown[level][:, 1])
        panel.set_xlabel("x, metres" if len(levels) == 1 else f"x, metres (level {level})")
        panel.set_ylabel("y, metres")
        _draw_legend(panel)
    figure.suptitle(title)
    save_figure(figure, path)


def extent_of(ends: Floats, walls: Floats | None, doors: Sequence[tuple[float, float]]) -> Floats:
    """Return two corners of what is shown of a level: (2, 2) m, the lower left one first.

    Args:
        ends: (n, 2) m, where beams ended; a few far away are not shown.
        walls: (n, 2) m, of its floor plan; None: it has none.
        doors: Middles, m, of those that are proposed: all of them are shown.
    """
    inner = np.percentile(ends, [STRAY, 100 - STRAY], axis=0)
    middles = np.array(doors).reshape(-1, 2)
    corners = np.concatenate([inner, middles, inner[:0] if walls is None else walls])
    return np.stack([corners.min(axis=0) - AROUND_EDGE_M, corners.max(axis=0) + AROUND_EDGE_M])


def _draw_points(panel: Any, ends: Floats, walls: Floats | None) -> None:
    step = -(-len(ends) // MOST_POINTS)
    some = ends[:: max(step, 1)]
    colour = PLOT_WALLS if walls is None else PLOT_BARS
    panel.plot(some[:, 0], some[:, 1], ",", color=colour, alpha=0.5, rasterized=True)
    if walls is not None:
        panel.plot(walls[:, 0], walls[:, 1], "s", color=PLOT_WALLS, markersize=1.2, rasterized=True)


def _draw_line(
    panel: Any, line: tuple[float, float, float, float], colour: str, number: str = ""
) -> None:
    x, y, theta, width = line
    c, s = cos(theta), sin(theta)
    panel.plot([x, x + width * c], [y, y + width * s], color=colour, linewidth=4,
               solid_capstyle="butt")  # fmt: skip
    if number:
        at = (x + width / 2 * c - LABEL_M * s, y + width / 2 * s + LABEL_M * c)
        panel.text(*at, number, color=colour, ha="center", va="center", fontweight="bold",
                   fontsize=9, bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": colour,
                                     "lw": 0.6})  # fmt: skip


def _draw_legend(panel: Any) -> None:
    for colour, words in ((PLOT_PROPOSED, "proposed"), (PLOT_CURVE, "in the log")):
        panel.plot([], [], color=colour, linewidth=4, label=words)
    panel.legend(loc="upper right", fontsize=8)
