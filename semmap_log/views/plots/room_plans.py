"""The rooms of floor plans as a picture: tinted, named, with the doors between them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.rooms.level_rooms import OCCUPIED_FROM, LevelRooms, RoomPlan
from semmap_log.analysis.rooms.room_graph import Room
from semmap_log.core.model.doors import Door
from semmap_log.core.model.events import FloorMap
from semmap_log.views import palette
from semmap_log.views.event_words import HasShape, drawable_name, printable
from semmap_log.views.plots.figures import has_shape, new_figure

MOST_CELLS = 4_000_000
"""A picture has fewer; more would only take memory."""


def plan_cells(
    floor: FloorMap, *, most_cells: int = MOST_CELLS
) -> tuple[NDArray[np.int8], tuple[float, float, float, float]]:
    """Return cells, the lowest y first, and what they cover: x0, x1, y0, y1, metres.

    Of a larger plan each cell stands for a block, and shows its most occupied one, so that no wall
    is lost.

    Args:
        floor: The plan.
        most_cells: How many a picture may have, about.
    """
    height, width = floor.cells.shape
    stride = max(1, math.ceil(math.sqrt(height * width / most_cells)))
    cells = floor.cells
    if stride > 1:
        rows, columns = np.arange(0, height, stride), np.arange(0, width, stride)
        cells = np.maximum.reduceat(np.maximum.reduceat(cells, rows, axis=0), columns, axis=1)
    side_m = floor.resolution * stride
    return cells, (
        floor.origin_x, floor.origin_x + cells.shape[1] * side_m,
        floor.origin_y, floor.origin_y + cells.shape[0] * side_m,
    )  # fmt: skip


WIDE_IN, LEAST_IN, MOST_IN = 14.0, 3.0, 14.0
NAME_PT, LEAST_PT = 7.0, 4.0
LETTER_EM = 0.6
"""About how wide a letter is."""
POINTS_AN_INCH = 72
KINDS = (
    (palette.PLOT_CURVE, "joins two rooms"),
    (palette.PLOT_PROPOSED, "the same room on both sides, or none"),
    (palette.PLOT_LIFT, "of a lift"),
)


def draw_rooms(
    plan: RoomPlan, *, level: int | None = None, title: str, letters: HasShape = has_shape
) -> Any:
    """Return the figure: a panel for each level with a floor plan, the lowest number on top.

    Args:
        plan: Of a moment.
        level: Only that level; None: all.
        title: Above all.
        letters: Returns whether a letter has a shape; a room whose name has one without a shape is
            labelled with its number.
    """
    levels = [each for each in plan.levels if level in (None, each)]
    spans = [_span(plan.levels[each]) for each in levels]
    heights = [
        min(max(WIDE_IN * tall / max(wide, tall * 1e-3, 1e-9), LEAST_IN), MOST_IN)
        for wide, tall in spans
    ]
    figure = new_figure(WIDE_IN + 1.0, sum(heights) + 0.9, layout="constrained")
    panels = figure.subplots(len(levels), 1, squeeze=False, height_ratios=heights)[:, 0]
    for number, each, panel in zip(range(len(levels)), levels, panels, strict=True):
        _draw_level(panel, plan, each, letters)
        panel.set_title(plan.door_map.level_name(each), loc="left", fontsize="medium")
        if not number:
            _draw_legend(panel)
    figure.suptitle(title)
    return figure


def _draw_level(panel: Any, plan: RoomPlan, level: int, letters: HasShape) -> None:
    rooms, floor = plan.levels[level], plan.floors[level]
    extent = _extent(rooms)
    panel.imshow(palette.rooms_image(rooms), origin="lower", extent=extent, interpolation="nearest")
    _draw_walls(panel, floor)
    for doorway in plan.graph.doorways.values():
        if doorway.level == level:
            _draw_door(panel, plan, plan.door_map[doorway.door_id])
    left, right, low, high = extent
    panel.set(xlim=(left, right), ylim=(low, high), xlabel="x, metres", ylabel="y, metres")
    panel.set_aspect("equal")
    points_a_metre = WIDE_IN * POINTS_AN_INCH / max(right - left, 1e-6)
    for room in plan.graph.rooms.values():
        if room.level == level:
            _draw_name(panel, room, letters, points_a_metre)


def _draw_walls(panel: Any, floor: FloorMap) -> None:
    cells, extent = plan_cells(floor)
    walls = cells >= OCCUPIED_FROM
    if walls.any():
        panel.contourf(
            walls, levels=[0.5, 1.5], colors=[palette.PLOT_WALLS], origin="lower", extent=extent
        )


def _draw_door(panel: Any, plan: RoomPlan, door: Door) -> None:
    doorway = plan.graph.doorways[door.door_id]
    colour = palette.PLOT_CURVE if doorway.joins_two else palette.PLOT_PROPOSED
    if plan.graph.lift_of(door.door_id) is not None:
        colour = palette.PLOT_LIFT
    panel.plot(*zip(door.start, door.end, strict=True), color=colour, linewidth=3,
               solid_capstyle="butt", scalex=False, scaley=False)  # fmt: skip


def _draw_name(panel: Any, room: Room, letters: HasShape, points_a_metre: float) -> None:
    """Write a room's name about as large as fits; else its number."""
    name = printable(drawable_name(room.name or "", "", letters))
    side_pt = room.area_m2**0.5 * points_a_metre
    size = min(NAME_PT, side_pt / (LETTER_EM * max(len(name), 1)))
    said, size = (name, size) if name and size >= LEAST_PT else (str(room.room_id), NAME_PT)
    panel.text(room.x, room.y, said.replace("$", r"\$"), fontsize=size, ha="center", va="center",
               color=palette.PLOT_ROOM_NAME, clip_on=True)  # fmt: skip


def _draw_legend(panel: Any) -> None:
    for colour, words in KINDS:
        panel.plot([], [], color=colour, linewidth=3, label=words)
    panel.legend(loc="lower right", fontsize="small", ncols=len(KINDS), borderaxespad=0,
                 bbox_to_anchor=(1.0, 1.01), frameon=False)  # fmt: skip


def _extent(rooms: LevelRooms) -> tuple[float, float, float, float]:
    grid = rooms.geometry
    wide, tall = grid.width * grid.resolution, grid.height * grid.resolution
    return grid.origin_x, grid.origin_x + wide, grid.origin_y, grid.origin_y + tall


def _span(rooms: LevelRooms) -> tuple[float, float]:
    left, right, low, high = _extent(rooms)
    return right - left, high - low
