"""Floor plans into a rerun recording: dark pictures under the doors, in metres."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from semmap_log.domain.events import FloorMap
from semmap_log.views.palette import Palette
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.rows import RowWriter
from semmap_log.views.rerun.scene import Scene, SceneLevel


def write_floors(writer: RowWriter, scene: Scene, palette: Palette) -> None:
    """Write each level's plan and the mirror that turns our y up into the view's y down."""
    for level in scene.levels.values():
        writer.static(level.path, rr.Transform3D(scale=[1.0, -1.0, 1.0]))
        if level.floor is not None:
            _write_floor(writer, level, level.floor, palette)


def _write_floor(writer: RowWriter, level: SceneLevel, floor: FloorMap, palette: Palette) -> None:
    cos, sin = math.cos(floor.origin_theta), math.sin(floor.origin_theta)
    turned = floor.resolution * np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    writer.static(
        (*level.path, "floor"),
        rr.Image(picture_of(floor.cells, palette), draw_order=-20.0),
        rr.Transform3D(translation=[floor.origin_x, floor.origin_y, 0.0], mat3x3=turned),
    )


def picture_of(cells: NDArray[np.int8], palette: Palette) -> NDArray[np.uint8]:
    """Return the cells as colours, uint8 (rows, columns, RGB), row 0 = lowest y."""
    return _shades(palette)[cells.view(np.uint8)]


def _shades(palette: Palette) -> NDArray[np.uint8]:
    """Return a colour for each of the 256 bytes: -1 unknown, 0 free .. 100 occupied."""
    share = np.linspace(0.0, 1.0, 101)[:, None]
    shades = np.tile(np.array(palette.background, np.float64), (256, 1))
    floor, wall = (np.array(colour, np.float64) for colour in (palette.floor, palette.wall))
    shades[:101] = floor + share * (wall - floor)
    return np.round(shades).astype(np.uint8)
