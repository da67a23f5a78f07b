"""The outline of a room along the edges of its cells: one ring around it, one for each hole."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.rooms.level_rooms import LevelRooms, Point
from semmap_log.analysis.rooms.room_graph import RoomId

Corner = tuple[int, int]
"""(column, row) of the lower left corner of a cell."""
Ring = list[Corner]

RIGHT, UP, LEFT, DOWN = (1, 0), (0, 1), (-1, 0), (0, -1)
TURNED_RIGHT = {RIGHT: DOWN, DOWN: LEFT, LEFT: UP, UP: RIGHT}


def room_outline(rooms: LevelRooms, room_id: RoomId) -> list[list[Point]]:
    """Return a room's rings, metres, closed; the outer one first.

    The outer ring runs counterclockwise, holes clockwise. Only corners are listed, so that a
    straight wall is one line.
    """
    mask, column, row = _cut_out(rooms, room_id)
    grid = rooms.geometry
    rings = sorted(_rings(mask), key=min)
    outer_first = sorted(rings, key=_area, reverse=True)
    return [
        [
            (
                grid.origin_x + (x + column) * grid.resolution,
                grid.origin_y + (y + row) * grid.resolution,
            )
            for x, y in [*ring, ring[0]]
        ]
        for ring in outer_first
    ]


def _cut_out(rooms: LevelRooms, room_id: RoomId) -> tuple[NDArray[np.bool_], int, int]:
    """Return a room's cells in the least rectangle around them, and its first column and row."""
    regions = rooms.regions
    runs = regions.labels == rooms.label_of(room_id)
    width = regions.shape[1]
    row, left = np.divmod(regions.starts[runs], width)
    right = left + regions.ends[runs] - regions.starts[runs]
    low, first = int(row.min()), int(left.min())
    mask = np.zeros((int(row.max()) - low + 1, int(right.max()) - first), np.bool_)
    for r, start, end in zip(*(part.tolist() for part in (row - low, left, right)), strict=True):
        mask[r, start - first : end - first] = True
    return mask, first, low


def _rings(mask: NDArray[np.bool_]) -> list[Ring]:
    """Return the closed lines around cells, which lie to the left of each."""
    onward = _edges(mask)
    rings = []
    while onward:
        start = min(onward)
        way = onward[start][0]
        rings.append(_followed(onward, start, way))
    return rings


def _edges(mask: NDArray[np.bool_]) -> dict[Corner, list[Corner]]:
    """Return for each corner the edges of cells that lead on from it."""
    padded = np.pad(mask, 1)
    inner = padded[1:-1, 1:-1]
    onward: dict[Corner, list[Corner]] = {}
    for beside, way, (dx, dy) in (
        (padded[:-2, 1:-1], RIGHT, (0, 0)),
        (padded[1:-1, 2:], UP, (1, 0)),
        (padded[2:, 1:-1], LEFT, (1, 1)),
        (padded[1:-1, :-2], DOWN, (0, 1)),
    ):
        rows, columns = np.nonzero(inner & ~beside)
        for column, row in zip((columns + dx).tolist(), (rows + dy).tolist(), strict=True):
            onward.setdefault((column, row), []).append(way)
    return onward


def _followed(onward: dict[Corner, list[Corner]], start: Corner, way: Corner) -> Ring:
    """Return the corners of the ring from a place on, and remove its edges.

    Where two cells meet in a corner only, it turns to the right, so that no ring comes to a corner
    twice: what lies between a room's cells is a hole that touches the ring around it.
    """
    ring: Ring = []
    here, before = start, None
    while True:
        ways = onward[here]
        if before is not None:
            right = TURNED_RIGHT[before]
            way = right if right in ways else ways[0]
        ways.remove(way)
        if not ways:
            del onward[here]
        if way != before:
            ring.append(here)
        here, before = (here[0] + way[0], here[1] + way[1]), way
        if here == start:
            break
    return ring


def _area(ring: Ring) -> int:
    """Return twice the area of a ring; negative for a hole."""
    following = [*ring[1:], ring[0]]
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(ring, following, strict=True))
