"""Floor plans into a rerun recording: dark pictures under the doors, in metres."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.model.events import FloorMap
from semmap_log.views.excerpt.floor_plans import PLAN, PlanEra, Stamps
from semmap_log.views.palette import Palette
from semmap_log.views.rerun.rerun_sdk import rr
from semmap_log.views.rerun.rows import EVENT, HAPPENED, RECORDED, RowWriter
from semmap_log.views.rerun.scene import Scene, SceneLevel

FLOOR = "floor"
"""Last part of the entity's path."""


def write_floors(writer: RowWriter, scene: Scene, palette: Palette) -> None:
    """Write each level's plans and the mirror that turns our y up into the view's y down."""
    for level in scene.levels.values():
        writer.static(level.path, rr.Transform3D(scale=[1.0, -1.0, 1.0]))
        if not level.plans.is_one:
            _write_plans(writer, scene, level, palette)
        elif level.floor is not None:
            writer.static((*level.path, FLOOR), *_drawn(level.floor, palette))


def eras_along(level: SceneLevel) -> list[tuple[Sequence[str], Sequence[PlanEra]]]:
    """Return a level's plans along each timeline."""
    return [([HAPPENED], level.plans.happened), ([RECORDED, EVENT], level.plans.recorded)]


def since_of(eras: Sequence[PlanEra], scene: Scene) -> list[Stamps]:
    """Return from when on each plan shows, a row of `PLAN` each: the first from the beginning."""
    begin = np.array([(scene.begin.number, scene.begin.folds_ns, scene.begin.recorded_ns)], PLAN)
    return [begin, *(era.since for era in eras[1:])][: len(eras)]


def _write_plans(writer: RowWriter, scene: Scene, level: SceneLevel, palette: Palette) -> None:
    """Write plans one after the other: each shows until the next."""
    path = (*level.path, FLOOR)
    for timelines, eras in eras_along(level):
        for row, era in zip(since_of(eras, scene), eras, strict=True):
            if era.floor is None:
                writer.clear(path, row, timelines, returns=row[:0])
            else:
                writer.one(path, row, _drawn(era.floor, palette), timelines)


def _drawn(floor: FloorMap, palette: Palette) -> Sequence[Any]:
    return (
        rr.Image(picture_of(floor.cells, palette), draw_order=-20.0),
        rr.Transform3D(
            translation=[floor.origin_x, floor.origin_y, 0.0], mat3x3=_turned_cell(floor)
        ),
    )


def _turned_cell(floor: FloorMap) -> NDArray[np.float64]:
    cos, sin = math.cos(floor.origin_theta), math.sin(floor.origin_theta)
    return floor.resolution * np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


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
