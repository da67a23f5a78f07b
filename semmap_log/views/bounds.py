"""Compute the bounding rectangle of a plan, and the rooms that a view tints and names."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.analysis.rooms.level_rooms import RoomPlan, plan_of
from semmap_log.core.model.doors import DoorMap
from semmap_log.core.model.events import FloorMap
from semmap_log.errors import CostmapError
from semmap_log.log import DoorLog

MARGIN_M = 1.0
SMALLEST_SIDE_M = 4.0
"""The least side, so that a lone door does not fill the screen."""

UNKNOWN_CELL = -1


@dataclass(frozen=True, slots=True)
class Bounds:
    """A rectangle, metres, frame `map`; the empty one contains nothing."""

    low_x: float = math.inf
    low_y: float = math.inf
    high_x: float = -math.inf
    high_y: float = -math.inf

    def around(self, x: NDArray[np.floating], y: NDArray[np.floating]) -> Bounds:
        """Return the smallest rectangle that also contains these points; NaN is ignored."""
        known = np.isfinite(x) & np.isfinite(y)
        if not known.any():
            return self
        x, y = x[known], y[known]
        return Bounds(
            min(self.low_x, float(x.min())), min(self.low_y, float(y.min())),
            max(self.high_x, float(x.max())), max(self.high_y, float(y.max())),
        )  # fmt: skip

    def including(self, other: Bounds) -> Bounds:
        """Return the smallest rectangle that contains both."""
        x = np.array([other.low_x, other.high_x])
        return self.around(x, np.array([other.low_y, other.high_y]))

    def framed(self) -> Bounds:
        """Return the rectangle with a margin, and not too small to look at."""
        if self.is_empty:
            return Bounds(0.0, 0.0, 0.0, 0.0).framed()
        grow_x = max(MARGIN_M, (SMALLEST_SIDE_M - (self.high_x - self.low_x)) / 2)
        grow_y = max(MARGIN_M, (SMALLEST_SIDE_M - (self.high_y - self.low_y)) / 2)
        return Bounds(
            self.low_x - grow_x, self.low_y - grow_y, self.high_x + grow_x, self.high_y + grow_y
        )

    def without_margin(self) -> Bounds:
        """Return the rectangle without the margin of `framed`, or somewhat more."""
        return Bounds(
            self.low_x + MARGIN_M, self.low_y + MARGIN_M,
            self.high_x - MARGIN_M, self.high_y - MARGIN_M,
        )  # fmt: skip

    def holds(self, other: Bounds) -> bool:
        """Return whether another rectangle lies within this one; the empty one always does."""
        return self.including(other) == self

    @property
    def is_empty(self) -> bool:
        """True for the empty rectangle."""
        return self.low_x > self.high_x

    @property
    def longest_side_m(self) -> float:
        """The longer of width and height."""
        return max(self.high_x - self.low_x, self.high_y - self.low_y)


def bounds_of_floor(floor: FloorMap) -> Bounds:
    """Return the rectangle around the known cells: a scanned map has wide unknown margins."""
    rows, columns = np.nonzero(floor.cells != UNKNOWN_CELL)
    if not len(rows):
        return Bounds()
    along_x = np.array([columns.min(), columns.max() + 1]) * floor.resolution
    along_y = np.array([rows.min(), rows.max() + 1]) * floor.resolution
    x, y = (corner.ravel() for corner in np.meshgrid(along_x, along_y))
    cos, sin = math.cos(floor.origin_theta), math.sin(floor.origin_theta)
    return Bounds().around(floor.origin_x + cos * x - sin * y, floor.origin_y + sin * x + cos * y)


def rooms_shown(log: DoorLog, door_map: DoorMap) -> RoomPlan:
    """Return the rooms of a door map's levels; a rotated floor plan has none to show."""
    floors = {n: floor for n in door_map.levels if (floor := log.floor_of(door_map, n)) is not None}
    return plan_of(door_map, {n: floor for n, floor in floors.items() if _is_upright(floor)})


def _is_upright(floor: FloorMap) -> bool:
    try:
        GridGeometry.of_floor(floor)
    except CostmapError:
        return False
    return True
