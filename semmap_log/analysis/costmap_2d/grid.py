"""Where cells lie: the arithmetic of ROS's `costmap_2d` between metres and cells.

A grid is a numpy array of shape (height, width), row 0 at the lowest y; its origin is the outer
corner of cell (0, 0). Rules as in noetic's `costmap_2d/src/costmap_2d.cpp` and
`layered_costmap.cpp`, in IEEE doubles, division and truncation included.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.model.events import FloorMap
from semmap_log.errors import CostmapError

MOST_CELLS = 2**31 - 1
"""Along one edge, and in all: cells are counted in C's `unsigned int` and drawn in `int`."""
LEAST_TURN_CELLS = 0.01
"""A yaw that moves no cell further than this is a rounding error, not a turn."""


@dataclass(frozen=True, slots=True)
class CellWindow:
    """A rectangle of cells: columns x0 <= mx < xn, rows y0 <= my < yn."""

    x0: int
    y0: int
    xn: int
    yn: int

    @property
    def area(self) -> int:
        """How many cells it has."""
        return max(0, self.xn - self.x0) * max(0, self.yn - self.y0)

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.yn - self.y0, self.xn - self.x0

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns, as an index into a grid."""
        return slice(self.y0, self.yn), slice(self.x0, self.xn)

    def dilated(self, cells: int) -> CellWindow:
        """Return the window with so many cells more on each side."""
        return CellWindow(self.x0 - cells, self.y0 - cells, self.xn + cells, self.yn + cells)

    def within(self, other: CellWindow) -> CellWindow:
        """Return what of it lies in the other."""
        return CellWindow(
            max(self.x0, other.x0), max(self.y0, other.y0),
            min(self.xn, other.xn), min(self.yn, other.yn),
        )  # fmt: skip

    def joined(self, other: CellWindow) -> CellWindow:
        """Return the least window that holds both."""
        return CellWindow(
            min(self.x0, other.x0), min(self.y0, other.y0),
            max(self.xn, other.xn), max(self.yn, other.yn),
        )  # fmt: skip

    def seen_from(self, other: CellWindow) -> CellWindow:
        """Return the same cells, counted from the other's first."""
        return CellWindow(
            self.x0 - other.x0, self.y0 - other.y0, self.xn - other.x0, self.yn - other.y0
        )


def read_only(grid: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a view of a grid that cannot be written."""
    view: NDArray[np.uint8] = grid[:]
    view.flags.writeable = False
    return view


def merged(windows: Iterable[CellWindow]) -> list[CellWindow]:
    """Return windows that hold the same cells and do not overlap."""
    apart: list[CellWindow] = []
    for window in windows:
        grown = window
        while near := [other for other in apart if grown.within(other).area]:
            for other in near:
                grown = grown.joined(other)
                apart.remove(other)
        if grown.area:
            apart.append(grown)
    return apart


@dataclass(frozen=True, slots=True)
class GridGeometry:
    """How many cells of which size lie where.

    Args:
        width: Columns (x).
        height: Rows (y).
        resolution: Metres a cell.
        origin_x: Outer corner of cell (0, 0), metres, frame `map`.
        origin_y: The same, upwards.

    Raises:
        CostmapError: No such grid can be.
    """

    width: int
    height: int
    resolution: float
    origin_x: float = 0.0
    origin_y: float = 0.0

    def __post_init__(self) -> None:
        cells = self.width * self.height
        if self.width < 1 or self.height < 1 or cells > MOST_CELLS:
            raise CostmapError(
                f"a grid: expected 1 x 1 up to {MOST_CELLS:,} cells, "
                f"got {self.width} x {self.height}"
            )
        if not (math.isfinite(self.resolution) and self.resolution > 0):
            raise CostmapError(
                f"a grid's resolution: expected metres a cell, above 0, got {self.resolution!r}"
            )
        if not (math.isfinite(self.origin_x) and math.isfinite(self.origin_y)):
            raise CostmapError(
                f"a grid's origin: expected finite metres, got {self.origin_x!r}, {self.origin_y!r}"
            )

    @classmethod
    def of_map(
        cls, shape: tuple[int, int], resolution: float, origin: tuple[float, float]
    ) -> GridGeometry:
        """Return the geometry that a costmap takes from a map.

        The resolution goes through float32, as `nav_msgs/MapMetaData` does: 0.05 becomes
        0.05000000074505806, and the cells of doors far from the origin are others.
        """
        height, width = shape
        return cls(width, height, float(np.float32(resolution)), *origin)

    @classmethod
    def of_floor(cls, floor: FloorMap) -> GridGeometry:
        """Return where a floor plan's cells lie in a costmap.

        Raises:
            CostmapError: The plan is turned, so that its cells lie along other axes than a
                costmap's. ROS overlooks the yaw of a map's origin, and shows walls where none are.
        """
        height, width = floor.cells.shape
        turn = math.remainder(floor.origin_theta, 2 * math.pi)
        if abs(turn) * math.hypot(width, height) > LEAST_TURN_CELLS:
            raise CostmapError(
                f"the floor plan of level {floor.level}: expected an origin with yaw 0, "
                f"got {floor.origin_theta:.6g}; turn the picture instead of its origin"
            )
        return cls.of_map((height, width), floor.resolution, (floor.origin_x, floor.origin_y))

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width): of its grids."""
        return self.height, self.width

    @property
    def whole(self) -> CellWindow:
        """All of its cells."""
        return CellWindow(0, 0, self.width, self.height)

    def world_to_map(self, x: float, y: float) -> tuple[int, int] | None:
        """Return the cell (mx, my) that the point lies in; None off the map (`worldToMap`).

        The lower edges belong to the map, the upper ones do not.
        """
        if not (x >= self.origin_x and y >= self.origin_y):
            return None
        across = (x - self.origin_x) / self.resolution
        up = (y - self.origin_y) / self.resolution
        return (int(across), int(up)) if across < self.width and up < self.height else None

    def map_to_world(self, mx: int, my: int) -> tuple[float, float]:
        """Return the centre of a cell, metres (`mapToWorld`)."""
        return (
            self.origin_x + (mx + 0.5) * self.resolution,
            self.origin_y + (my + 0.5) * self.resolution,
        )

    def enforced(self, x: float, y: float) -> tuple[int, int]:
        """Return the cell of the map that is nearest along each axis (`worldToMapEnforceBounds`).

        Raises:
            CostmapError: A coordinate is not a number.
        """
        return (
            self._enforced(x, self.origin_x, self.width),
            self._enforced(y, self.origin_y, self.height),
        )

    def _enforced(self, value: float, origin: float, cells: int) -> int:
        if math.isnan(value):
            raise CostmapError("a bound of the map: expected metres, got nan")
        if value < origin:
            return 0
        if value >= self.resolution * cells + origin:
            return cells - 1
        return int((value - origin) / self.resolution)

    def window_of(self, min_x: float, min_y: float, max_x: float, max_y: float) -> CellWindow:
        """Return the cells that an update of these bounds, metres, touches (`updateMap`).

        With min above max, as where no layer has touched anything, it is empty.
        """
        x0, y0 = self.enforced(min_x, min_y)
        xn, yn = self.enforced(max_x, max_y)
        return CellWindow(x0, y0, min(self.width, xn + 1), min(self.height, yn + 1))
