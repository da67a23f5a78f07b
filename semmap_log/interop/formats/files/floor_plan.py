"""Drawing walls and floors to an occupancy grid."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from semmap_log.core.model.events import FloorMap
from semmap_log.errors import FormatError

if TYPE_CHECKING:
    from PIL import ImageDraw

Point: TypeAlias = tuple[float, float]
"""(x, y), metres, y up."""
Segment: TypeAlias = tuple[Point, Point]

WALL_M = 0.1
"""How thick walls are drawn."""
MARGIN_M = 1.0
MOST_CELLS = 100_000_000

OCCUPIED, FREE, UNKNOWN = 100, 0, 255
"""As bytes; 255 is -1 in an int8 cell."""


@dataclass(frozen=True, slots=True)
class Outlines:
    """What a floor plan is drawn from."""

    walls: Sequence[Segment]
    doors: Sequence[Segment] = ()
    floors: Sequence[Sequence[Point]] = ()
    holes: Sequence[Sequence[Point]] = ()
    """Where there is no floor: shafts, stairwells."""


def draw_floor(plan: Outlines, *, level: int, resolution: float, path: Path) -> FloorMap:
    """Return the grid: walls 100, floors and doorways 0, else -1. Without floors all else is 0.

    Doorways are cut into the walls, so that a door that opens opens a way.

    Raises:
        FormatError: The plan is too large for a grid of that resolution; names `path`.
    """
    from PIL import Image, ImageDraw

    # The log stores the resolution as float32: draw with the value that a reader will see.
    cell_m = float(np.float32(resolution))
    corners = np.array([*_points(plan)])
    origin = np.floor((corners.min(axis=0) - MARGIN_M) / cell_m) * cell_m
    columns, rows = (int(n) for n in np.ceil((corners.max(axis=0) + MARGIN_M - origin) / cell_m))
    if columns * rows > MOST_CELLS:
        raise FormatError(
            path,
            f"expected a level of at most {MOST_CELLS:,} cells of {cell_m:g} m, "
            f"got {columns:,} x {rows:,}",
        )
    # Row 0 of the picture is row 0 of the grid, the lowest y: nothing is flipped.
    picture = Image.new("L", (columns, rows), UNKNOWN if plan.floors else FREE)
    pen = _Pen(ImageDraw.Draw(picture), origin[0], origin[1], cell_m)
    for polygons, value in ((plan.floors, FREE), (plan.holes, UNKNOWN)):
        for polygon in polygons:
            pen.fill(polygon, value)
    for wall in plan.walls:
        pen.fill(_rectangle(wall, half_m=WALL_M / 2, longer_m=WALL_M / 2), OCCUPIED)
    for door in plan.doors:
        pen.fill(_rectangle(door, half_m=WALL_M / 2 + cell_m, longer_m=-WALL_M / 2), FREE)
    cells = np.asarray(picture, dtype=np.uint8).view(np.int8)
    return FloorMap(
        level=level,
        resolution=cell_m,
        origin_x=float(origin[0]),
        origin_y=float(origin[1]),
        cells=cells,
    )


@dataclass(frozen=True, slots=True)
class _Pen:
    """Fills polygons given in metres."""

    draw: ImageDraw.ImageDraw
    origin_x: float
    origin_y: float
    cell_m: float

    def fill(self, polygon: Sequence[Point], value: int) -> None:
        # PIL's whole numbers are cell centres.
        corners = [
            ((x - self.origin_x) / self.cell_m - 0.5, (y - self.origin_y) / self.cell_m - 0.5)
            for x, y in polygon
        ]
        self.draw.polygon(corners, fill=value)


def _rectangle(segment: Segment, *, half_m: float, longer_m: float) -> list[Point]:
    """Return the corners of a bar along the segment, `longer_m` longer at both ends."""
    (x0, y0), (x1, y1) = segment
    length = math.hypot(x1 - x0, y1 - y0) or 1.0
    ux, uy = (x1 - x0) / length, (y1 - y0) / length
    # A short doorway keeps its middle.
    longer_m = max(longer_m, -length / 4)
    x0, y0, x1, y1 = (
        x0 - ux * longer_m,
        y0 - uy * longer_m,
        x1 + ux * longer_m,
        y1 + uy * longer_m,
    )
    nx, ny = -uy * half_m, ux * half_m
    return [(x0 + nx, y0 + ny), (x1 + nx, y1 + ny), (x1 - nx, y1 - ny), (x0 - nx, y0 - ny)]


def _points(plan: Outlines) -> list[Point]:
    lines: list[Sequence[Point]] = [*plan.walls, *plan.doors, *plan.floors]
    return [point for line in lines for point in line]
