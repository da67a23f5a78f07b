"""The shares of setups as bars, beside the thesis's, and how they change with an option."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from navigation.page.drawing import BAR, INK, MARK, axes, styled
from navigation.tables.figures import RunFigures
from navigation.tables.grouped import GroupedRuns, by_value, title_of, value_said
from navigation.tables.measures import RunsOf, percent_of
from navigation.tables.statistics import Interval
from navigation.tables.thesis import THESIS

COLOURS = ("#4f83cc", "#d98324", "#d43d3d", "#3f9c6d", "#9467bd", "#8c6d5a", "#c45f9e", "#7f7f7f")
MARKERS = "os^Dv<>P"
TICKS = (0.0, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
"""Of an axis on which a tenth of a percent can be seen beside sixty."""


def share_chart(of: RunsOf, series: str) -> Any:
    """Return bars: % of goals tried that were unreachable after driving, with intervals."""
    shares = {setup: percent_of(runs) for setup, runs in of.items()}
    thesis = {name: row.percent for name, row in THESIS.get(series, {}).items() if name in of}
    most = max([*(s.value + _known(s.half) for s in shares.values()), *thesis.values()])
    with styled():
        figure, ax = axes(4.4, 0.75 + 0.3 * len(of))
        labels = []
        for row, (setup, share) in enumerate(shares.items()):
            half = _known(share.half)
            ax.barh(row, share.value, 0.6, xerr=half, color=BAR, ecolor=INK, capsize=2,
                    label="" if row else "here")  # fmt: skip
            beside = f"±{half:.2f}" if share.value else f"(at most {half:.2f})"
            labels.append(f"{title_of(setup)} {share.value:.2f} {beside}")
        rows = [list(of).index(name) for name in thesis]
        if rows:
            ax.plot(thesis.values(), rows, "D", color=MARK, markersize=5, label="thesis")
            ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2)
        ax.set_yticks(range(len(of)), labels)
        ax.invert_yaxis()
        ax.set_xlim(0, most * 1.05 or 1)
        ax.set_xlabel("% of goals tried, unreachable after driving")
    return figure


def sweep_chart(runs: GroupedRuns, building: str, series: str, option: str) -> Any | None:
    """Return how the shares change with an option; None: nothing to draw.

    Args:
        runs: All runs.
        building: Of which building.
        series: Of which series.
        option: Which was swept.
    """
    values = sorted(runs.swept[building][option], key=by_value)
    with styled():
        figure, ax = axes(4.2, 2.8)
        drawn, most = 0, 0.0
        for place, setup in enumerate(runs.setups(building, series)):
            found = [runs.of(building, series, setup, but=(option, value)) for value in values]
            points = _shared_points(found) if series == "fixed" else _points(found)
            if len(points) < 2:
                continue
            drawn += 1
            most = max(most, *(share.value + _known(share.half) for _, share in points))
            shift = (drawn % 3 - 1) * 0.06
            ax.errorbar(
                [at + shift for at, _ in points], [share.value for _, share in points],
                [_known(share.half) for _, share in points], capsize=2, linewidth=1.3,
                marker=MARKERS[place % len(MARKERS)], markersize=4.5,
                color=COLOURS[place % len(COLOURS)], label=title_of(setup),
            )  # fmt: skip
        if not drawn:
            return None
        ax.set_xticks(range(len(values)), [value_said(value) for value in values])
        ax.set_yscale("symlog", linthresh=TICKS[1])
        ax.set_yticks(TICKS, [f"{tick:g}" for tick in TICKS])
        ax.set_ylim(0, next(tick for tick in TICKS if tick >= min(most, TICKS[-1])))
        ax.set_xlabel(option)
        ax.set_ylabel("% unreachable after driving")
        ax.legend(ncols=2, loc="upper left", bbox_to_anchor=(0, -0.22))
    return figure


def _points(found: Sequence[Sequence[RunFigures]]) -> list[tuple[int, Interval]]:
    """Return the place of each value of which there are runs, and their share."""
    return [(place, percent_of(runs)) for place, runs in enumerate(found) if runs]


def _shared_points(found: Sequence[Sequence[RunFigures]]) -> list[tuple[int, Interval]]:
    """Return the same of the seeds that all values have of which there are runs."""
    seeds = [{run.key.seed for run in runs} for runs in found if runs]
    shared = set.intersection(*seeds) if seeds else set()
    return _points([[run for run in runs if run.key.seed in shared] for runs in found])


def _known(half: float) -> float:
    return 0.0 if math.isnan(half) else half
