"""The free floor of a level, as a robot of some radius can use it with every door shut.

Cells are larger than the plan's (0.15 m), and free where the robot's middle may stand: on known
floor, no nearer to walls than its radius. Doors are strokes, open or shut: passing through one is
counted separately, in `door_ways`, from the cell on one side to the cell on the other, through its
middle, however narrow it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.analysis.rooms import regions
from semmap_log.analysis.rooms.level_rooms import OCCUPIED_FROM, Point, draw_doors
from semmap_log.core.model.doors import Door
from semmap_log.core.model.events import FloorMap
from semmap_log.errors import CostmapError

REACH_M = 1.0
"""How far before a door the robot may have to stand, in addition to its radius."""
LEAST_AWAY_M = 1e-6
"""A point nearer to a door's line is on neither of its sides."""
LEAST_REACH_CELLS = 0.75
"""Walls grow by so much of a cell at least: else a way could lead through a thin one."""
MOST_CELLS = 25_000_000

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Spot:
    """The cell where the robot stands for a wanted point."""

    region: int
    """Which connected part of the floor it lies in."""
    flat: int
    """Row x width + column."""
    from_cell_m: float
    """How far the point is from the cell's centre."""


class WalkingFloor:
    """One level's floor; see the module."""

    def __init__(
        self, floor: FloorMap, doors: Iterable[Door], *, radius_m: float, cell_m: float
    ) -> None:
        """Draw the floor.

        Args:
            floor: The level's plan.
            doors: Its doors.
            radius_m: The robot's radius.
            cell_m: Metres a cell, at least the plan's.

        Raises:
            CostmapError: The plan is rotated against its grid, or has too many cells for that size.
        """
        self.level = floor.level
        self.doors = sorted(doors, key=lambda door: door.door_id)
        self._fine = GridGeometry.of_floor(floor)
        self._walls = floor.cells >= OCCUPIED_FROM
        self._open = ~self._walls
        draw_doors(self._open, self._fine, self.doors)
        stride = max(1, round(cell_m / self._fine.resolution))
        self.geometry = _sampled(self._fine, stride)
        if self.geometry.width * self.geometry.height > MOST_CELLS:
            raise CostmapError(
                f"the floor of level {floor.level}: expected at most {MOST_CELLS:,} cells of "
                f"{self.geometry.resolution:g} m, got {self.geometry.width:,} x "
                f"{self.geometry.height:,}; take larger cells"
            )
        reach_m = max(radius_m, LEAST_REACH_CELLS * self.geometry.resolution)
        shut = grown(self._walls | (floor.cells < 0), reach_m / self._fine.resolution)
        free = ~shut[stride // 2 :: stride, stride // 2 :: stride]
        draw_doors(free, self.geometry, self.doors)
        self.regions: regions.Regions = regions.regions_of(free)
        self._radius_m = radius_m
        self._near_m = radius_m + 2 * self.geometry.resolution
        self._before_door_m = REACH_M + radius_m
        self._fields: dict[int, regions.DistanceFields] = {}

    def field(self, region: int) -> regions.DistanceFields:
        """Return the field that measures ways in a connected part of the floor."""
        if region not in self._fields:
            self._fields[region] = regions.DistanceFields(self.regions, region)
        return self._fields[region]

    @property
    def metres(self) -> float:
        """Metres per unit of the fields' costs."""
        return self.geometry.resolution / regions.STRAIGHT

    def spot(self, x: float, y: float) -> Spot | None:
        """Return the cell nearest to a point, in sight of it; None: in a wall, or too narrow."""
        return self._seen_from((x, y), self._near_m)

    def before(self, door: Door, side: float) -> Spot | None:
        """Return where the robot stands before a door; None: there is no floor for it.

        As near as it can without touching the door where it is shut; in a niche too small for
        that, nearer.

        Args:
            door: One of this level.
            side: 1: on the left of its line, looking from its start along theta; -1: the right.
        """
        away = (-math.sin(door.theta) * side, math.cos(door.theta) * side)
        middle, reach_m = middle_of(door), self._before_door_m
        return self._seen_from(middle, reach_m, (away, self._radius_m)) or self._seen_from(
            middle, reach_m, (away, LEAST_AWAY_M)
        )

    def beside(self, flat: int) -> list[tuple[int, int]]:
        """Return the cells that a step leads to, row x width + column, with what it costs."""
        row, column = divmod(flat, self.geometry.width)
        rows, columns = np.mgrid[row - 1 : row + 2, column - 1 : column + 2]
        free = self.regions.label_at(rows, columns) > 0
        found = []
        for up, right in np.argwhere(free).tolist():
            diagonal = up != 1 and right != 1
            if (up, right) == (1, 1) or (diagonal and not (free[up, 1] and free[1, right])):
                continue
            beside = (row + up - 1) * self.geometry.width + column + right - 1
            found.append((beside, regions.DIAGONAL if diagonal else regions.STRAIGHT))
        return found

    def point_of(self, flat: int) -> Point:
        """Return the centre of a cell, metres."""
        row, column = divmod(flat, self.geometry.width)
        return self.geometry.map_to_world(column, row)

    def _seen_from(
        self, point: Point, reach_m: float, away: tuple[Point, float] | None = None
    ) -> Spot | None:
        """Return the nearest cell that is in sight of a point.

        Args:
            point: Metres.
            reach_m: No farther than that.
            away: Only cells that lie in that direction, at least so far; None: in any.
        """
        flats, x, y = self._cells_around(point, reach_m)
        distance = np.hypot(x - point[0], y - point[1])
        wanted = distance <= reach_m
        if away is not None:
            (right, up), least_m = away
            wanted &= (x - point[0]) * right + (y - point[1]) * up >= least_m
        labels = self.regions.label_at(*np.divmod(flats, self.geometry.width))
        order = np.flatnonzero(wanted & (labels > 0))
        leaves_door = away is not None
        for cell in order[np.lexsort((flats[order], distance[order]))].tolist():
            if self._sees(point, (float(x[cell]), float(y[cell])), leaves_door=leaves_door):
                return Spot(int(labels[cell]), int(flats[cell]), float(distance[cell]))
        return None

    def _cells_around(
        self, point: Point, reach_m: float
    ) -> tuple[regions.Index, NDArray[np.float64], NDArray[np.float64]]:
        """Return the cells of a square around a point, with their centres."""
        x, y = point
        window = self.geometry.window_of(x - reach_m, y - reach_m, x + reach_m, y + reach_m)
        rows, columns = np.mgrid[window.slices]
        centre_x = self.geometry.origin_x + (columns + 0.5) * self.geometry.resolution
        centre_y = self.geometry.origin_y + (rows + 0.5) * self.geometry.resolution
        flats = rows.astype(np.int64) * self.geometry.width + columns
        return flats.ravel(), centre_x.ravel(), centre_y.ravel()

    def _sees(self, point: Point, target: Point, *, leaves_door: bool) -> bool:
        """Return whether nothing stands between two points, except a door that the first one is in.

        Where the way leaves a door, neither a wall nor a door at its start counts: the middle of a
        door in a wall without a gap can be left, too.
        """
        steps = 2 + 2 * math.ceil(math.dist(point, target) / self._fine.resolution)
        share = np.linspace(0.0, 1.0, steps)
        columns = (point[0] + share * (target[0] - point[0]) - self._fine.origin_x) // (
            self._fine.resolution
        )
        rows = (point[1] + share * (target[1] - point[1]) - self._fine.origin_y) // (
            self._fine.resolution
        )
        columns = np.clip(columns, 0, self._fine.width - 1).astype(np.int64)
        rows = np.clip(rows, 0, self._fine.height - 1).astype(np.int64)
        seen = self._open[rows, columns]
        if not leaves_door and self._walls[rows[0], columns[0]]:
            return False
        first = int(np.argmax(seen))
        return bool(seen[first:].all())


