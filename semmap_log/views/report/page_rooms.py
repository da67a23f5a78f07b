"""A level's rooms for the page: a picture of tints below the plan's ink, and where names stand."""

from __future__ import annotations

import base64
import io
from typing import Any

import numpy as np
from PIL import Image

from semmap_log.analysis.rooms.level_rooms import RoomPlan
from semmap_log.views.event_words import printable
from semmap_log.views.palette import rooms_image

MOST_CELLS = 1_000_000
"""Of the picture: it lies under finer walls."""


def rooms_of_page(plan: RoomPlan, level: int) -> dict[str, Any] | None:
    """Return the picture as a data URI with its place, and names; None: there are no rooms.

    `matrix` is as that of the floor's picture. A name comes with the side of a square of the
    room's area, metres: how long it may be.
    """
    rooms = plan.levels.get(level)
    if rooms is None or not rooms.rooms:
        return None
    image = rooms_image(rooms, most_cells=MOST_CELLS)
    grid, (height, width, _) = rooms.geometry, image.shape
    wide, tall = grid.width * grid.resolution, grid.height * grid.resolution
    names = [
        [round(room.x, 2), round(room.y, 2), printable(room.name), round(room.area_m2**0.5, 2)]
        for room in plan.graph.rooms.values()
        if room.level == level and room.name
    ]
    return {
        "src": _data_uri(image),
        "width": width,
        "height": height,
        "matrix": [wide / width, 0, 0, tall / height, grid.origin_x, -(grid.origin_y + tall)],
        "names": names,
    }


def _data_uri(image: np.ndarray[Any, np.dtype[np.uint8]]) -> str:
    png = io.BytesIO()
    picture = Image.fromarray(np.ascontiguousarray(np.flipud(image)), "RGBA")
    picture.quantize().save(png, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(png.getvalue()).decode()
