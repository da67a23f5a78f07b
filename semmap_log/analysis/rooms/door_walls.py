"""Whether a door hangs in a wall: one that does not keeps no two rooms apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.analysis.rooms.level_rooms import OCCUPIED_FROM
from semmap_log.analysis.rooms.strokes import Point, distances
from semmap_log.core.model.doors import Door
from semmap_log.core.model.events import FloorMap

NEAR_M = 0.3
"""An end so near to a wall, or to another door, hangs there."""


def in_walls(floor: FloorMap, doors: Sequence[Door]) -> list[bool]:
    """Return of each door whether both of its ends are at a wall or at another door."""
    geometry = GridGeometry.of_floor(floor)
    return [
        all(
            _at_wall(floor, geometry, end) or _at_another(door, end, doors)
            for end in (door.start, door.end)
        )
        for door in doors
    ]


def _at_wall(floor: FloorMap, geometry: GridGeometry, point: Point) -> bool:
    x, y = point
    window = geometry.window_of(x - NEAR_M, y - NEAR_M, x + NEAR_M, y + NEAR_M)
    rows, columns = np.nonzero(floor.cells[window.slices] >= OCCUPIED_FROM)
    cell_m = geometry.resolution
    wall_x = geometry.origin_x + (columns + window.x0 + 0.5) * cell_m
    wall_y = geometry.origin_y + (rows + window.y0 + 0.5) * cell_m
    return bool((np.hypot(wall_x - x, wall_y - y) <= NEAR_M + cell_m / 2).any())


def _at_another(door: Door, point: Point, doors: Sequence[Door]) -> bool:
    x, y = np.array(point[0]), np.array(point[1])
    return any(
        float(distances(x, y, other.start, other.end)) <= NEAR_M
        for other in doors
        if other is not door
    )
