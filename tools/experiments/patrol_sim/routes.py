"""Ways over a floor plan: a grid of free cells, shortest ways to a goal, door crossings.

All in the frame `map` of the floor map's level, metres; cells are (row, column), row 0 lowest.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from patrol_sim.grid import Cell, Tree, coarser, costs, grown
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded, FloorMap

Point = tuple[float, float]

MOST_TREES = 150
"""Kept in memory, half a MB each; those with shut portals go first."""
VIEW_M = (1.2, 1.0, 1.5, 0.8)
"""Distances from which the robot looks at a door, best first."""


@dataclass(frozen=True, slots=True)
class Crossing:
    """Where a way goes through a door."""

    door_id: DoorId
    along_m: float
    """Metres from the start of the way."""


class FloorRoutes:
    """One level's ways. Doors block them, but for the `portals`, while these are not shut."""

    def __init__(
        self, floor: FloorMap, doors: Iterable[DoorAdded], portals: Iterable[DoorId], cell_m: float
    ) -> None:
        self._factor = round(cell_m / floor.resolution)
        self._cell_m = floor.resolution * self._factor
        self._origin = (floor.origin_x, floor.origin_y)
        self._doors = {door.door_id: door for door in doors}
        self._portals = frozenset(portals) & self._doors.keys()
        solid = coarser(floor.cells != 0, self._factor)
        for door in self._doors.values():
            if door.door_id not in self._portals:
                solid |= self._line(door, solid.shape)
        self._cost = costs(solid, self._cell_m)
        self._trees: dict[tuple[Cell, frozenset[DoorId]], Tree] = {}

    def is_free(self, point: Point) -> bool:
        """Tell whether the robot's middle may be there."""
        row, column = self._cell(point)
        rows, columns = self._cost.shape
        inside = 0 <= row < rows and 0 <= column < columns
        return inside and math.isfinite(self._cost[row, column])

    def length_m(
        self, source: Point, target: Point, shut: frozenset[DoorId] = frozenset()
    ) -> float:
        """Return how far it is, walls shunned, the other portals open; inf: there is no way."""
        row, column = self._cell(source)
        return self._tree(target, shut).length[row, column]

    def way(
        self, source: Point, target: Point, shut: frozenset[DoorId] = frozenset()
    ) -> list[Point] | None:
        """Return the best way as a line of points; None: there is none while those are shut."""
        cells = self._tree(target, shut).cells_from(self._free_cell(source))
        if cells is None:
            return None
        middle = [self._point(cell) for cell in self._straightened(cells)]
        return [source, *middle[1:-1], target]

    def crossings(self, way: Sequence[Point]) -> list[Crossing]:
        """Return where the way goes through portals, in order."""
        found, along_m = [], 0.0
        lines = {door_id: _ends(self._doors[door_id]) for door_id in self._portals}
        for start, end in pairwise(way):
            length = math.dist(start, end)
            for door_id, line in lines.items():
                where = _crossed_at(start, end, *line)
                if where is not None:
                    found.append(Crossing(door_id, along_m + where * length))
            along_m += length
        return sorted(found, key=lambda crossing: crossing.along_m)

    def viewpoint(self, door: DoorAdded, home: Point) -> Point | None:
        """Return where to stand to see the door, on the side nearer to home; None: nowhere."""
        start, end = _ends(door)
        middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
        for distance in VIEW_M:
            across = (-math.sin(door.theta) * distance, math.cos(door.theta) * distance)
            sides = [(middle[0] + s * across[0], middle[1] + s * across[1]) for s in (1, -1)]
            lengths = [self.length_m(p, home) if self.is_free(p) else math.inf for p in sides]
            if math.isfinite(min(lengths)):
                return sides[lengths.index(min(lengths))]
        return None

    def tour(self, home: Point, stops: Iterable[Point]) -> list[Point]:
        """Return the stops in the order of a round: always on to the nearest one left."""
        left, here, order = list(stops), home, []
        while left:
            here = min(left, key=lambda stop: self.length_m(here, stop))
            left.remove(here)
            order.append(here)
        return order

    def _tree(self, target: Point, shut: frozenset[DoorId]) -> Tree:
        key = (self._cell(target), shut & self._portals)
        if key not in self._trees:
            if len(self._trees) >= MOST_TREES:
                self._trees = {kept: tree for kept, tree in self._trees.items() if not kept[1]}
            cost = self._cost.copy()
            for door_id in key[1]:
                cost[self._line(self._doors[door_id], cost.shape)] = math.inf
            self._trees[key] = Tree(cost, key[0], self._cell_m)
        return self._trees[key]

    def _cell(self, point: Point) -> Cell:
        column, row = (
            math.floor((value - low) / self._cell_m)
            for value, low in zip(point, self._origin, strict=True)
        )
        return row, column

    def _free_cell(self, point: Point) -> Cell:
        """Return the nearest cell to a point that is free, the point's own if it is."""
        row, column = self._cell(point)
        around = [(row + i, column + j) for i in range(-2, 3) for j in range(-2, 3)]
        free = [cell for cell in around if math.isfinite(self._cost[cell])]
        return min(free, key=lambda cell: math.dist(cell, (row, column)), default=(row, column))

    def _point(self, cell: Cell) -> Point:
        row, column = cell
        return (
            self._origin[0] + (column + 0.5) * self._cell_m,
            self._origin[1] + (row + 0.5) * self._cell_m,
        )

    def _line(self, door: DoorAdded, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        """Return the cells that the door's line touches, grown by one so that it is tight."""
        mask = np.zeros(shape, np.bool_)
        start, end = _ends(door)
        steps = max(2, math.ceil(door.width / self._cell_m * 3))
        for point in _between(start, end, steps):
            mask[self._cell(point)] = True
        return grown(mask)

    def _straightened(self, cells: list[Cell]) -> list[Cell]:
        """Return the corners of the way, where no straight piece is nearer to a wall than it."""
        corners, first = [cells[0]], 0
        while first < len(cells) - 1:
            last = first + 1
            dearest = max(self._cost[cells[first]], self._cost[cells[last]])
            for ahead in range(first + 2, min(first + 80, len(cells))):
                dearest = max(dearest, self._cost[cells[ahead]])
                if self._dearest_between(cells[first], cells[ahead]) <= dearest:
                    last = ahead
            corners.append(cells[last])
            first = last
        return corners

    def _dearest_between(self, start: Cell, end: Cell) -> float:
        steps = 2 * max(abs(end[0] - start[0]), abs(end[1] - start[1]))
        line = _between(start, end, steps)
        return max(float(self._cost[round(row), round(column)]) for row, column in line)


def _ends(door: DoorAdded) -> tuple[Point, Point]:
    along = (math.cos(door.theta) * door.width, math.sin(door.theta) * door.width)
    return (door.x, door.y), (door.x + along[0], door.y + along[1])


def _between(start: Point, end: Point, steps: int) -> Iterator[Point]:
    """Yield steps + 1 points on the line, both ends included."""
    for step in range(steps + 1):
        share = step / steps
        yield (start[0] + (end[0] - start[0]) * share, start[1] + (end[1] - start[1]) * share)


def _crossed_at(a: Point, b: Point, c: Point, d: Point) -> float | None:
    """Return the share of the way from a to b at which it crosses the line c-d; None: nowhere."""
    ab, cd, ac = ((end[0] - start[0], end[1] - start[1]) for start, end in ((a, b), (c, d), (a, c)))
    turn = ab[0] * cd[1] - ab[1] * cd[0]
    if turn == 0:
        return None
    on_way = (ac[0] * cd[1] - ac[1] * cd[0]) / turn
    on_door = (ac[0] * ab[1] - ac[1] * ab[0]) / turn
    return on_way if 0 <= on_way < 1 and 0 <= on_door <= 1 else None
