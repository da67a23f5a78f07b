"""Rooms into a rerun recording: tints over the floor, under the walls' grey, and their names."""

from __future__ import annotations

import numpy as np

from semmap_log.rooms import RoomPlan
from semmap_log.views.palette import Palette
from semmap_log.views.rerun.drawable import drawable_name
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.rows import RowWriter
from semmap_log.views.rerun.scene import Scene, SceneLevel
from semmap_log.views.room_tints import rooms_image

ROOMS, ROOM_NAMES = "rooms", "room_names"
"""Last parts of the entities' paths: either can be hidden in the viewer."""
ALPHA = 45
"""Of 255: how much of the dark floor a tint covers."""
MOST_CELLS = 1_000_000


def write_rooms(writer: RowWriter, scene: Scene, plan: RoomPlan, palette: Palette) -> None:
    """Write the rooms of each level that has some, as they are at the scene's end."""
    for level in scene.levels.values():
        rooms = plan.levels.get(level.level)
        if rooms is not None and rooms.rooms:
            _write_level(writer, level, plan, palette)


def _write_level(writer: RowWriter, level: SceneLevel, plan: RoomPlan, palette: Palette) -> None:
    rooms = plan.levels[level.level]
    grid = rooms.geometry
    image = rooms_image(rooms, alpha=ALPHA, most_cells=MOST_CELLS)
    height, width, _ = image.shape
    scale = np.diag([
        grid.width * grid.resolution / width, grid.height * grid.resolution / height, 1.0
    ])  # fmt: skip
    writer.static(
        (*level.path, ROOMS),
        rr.Image(image, draw_order=-19.0),
        rr.Transform3D(translation=[grid.origin_x, grid.origin_y, 0.0], mat3x3=scale),
    )
    named = [
        (room.x, room.y, drawable_name(room.name, f"room {room.room_id}"))
        for room in plan.graph.rooms.values()
        if room.level == level.level and room.name
    ]
    if named:
        writer.static(
            (*level.path, ROOM_NAMES),
            rr.Points2D(
                [(x, y) for x, y, _ in named],
                labels=[name for _, _, name in named],
                colors=[palette.plain_text] * len(named),
                radii=0.05,
                draw_order=-18.0,
            ),
        )