def middle_of(door: Door) -> Point:
    """Return the middle of a door's line."""
    (x0, y0), (x1, y1) = door.start, door.end
    return (x0 + x1) / 2, (y0 + y1) / 2


def grown(cells: Mask, by: float) -> Mask:
    """Return the cells whose centres are at most so many cells from a true one's."""
    made: Mask = cells.copy()
    wide, width = cells.copy(), 0
    rows, columns = cells.shape
    by = min(by, math.hypot(rows, columns))  # which reaches every cell
    for up in reversed(range(min(math.floor(by), rows - 1) + 1)):
        across = min(math.floor(math.sqrt(by * by - up * up)), columns - 1)
        for shift in range(width + 1, across + 1):
            wide[:, shift:] |= cells[:, :-shift]
            wide[:, :-shift] |= cells[:, shift:]
        width = across
        made[up:] |= wide[: rows - up]
        made[: rows - up] |= wide[up:]
    return made


def _sampled(fine: GridGeometry, stride: int) -> GridGeometry:
    """Return the grid whose cells have each stride-th cell of a finer one in their middle."""
    cell_m = fine.resolution * stride
    offset_m = (stride // 2 + 0.5) * fine.resolution - cell_m / 2
    count = [len(range(stride // 2, size, stride)) for size in (fine.width, fine.height)]
    return GridGeometry(
        max(count[0], 1), max(count[1], 1), cell_m, fine.origin_x + offset_m,
        fine.origin_y + offset_m,
    )  # fmt: skip
