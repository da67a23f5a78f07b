"""Figures E.1 to E.4: how long it took to reach a goal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from navigation.page.drawing import BAR, RED, axes, styled
from navigation.tables.figures import RunFigures
from navigation.tables.grouped import title_of
from navigation.tables.table import runs_said

BINS = 50


def histogram(setup: str, runs: Sequence[RunFigures]) -> Any | None:
    """Return the histogram of a setup's times, as the thesis draws it; None: no goal was reached.

    50 bins, and a dashed red line: the normal distribution of the same mean and deviation.
    """
    took_s = np.array([seconds for run in runs for seconds in run.took_s])
    if not len(took_s):
        return None
    with styled():
        figure, ax = axes(4.2, 2.5)
        _, edges, _ = ax.hist(took_s, BINS, color=BAR)
        at, heights = normal_curve(took_s, edges)
        ax.plot(at, heights, "--", color=RED, linewidth=1.5)
        ax.set_xlim(edges[0], edges[-1])
        ax.set_title(f"{title_of(setup)}: {len(took_s):,} goals, {runs_said(len(runs))}")
        ax.set_xlabel("seconds to reach a goal")
        ax.set_ylabel("goals")
    return figure


def normal_curve(values: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where, and how many values a bin would hold if they were normally distributed."""
    at = np.linspace(edges[0], edges[-1], 200)
    mean, spread = values.mean(), values.std()
    if not spread:
        return at[:0], at[:0]
    density = np.exp(-0.5 * ((at - mean) / spread) ** 2) / (spread * np.sqrt(2 * np.pi))
    return at, density * len(values) * (edges[1] - edges[0])
