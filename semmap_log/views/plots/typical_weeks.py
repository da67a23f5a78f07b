"""Typical days and weeks of doors as a picture; what nobody has seen is hatched, not coloured."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.beliefs.door_beliefs import By, TypicalWeek, WeekPattern
from semmap_log.analysis.probabilities.evidence.coverage import DAY_NAMES, DAYS, HOURS
from semmap_log.analysis.probabilities.forecast import INTERVAL
from semmap_log.core.folds.door_index import distinct_labels
from semmap_log.core.model.moments import format_short
from semmap_log.core.texts import counted
from semmap_log.views.belief_words import why_unknown
from semmap_log.views.event_words import HasShape, drawable_name, printable
from semmap_log.views.palette import COLOUR_MAP, PLOT_CURVE, PLOT_HATCH, PLOT_NOTHING
from semmap_log.views.plots.figures import has_shape, letters_of, new_figure, save_figure

WIDE_IN = 8.0
"""Of a picture of one door; a column of several is `NARROW_IN` wide."""
NARROW_IN, LOW_IN = 4.0, 2.0
MOST_COLUMNS = 8
IN_A_ROW = 3
"""So few stand side by side."""
BAR_IN = 4.0
"""Length of the bar of colours, at most."""
HEAD_IN, FOOT_IN = 0.75, 0.75
MOST_PANELS = 150
"""As many doors as have lanes on one page of the report; more would take minutes."""
UNSURE = 0.5
"""A cell whose interval is wider than that bears a dot."""
HATCH = "////"
EVERY_HOURS = 3
TITLE_LETTERS = 38


def plot_weeks(weeks: Sequence[TypicalWeek], path: Path, by: By = "week") -> None:
    """Draw a panel for each door into a .png or .svg.

    Args:
        weeks: At least one door's; of more than `MOST_PANELS` the first are drawn.
        path: The file; what is there is replaced once the new one is whole.
        by: Typical hours and weekdays as lines with their interval, weeks as maps of colours.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FormatError: The name ends in neither .png nor .svg.
        OutputError: The file cannot be written; what was there stays.
    """
    save_figure(draw_weeks(weeks, by, letters_of(path)), path)


def draw_weeks(weeks: Sequence[TypicalWeek], by: By, letters: HasShape = has_shape) -> Any:
    """Return the figure; a door whose name has a letter without a shape is shown by its id."""
    in_all, weeks = len(weeks), weeks[:MOST_PANELS]
    columns = len(weeks) if len(weeks) <= IN_A_ROW else math.ceil(math.sqrt(0.75 * len(weeks)))
    columns = min(MOST_COLUMNS, columns)
    rows = math.ceil(len(weeks) / columns)
    width = WIDE_IN if columns == 1 else columns * NARROW_IN
    low = LOW_IN if columns > 1 else 1.5 * LOW_IN
    figure = new_figure(width, rows * low + HEAD_IN + FOOT_IN, layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    draw: Callable[[Any, TypicalWeek], Any] = {
        "week": _draw_week, "hour": _draw_hours, "weekday": _draw_weekdays
    }[by]  # fmt: skip
    shown = None
    labels = distinct_labels((week.door, week.level_name) for week in weeks)
    for panel, week in zip(panels, weeks, strict=False):
        label = labels.get(week.door.door_id, week.door.label)
        panel.set_title(_title(week, label, letters), fontsize="medium", loc="left")
        shown = draw(panel, week) or shown
    for panel in panels[len(weeks) :]:
        panel.set_axis_off()
    if shown is not None:
        shrink = min(0.8, BAR_IN / (rows * low))
        figure.colorbar(shown, ax=panels, label="P(open)", shrink=shrink, aspect=25, pad=0.01,
                        anchor=(0.0, 1.0))  # fmt: skip
    more = f"; {drawn_of(in_all)}" if in_all > len(weeks) else ""
    figure.suptitle(f"{_heading(weeks[0], by)}{more}", fontsize="medium")
    figure.supxlabel(_key(weeks[0], by), fontsize="small")
    return figure


def drawn_of(doors: int) -> str:
    """Return in words how many of so many doors are drawn."""
    first = f"the first {MOST_PANELS} of " if doors > MOST_PANELS else ""
    return f"{first}{counted(doors, 'door')}"


def _draw_week(panel: Any, week: TypicalWeek) -> Any:
    hours = week.hours
    cells = np.ma.masked_array(hours.p_open, ~hours.is_known)
    edges = np.arange(HOURS + 1), np.arange(DAYS + 1)
    _hatch_all(panel)
    mesh = panel.pcolormesh(*edges, cells, cmap=COLOUR_MAP, vmin=0, vmax=1, zorder=2)
    unsure = hours.is_known & (hours.high - hours.low > UNSURE)
    days, at = np.nonzero(unsure)
    panel.plot(at + 0.5, days + 0.5, ".", color="white", markersize=4,
               markeredgecolor="black", markeredgewidth=0.4, zorder=3)  # fmt: skip
    panel.set(xlim=(0, HOURS), ylim=(DAYS, 0))
    panel.set_yticks(np.arange(DAYS) + 0.5, DAY_NAMES, fontsize="small")
    _hours_along(panel)
    panel.tick_params(length=2)
    return mesh


def _draw_hours(panel: Any, week: TypicalWeek) -> None:
    _draw_steps(panel, week.by_hour(), np.arange(HOURS + 1))
    _hours_along(panel)
    _up(panel)


def _draw_weekdays(panel: Any, week: TypicalWeek) -> None:
    _draw_steps(panel, week.by_weekday(), np.arange(DAYS + 1))
    panel.set_xticks(np.arange(DAYS) + 0.5, DAY_NAMES, fontsize="small")
    panel.set_xlim(0, DAYS)
    _up(panel)


def _draw_steps(panel: Any, cells: WeekPattern, edges: NDArray[np.int64]) -> None:
    """Draw a step for each cell, in the band of its interval; hatched where nobody looked."""
    for known, start in zip(cells.is_known, edges[:-1], strict=True):
        if not known:
            panel.axvspan(start, start + 1, facecolor=PLOT_NOTHING, edgecolor=PLOT_HATCH,
                          hatch=HATCH, linewidth=0)  # fmt: skip
    p, low, high = (
        np.where(cells.is_known, c, np.nan) for c in (cells.p_open, cells.low, cells.high)
    )
    panel.stairs(high, edges, baseline=low, fill=True, color=PLOT_CURVE, alpha=0.25)
    panel.stairs(p, edges, baseline=None, color=PLOT_CURVE, linewidth=1.8)


def _hatch_all(panel: Any) -> None:
    panel.axvspan(0, HOURS, facecolor=PLOT_NOTHING, edgecolor=PLOT_HATCH, hatch=HATCH, linewidth=0)


def _hours_along(panel: Any) -> None:
    ticks = np.arange(0, HOURS + 1, EVERY_HOURS)
    panel.set_xticks(ticks, [str(tick) for tick in ticks], fontsize="small")
    panel.set_xlim(0, HOURS)


def _up(panel: Any) -> None:
    panel.set(ylim=(0, 1))
    panel.tick_params(labelsize="small", length=2)
    panel.set_ylabel("P(open)", fontsize="small")


def _title(week: TypicalWeek, label: str, letters: HasShape) -> str:
    """Return the door's label, in lines short enough for its panel."""
    name = drawable_name(label, f"door {week.door.door_id}", letters)
    label = printable(name).replace("$", r"\$")
    said = label if week.is_known else f"{label}: UNKNOWN, {why_unknown(week.evidence)}"
    return textwrap.fill(said, TITLE_LETTERS, break_long_words=True)


def _heading(week: TypicalWeek, by: By) -> str:
    what = {"week": "a typical week", "hour": "a typical day", "weekday": "the days of the week"}
    known = format_short(week.known_ns, week.tz, seconds=False)
    return f"P(open) over {what[by]}\nas known at {known}"


def _key(week: TypicalWeek, by: By) -> str:
    """Return the texts along the axis, and the meaning of the marks."""
    axis = "" if by == "weekday" else f"hour of the day, {week.tz}; "
    share = f"{INTERVAL:.0%} interval"
    said = f"dot: the {share} is wider than {UNSURE:g}" if by == "week" else f"band: {share}"
    return f"{axis}{said}; hatched: never seen then, or too little"
