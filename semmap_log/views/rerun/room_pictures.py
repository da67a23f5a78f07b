"""Rooms into a rerun recording: tints over the floor, under the walls' grey, and their names."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from semmap_log.analysis.rooms import RoomPlan
from semmap_log.views.excerpt.floor_plans import doors_at_ends
from semmap_log.views.excerpt.span import Excerpt
from semmap_log.views.palette import Palette
from semmap_log.views.rerun.drawable import drawable_name
from semmap_log.views.rerun.floor import eras_along, since_of
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.rows import RowWriter
from semmap_log.views.rerun.scene import Scene, SceneLevel
from semmap_log.views.room_tints import rooms_image
from semmap_log.views.rooms_shown import rooms_shown

ROOMS, ROOM_NAMES = "rooms", "room_names"
"""Last parts of the entities' paths: either can be hidden in the viewer."""
ALPHA = 45
"""Of 255: how much of the dark floor a tint covers."""
MOST_CELLS = 1_000_000


def write_rooms(writer: RowWriter, scene: Scene, excerpt: Excerpt, palette: Palette) -> None:
    """Write the rooms of each level that has some: of each plan as they are at its end."""
    last = rooms_shown(excerpt.log, excerpt.log.replay(at=excerpt.last_ns()))
    for level in scene.levels.values():
        if level.plans.is_one:
            image, names = _pictures(last, level.level, palette)
            for part, shown in ((ROOMS, image), (ROOM_NAMES, names)):
                if shown is not None:
                    writer.static((*level.path, part), *shown)
        else:
            _write_eras(writer, scene, level, excerpt, palette)


def _write_eras(
    writer: RowWriter, scene: Scene, level: SceneLevel, excerpt: Excerpt, palette: Palette
) -> None:
    rooms = {
        era.plan_event: _pictures(rooms_shown(excerpt.log, doors), level.level, palette)
        for era, doors in doors_at_ends(level.plans.happened, excerpt)
    }
    for timelines, eras in eras_along(level):
        for row, era in zip(since_of(eras, scene), eras, strict=True):
            shown = rooms.get(era.plan_event, (None, None))
            for part, pictures in zip((ROOMS, ROOM_NAMES), shown, strict=True):
                if pictures is None:
                    writer.clear((*level.path, part), row, timelines, returns=row[:0])
                else:
                    writer.one((*level.path, part), row, pictures, timelines)


Pictures = Sequence[Any]
"""Archetypes of one entity."""


def _pictures(
    plan: RoomPlan, level: int, palette: Palette
) -> tuple[Pictures | None, Pictures | None]:
    """Return the tints of a level's rooms, and their names; None: there are none."""
    rooms = plan.levels.get(level)
    if rooms is None or not rooms.rooms:
        return None, None
    grid = rooms.geometry
    image = rooms_image(rooms, alpha=ALPHA, most_cells=MOST_CELLS)
    height, width, _ = image.shape
    scale = np.diag([
        grid.width * grid.resolution / width, grid.height * grid.resolution / height, 1.0
    ])  # fmt: skip
    tints = (
        rr.Image(image, draw_order=-19.0),
        rr.Transform3D(translation=[grid.origin_x, grid.origin_y, 0.0], mat3x3=scale),
    )
    named = [
        (room.x, room.y, drawable_name(room.name, f"room {room.room_id}"))
        for room in plan.graph.rooms.values()
        if room.level == level and room.name
    ]
    if not named:
        return tints, None
    points = rr.Points2D(
        [(x, y) for x, y, _ in named],
        labels=[name for _, _, name in named],
        colors=[palette.plain_text] * len(named),
        radii=0.05,
        draw_order=-18.0,
    )
    return tints, (points,)
