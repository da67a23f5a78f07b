"""The rooms of one level: its floor plan with the doors drawn in, cut into regions.

The rule, for every plan: occupied cells are walls, and each door a stroke 0.1 m thick, open or
shut; what they leave falls into 4-connected regions. A region at the border of the plan is the
outside, one below 1 m² a shaft, any other a room. Unknown cells are floor here: only walls and
doors cut. So rooms need walls all around: one whose floor ends in the unknown, as a laser's map may
have it, is part of the outside.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.analysis.rooms.regions import Regions, regions_of
from semmap_log.analysis.rooms.room_graph import OUTSIDE, RoomId
from semmap_log.analysis.rooms.strokes import clear_stroke
from semmap_log.core.model.doors import Door
from semmap_log.core.model.events import FloorMap

STROKE_M = 0.1
"""How thick a door is drawn; where cells are larger, one cell."""
LEAST_ROOM_M2 = 1.0
"""A region below that is a shaft, or a gap between two walls."""
OCCUPIED_FROM = 65
"""A cell from there on is a wall: map_server's `occupied_thresh`."""

NO_ROOM: RoomId = -1
"""Of a cell in a wall, a door or a shaft."""


@dataclass(frozen=True, slots=True)
class LevelRooms:
    """Which room each cell of a level's floor plan lies in."""

    level: int
    geometry: GridGeometry
    regions: Regions
    room_of: NDArray[np.int64]
    """By the label of a region, its room; `OUTSIDE`, or `NO_ROOM`."""

    @property
    def rooms(self) -> list[RoomId]:
        """The level's rooms, ascending."""
        return [int(room) for room in self.room_of if room > OUTSIDE]

    def label_of(self, room_id: RoomId) -> int:
        """Return the region that a room is."""
        return int(np.flatnonzero(self.room_of == room_id)[0])

    def rooms_at(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.int64]:
        """Return the rooms at points, metres; what is off the plan is `OUTSIDE`."""
        columns, rows = self.cells_at(x, y)
        found = self.room_of[self.regions.label_at(rows, columns)]
        on_plan = (
            (columns >= 0) & (columns < self.geometry.width)
            & (rows >= 0) & (rows < self.geometry.height)
        )  # fmt: skip
        return np.where(on_plan, found, OUTSIDE)

    def cells_at(self, x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the columns and rows of points; off the plan, one that it does not have."""
        grid = self.geometry
        across = (np.asarray(x, np.float64) - grid.origin_x) / grid.resolution
        up = (np.asarray(y, np.float64) - grid.origin_y) / grid.resolution
        return (
            np.floor(np.clip(across, -1, grid.width)).astype(np.int64),
            np.floor(np.clip(up, -1, grid.height)).astype(np.int64),
        )


def level_rooms(floor: FloorMap, doors: Iterable[Door], *, first_room: RoomId = 1) -> LevelRooms:
    """Return the rooms of a floor plan.

    Args:
        floor: The plan.
        doors: The level's doors, in whatever state.
        first_room: The number of its first room.

    Raises:
        CostmapError: The plan is turned against its grid.
    """
    geometry = GridGeometry.of_floor(floor)
    free = floor.cells < OCCUPIED_FROM
    draw_doors(free, geometry, doors)
    regions = regions_of(free)
    return LevelRooms(floor.level, geometry, regions, _numbered(regions, geometry, first_room))


def draw_doors(free: NDArray[np.bool_], geometry: GridGeometry, doors: Iterable[Door]) -> None:
    """Take the doors' strokes from the free cells of a grid."""
    half_m = max(STROKE_M, geometry.resolution) / 2 * (1 + 1e-6)
    for door in doors:
        clear_stroke(free, geometry, door.start, door.end, half_m)


def _numbered(regions: Regions, geometry: GridGeometry, first_room: RoomId) -> NDArray[np.int64]:
    """Return the room of each label, in the order of the regions' first cells."""
    area_m2 = regions.cell_counts() * geometry.resolution**2
    border = regions.at_border()
    is_room = ~border & (area_m2 >= LEAST_ROOM_M2)
    rooms = np.where(is_room, first_room - 1 + np.cumsum(is_room), NO_ROOM)
    rooms[border] = OUTSIDE
    return rooms
