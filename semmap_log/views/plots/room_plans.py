"""The rooms of floor plans as a picture: tinted, named, with the doors between them."""

from __future__ import annotations

from typing import Any

from semmap_log.analysis.rooms import Room, RoomPlan
from semmap_log.analysis.rooms.level_rooms import OCCUPIED_FROM, LevelRooms
from semmap_log.core.model.doors import Door
from semmap_log.core.model.events import FloorMap
from semmap_log.views.drawable_names import HasShape, drawable_name
from semmap_log.views.event_words import printable
from semmap_log.views.palette import (
    PLOT_CURVE,
    PLOT_LIFT,
    PLOT_PROPOSED,
    PLOT_ROOM_NAME,
    PLOT_WALLS,
)
from semmap_log.views.plots.matplotlib_sdk import has_shape, new_figure
from semmap_log.views.plots.plan_cells import plan_cells
from semmap_log.views.room_tints import rooms_image

WIDE_IN, LEAST_IN, MOST_IN = 14.0, 3.0, 14.0
NAME_PT, LEAST_PT = 7.0, 4.0
LETTER_EM = 0.6
"""About how wide a letter is."""
POINTS_AN_INCH = 72
KINDS = (
    (PLOT_CURVE, "joins two rooms"),
    (PLOT_PROPOSED, "the same room on both sides, or none"),
    (PLOT_LIFT, "of a lift"),
)


def draw_rooms(
    plan: RoomPlan, *, level: int | None = None, title: str, letters: HasShape = has_shape
) -> Any:
    """Return the figure: a panel for each level with a floor plan, the lowest number on top.

    Args:
        plan: Of a moment.
        level: Only that level; None: all.
        title: Above all.
        letters: Tells whether a letter has a shape; a room with another is called by its number.
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
    panel.imshow(rooms_image(rooms), origin="lower", extent=extent, interpolation="nearest")
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
        panel.contourf(walls, levels=[0.5, 1.5], colors=[PLOT_WALLS], origin="lower", extent=extent)


def _draw_door(panel: Any, plan: RoomPlan, door: Door) -> None:
    doorway = plan.graph.doorways[door.door_id]
    colour = PLOT_CURVE if doorway.joins_two else PLOT_PROPOSED
    if plan.graph.lift_of(door.door_id) is not None:
        colour = PLOT_LIFT
    panel.plot(*zip(door.start, door.end, strict=True), color=colour, linewidth=3,
               solid_capstyle="butt", scalex=False, scaley=False)  # fmt: skip


def _draw_name(panel: Any, room: Room, letters: HasShape, points_a_metre: float) -> None:
    """Write a room's name as large as it fits, about; else its number."""
    name = printable(drawable_name(room.name or "", "", letters))
    side_pt = room.area_m2**0.5 * points_a_metre
    size = min(NAME_PT, side_pt / (LETTER_EM * max(len(name), 1)))
    said, size = (name, size) if name and size >= LEAST_PT else (str(room.room_id), NAME_PT)
    panel.text(room.x, room.y, said.replace("$", r"\$"), fontsize=size, ha="center", va="center",
               color=PLOT_ROOM_NAME, clip_on=True)  # fmt: skip


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
