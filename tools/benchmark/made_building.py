"""A made-up building for the costmap's cases: rooms, furniture, and a door between neighbours.

The same at each run; a smaller one is the corner of a larger one, room for room, so that a slow
peer can be given a part.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import FREE_SPACE, LETHAL, NO_INFORMATION, DoorLine
from semmap_log.analysis.costmap_2d.grid import GridGeometry

RESOLUTION_M = 0.05
ROOM = (250, 200)
"""Cells from a room's wall to the next one's, along x and y: 12.5 by 10 m."""
WALL, GAP = 3, 18
"""Cells: how thick walls are, how wide the gap for a door is."""
PIECES = 8
"""Of furniture, in each room; one of them stands askew."""
UNSEEN = 7
"""One room in so many is not explored."""
MOST_DOORS = 500
COSTS = (LETHAL, FREE_SPACE, LETHAL, NO_INFORMATION)
"""What doors draw, in turn: closed, open, closed, unknown."""


@dataclass(frozen=True, slots=True)
class Building:
    """A floor plan and its doors."""

    geometry: GridGeometry
    costs: NDArray[np.uint8]
    """What the static layer has: (height, width), row 0 at the lowest y."""
    doors: dict[int, DoorLine]


@cache
def made_building(side: int) -> Building:
    """Return a building on a square map.

    Args:
        side: Cells along each edge of the map, whole rooms: 1000, 4000.
    """
    geometry = GridGeometry.of_map((side, side), RESOLUTION_M, (0.0, 0.0))
    costs = np.zeros(geometry.shape, np.uint8)
    for row in range(side // ROOM[1]):
        for column in range(side // ROOM[0]):
            _furnish(costs, column, row)
    for wall in range(0, side, ROOM[0]):
        costs[:, wall : wall + WALL] = LETHAL
    for wall in range(0, side, ROOM[1]):
        costs[wall : wall + WALL] = LETHAL
    places = list(_doors(side))[:MOST_DOORS]
    doors = {}
    for number, (x, y, along_x) in enumerate(places, start=1):
        columns, rows = (GAP, WALL) if along_x else (WALL, GAP)
        costs[y : y + rows, x : x + columns] = FREE_SPACE
        doors[number] = _line(x, y, along_x=along_x, cost=COSTS[number % len(COSTS)])
    costs.flags.writeable = False
    return Building(geometry, costs, doors)


def _furnish(costs: NDArray[np.uint8], column: int, row: int) -> None:
    """Put boxes, and a board that stands askew, into a room; or leave it unknown."""
    random = np.random.default_rng((column, row))
    x0, y0 = column * ROOM[0], row * ROOM[1]
    if (3 * column + row) % UNSEEN == 0:
        costs[y0 : y0 + ROOM[1], x0 : x0 + ROOM[0]] = NO_INFORMATION
        return
    for _ in range(PIECES - 1):
        x, y = random.integers(25, (ROOM[0] - 65, ROOM[1] - 65))
        wide, high = random.integers(4, 40, size=2)
        costs[y0 + y : y0 + y + high, x0 + x : x0 + x + wide] = LETHAL
    x, y = random.integers(25, (ROOM[0] - 65, ROOM[1] - 65))
    angle, steps = random.uniform(0, np.pi / 2), np.arange(35)
    costs[
        y0 + y + (steps * np.sin(angle)).astype(int), x0 + x + (steps * np.cos(angle)).astype(int)
    ] = LETHAL


def _doors(side: int) -> Iterator[tuple[int, int, bool]]:
    """Yield the gap in the middle of each wall between two rooms: its corner, and its direction."""
    for y in range(0, side, ROOM[1]):
        for x in range(0, side, ROOM[0]):
            if x:
                yield x, y + (ROOM[1] - GAP) // 2, False
            if y:
                yield x + (ROOM[0] - GAP) // 2, y, True


def _line(x: int, y: int, *, along_x: bool, cost: int) -> DoorLine:
    """Return a door that fills a gap, along the middle of its wall."""
    middle = WALL / 2
    across, up = (0.5, middle) if along_x else (middle, 0.5)
    return DoorLine(
        x=(x + across) * RESOLUTION_M,
        y=(y + up) * RESOLUTION_M,
        theta=0.0 if along_x else np.pi / 2,
        width=(GAP - 1) * RESOLUTION_M,
        cost=cost,
    )
