"""A planned patrol over the floor plans: the stops numbered in their order, coloured by P."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.analysis.planning.patrol_plan import PatrolPlan, PlannedStop
from semmap_log.analysis.rooms.door_ways import Place
from semmap_log.analysis.rooms.level_rooms import OCCUPIED_FROM
from semmap_log.core.model.doors import Door
from semmap_log.core.model.events import FloorMap
from semmap_log.core.model.moments import SECOND_NS, duration, format_short
from semmap_log.core.texts import counted
from semmap_log.views import palette
from semmap_log.views.plots.figures import mpl, new_figure, patches, save_figure
from semmap_log.views.plots.room_plans import plan_cells

LONG_IN, LEAST_IN, MOST_IN = 13.0, 5.0, 13.0
MARGIN_M = 2.0
DARK_BELOW = 0.55
"""Of P: numbers stand white on the darker colours."""


def plot_patrol(
    plan: PatrolPlan, ways: Sequence[Sequence[Place]], floors: Mapping[int, FloorMap],
    doors: Sequence[Door], path: Path,
) -> None:  # fmt: skip
    """Draw a panel for each level that the round comes to into a .png or .svg.

    Args:
        plan: The round.
        ways: The corners of the ways from stop to stop.
        floors: Level -> its plan; a level without one is drawn by its doors alone.
        doors: All that have a place, in the background.
        path: The file; what is there is replaced once the new one is whole.

    Raises:
        MissingExtraError: matplotlib is not installed.
        FormatError: The name ends in neither .png nor .svg.
        OutputError: The file cannot be written; what was there stays.
    """
    levels = _levels(plan)
    wide, tall = _size_in(levels, floors, doors)
    figure = new_figure(wide, tall * len(levels) + 1.0, layout="constrained")
    panels = np.atleast_1d(figure.subplots(len(levels), 1))
    for level, panel in zip(levels, panels, strict=True):
        _draw_floor(panel, floors.get(level))
        for door in doors:
            if door.is_placed and door.level == level:
                (x0, y0), (x1, y1) = door.start, door.end
                panel.plot([x0, x1], [y0, y1], color=palette.PLOT_BARS, linewidth=1.5, zorder=2)
        _draw_ways(panel, plan, ways, level)
        for number, stop in enumerate(plan.stops, start=1):
            if stop.place.level == level:
                _draw_stop(panel, number, stop)
        _frame(panel, level, floors.get(level), many=len(levels) > 1)
    _draw_key(figure, panels, with_start=plan.start is not None)
    figure.suptitle(_title(plan))
    save_figure(figure, path)


def _levels(plan: PatrolPlan) -> list[int]:
    start = [] if plan.start is None else [plan.start.level]
    return sorted({*start, *(stop.place.level for stop in plan.stops)})


def _size_in(
    levels: Sequence[int], floors: Mapping[int, FloorMap], doors: Sequence[Door]
) -> tuple[float, float]:
    spans = [_span(floors.get(level), level, doors) for level in levels]
    share = max((y / max(x, 1e-6) for x, y in spans), default=1.0)
    return LONG_IN, float(np.clip(LONG_IN * share, LEAST_IN, MOST_IN))


def _span(floor: FloorMap | None, level: int, doors: Sequence[Door]) -> tuple[float, float]:
    if floor is not None:
        x0, x1, y0, y1 = _walled(floor)
        return x1 - x0, y1 - y0
    points = np.array([door.start for door in doors if door.is_placed and door.level == level])
    x, y = np.ptp(points, axis=0) + 2 * MARGIN_M
    return float(x), float(y)


def _walled(floor: FloorMap) -> tuple[float, float, float, float]:
    """Return the bounds of the walls, with a margin: x0, x1, y0, y1, metres."""
    grid = GridGeometry.of_floor(floor)
    walls = floor.cells >= OCCUPIED_FROM
    rows, columns = np.flatnonzero(walls.any(axis=1)), np.flatnonzero(walls.any(axis=0))
    if not len(rows):
        rows, columns = np.array([0, grid.height - 1]), np.array([0, grid.width - 1])
    x0, y0 = grid.map_to_world(int(columns.min()), int(rows.min()))
    x1, y1 = grid.map_to_world(int(columns.max()), int(rows.max()))
    return x0 - MARGIN_M, x1 + MARGIN_M, y0 - MARGIN_M, y1 + MARGIN_M


def _draw_floor(panel: Any, floor: FloorMap | None) -> None:
    if floor is None:
        return
    cells, extent = plan_cells(floor)
    shades = mpl.colors.ListedColormap(["white", palette.PLOT_NOTHING, palette.PLOT_WALLS])
    kinds = np.where(cells >= OCCUPIED_FROM, 2, np.where(cells < 0, 1, 0))
    panel.imshow(kinds, cmap=shades, vmin=0, vmax=2, origin="lower", extent=extent,
                 interpolation="nearest", zorder=0)  # fmt: skip


def _draw_ways(
    panel: Any, plan: PatrolPlan, ways: Sequence[Sequence[Place]], level: int
) -> None:  # fmt: skip
    for way in ways:
        for here, there in pairwise(way):
            if here.level == there.level == level:
                panel.plot([here.x, there.x], [here.y, there.y], color=palette.PLOT_PROPOSED,
                           linewidth=1.0, alpha=0.6, zorder=3)  # fmt: skip
    if plan.start is not None and plan.start.level == level:
        panel.plot(
            plan.start.x, plan.start.y, "*", color=palette.PLOT_PROPOSED, markersize=18, zorder=5
        )


def _draw_stop(panel: Any, number: int, stop: PlannedStop) -> None:
    (x0, y0), (x1, y1) = stop.door.start, stop.door.end
    colour = _colour(stop)
    panel.plot([x0, x1], [y0, y1], color=colour, linewidth=4, solid_capstyle="butt", zorder=4)
    words = "white" if stop.is_known and stop.p_passes < DARK_BELOW else "black"
    panel.text(
        stop.place.x, stop.place.y, str(number), color=words, ha="center", va="center",
        fontsize=8, fontweight="bold", zorder=6,
        bbox={"boxstyle": "round,pad=0.2", "fc": colour, "ec": palette.PLOT_WALLS, "lw": 0.5},
    )  # fmt: skip


def _colour(stop: PlannedStop) -> Any:
    """Return the colour of P, or that of an unknown door."""
    return _scale()(stop.p_passes) if stop.is_known else palette.PLOT_NOTHING


def _scale() -> Any:
    colours = np.array(palette.VIRIDIS) / 255
    return mpl.colors.LinearSegmentedColormap.from_list("P", colours)


def _frame(panel: Any, level: int, floor: FloorMap | None, *, many: bool) -> None:
    if floor is not None:
        x0, x1, y0, y1 = _walled(floor)
        panel.set_xlim(x0, x1)
        panel.set_ylim(y0, y1)
        panel.set_aspect("equal")
    else:
        panel.set_aspect("equal", adjustable="datalim")
    panel.set_xlabel(f"x, metres (level {level})" if many else "x, metres")
    panel.set_ylabel("y, metres")


def _draw_key(figure: Any, panels: Any, *, with_start: bool) -> None:
    """Draw what the colours mean."""
    scale = mpl.cm.ScalarMappable(mpl.colors.Normalize(0, 1), _scale())
    figure.colorbar(scale, ax=list(panels), shrink=0.6, label="P that the door lets one in, then")
    unknown = patches.Patch(
        facecolor=palette.PLOT_NOTHING, edgecolor=palette.PLOT_WALLS, label="UNKNOWN"
    )
    if with_start:
        panels[0].plot([], [], "*", color=palette.PLOT_PROPOSED, markersize=12, label="start")
    handles, labels = panels[0].get_legend_handles_labels()
    panels[0].legend([*handles, unknown], [*labels, "UNKNOWN"], loc="upper right", fontsize=8,
                     labelcolor=palette.PLOT_WORDS)  # fmt: skip


def _title(plan: PatrolPlan) -> str:
    when = format_short(plan.start_ns, plan.tz, seconds=False)
    if not plan.stops:
        return f"patrol from {when} ({plan.tz}): no stops"
    mean = duration(round(plan.mean_visit_s) * SECOND_NS)
    stops = counted(len(plan.stops), "stop")
    return f"patrol from {when} ({plan.tz}): {stops}, mean time to visit {mean}"
