"""Made-up buildings: rectangles cut in two, again and again, by walls with a door in each."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from semmap_log.core.model.doors import NAN, Door, DoorId, DoorMap, DoorState, Level
from semmap_log.core.model.events import FloorMap

CELL_M = 0.1
WALL = 2
"""Cells."""
LEAST = 14
"""A room's shortest side, cells."""
DOOR = 8
"""A doorway's width, cells: 0.8 m."""


@dataclass(frozen=True)
class Building:
    """A floor plan whose doorways are free, and the doors in them."""

    floor: FloorMap
    doors: tuple[Door, ...]
    rooms: int
    """How many the doors cut it into."""

    @property
    def free(self) -> NDArray[np.bool_]:
        """The floor with every door open."""
        return self.floor.cells < 50

    @property
    def door_map(self) -> DoorMap:
        level = self.floor.level
        return DoorMap({door.door_id: door for door in self.doors}, {level: Level(level)})


def door_at(
    number: int, start: tuple[float, float], end: tuple[float, float], *, level: int = 0,
    **annotations: str,
) -> Door:  # fmt: skip
    """Return a closed door whose line goes from one point to another."""
    (x, y), (end_x, end_y) = start, end
    theta, width = math.atan2(end_y - y, end_x - x), math.dist(start, end)
    return Door(
        DoorId(number), level, x, y, theta, width, DoorState.CLOSED, NAN, NAN,
        annotations=annotations,
    )  # fmt: skip


def floor_of(cells: NDArray[np.int8], *, level: int = 0, cell_m: float = CELL_M) -> FloorMap:
    """Return a floor plan whose first cell begins at (0, 0)."""
    return FloorMap(level=level, resolution=cell_m, origin_x=0.0, origin_y=0.0, cells=cells)


def drawn(text: str, *, level: int = 0, cell_m: float = CELL_M, scale: int = 1) -> FloorMap:
    """Return a floor plan: `#` is a wall, `?` unknown; the last line is that of the lowest y."""
    values = {"#": 100, "?": -1}
    rows = [[values.get(sign, 0) for sign in line] for line in text.strip("\n").splitlines()[::-1]]
    cells = np.kron(np.array(rows, np.int8), np.ones((scale, scale), np.int8))
    return floor_of(cells.astype(np.int8), level=level, cell_m=cell_m)


@st.composite
def buildings(draw: st.DrawFn) -> Building:
    """Buildings with outer walls and a yard around them, whose doorways lie between two rooms."""
    width, height = draw(st.integers(40, 90)), draw(st.integers(40, 90))
    cells = np.zeros((height, width), np.int8)
    cells[4 : height - 4, 4 : width - 4] = 100
    made = _Cutter(draw, cells)
    made.cut(6, 6, width - 6, height - 6)
    doors = tuple(door_at(n, *ends) for n, ends in enumerate(made.doors, start=1))
    return Building(floor_of(cells), doors, made.rooms)


class _Cutter:
    """Cuts rooms in two. A door lies where no other wall can end: away from the corners."""

    def __init__(self, draw: st.DrawFn, cells: NDArray[np.int8]) -> None:
        self.draw = draw
        self.cells = cells
        self.rooms = 0
        self.doors: list[tuple[tuple[float, float], tuple[float, float]]] = []

    def cut(self, x0: int, y0: int, x1: int, y1: int) -> None:
        """Make a room of a rectangle, or cut it by a wall with a door in it."""
        self.cells[y0:y1, x0:x1] = 0
        upright = x1 - x0 >= y1 - y0
        low, high = (x0, x1) if upright else (y0, y1)
        if high - low < 2 * LEAST + WALL or not self.draw(st.booleans()):
            self.rooms += 1
            return
        at = self.draw(st.integers(low + LEAST, high - LEAST - WALL))
        across = (y0, y1) if upright else (x0, x1)
        door = self.draw(st.sampled_from((across[0] + 2, across[1] - DOOR - 2)))
        if upright:
            self.cut(x0, y0, at, y1)
            self.cut(at + WALL, y0, x1, y1)
            self.cells[y0:y1, at : at + WALL] = 100
        else:
            self.cut(x0, y0, x1, at)
            self.cut(x0, at + WALL, x1, y1)
            self.cells[at : at + WALL, x0:x1] = 100
        self._hang(at, door, upright=upright)

    def _hang(self, at: int, door: int, *, upright: bool) -> None:
        """Put a door into a wall, and free the floor before it, where a wall may end."""
        wall, way = slice(at, at + WALL), slice(door, door + DOOR)
        rows, columns = (way, wall) if upright else (wall, way)
        self.cells[rows, columns] = 0
        middle, start, end = (at + WALL / 2) * CELL_M, door * CELL_M, (door + DOOR) * CELL_M
        ends = ((middle, start), (middle, end)) if upright else ((start, middle), (end, middle))
        self.doors.append(ends)
