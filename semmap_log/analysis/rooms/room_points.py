"""A point in each room that is far from its walls: where a robot may stand, and a name be written.

Rooms are eaten from their walls inward, a cell at a time, by turns with and without the corners,
so that what is left last is about the middle of the widest circle that lies in the room.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.rooms.level_rooms import LevelRooms
from semmap_log.analysis.rooms.room_graph import RoomId
from semmap_log.analysis.rooms.strokes import Point

MOST_CELLS = 100_000
"""Of a larger plan only each second, third … cell is looked at."""
SIDES = ((1, 0), (-1, 0), (0, 1), (0, -1))
CORNERS = ((1, 1), (1, -1), (-1, 1), (-1, -1))

Labels = NDArray[np.int32]
Cells = NDArray[np.intp]


def room_points(rooms: LevelRooms) -> dict[RoomId, Point]:
    """Return a point of each room, metres, frame `map`."""
    grid = rooms.geometry
    stride = max(1, math.ceil(math.sqrt(grid.width * grid.height / MOST_CELLS)))
    rows, columns = np.arange(0, grid.height, stride), np.arange(0, grid.width, stride)
    sampled = rooms.room_of[rooms.regions.label_at(rows[:, None], columns[None, :])]
    found = _deepest(np.maximum(sampled, 0).astype(np.int32))
    cells = {room: (int(rows[r]), int(columns[c])) for room, (r, c) in found.items()}
    chosen = {room: cells.get(room) or _longest_run(rooms, room) for room in rooms.rooms}
    return {room: grid.map_to_world(column, row) for room, (row, column) in chosen.items()}


def _deepest(labels: Labels) -> dict[RoomId, tuple[int, int]]:
    """Return the cell of each label that is eaten last; of several the one nearest their mean."""
    depth = np.zeros(labels.shape, np.int32)
    left = np.pad(labels, 1)
    while left.any():
        depth += left[1:-1, 1:-1] > 0
        left = _eaten(left, SIDES if depth.max() % 2 else (*SIDES, *CORNERS))
    rows, columns = np.nonzero(labels)
    return _last(labels[rows, columns], depth[rows, columns], rows, columns)


def _eaten(labels: Labels, neighbours: tuple[tuple[int, int], ...]) -> Labels:
    """Return the labels without the cells that have a neighbour of another."""
    kept: Labels = labels.copy()
    inner = kept[1:-1, 1:-1]
    height, width = labels.shape
    for up, right in neighbours:
        beside = labels[1 + up : height - 1 + up, 1 + right : width - 1 + right]
        inner[beside != labels[1:-1, 1:-1]] = 0
    return kept


def _last(
    label: Labels, depth: Labels, rows: Cells, columns: Cells
) -> dict[RoomId, tuple[int, int]]:
    """Return the deepest cell of each label; of several the one nearest the label's mean."""
    count = np.bincount(label)
    with np.errstate(invalid="ignore"):
        row = (np.bincount(label, rows) / count)[label]
        column = (np.bincount(label, columns) / count)[label]
    order = np.lexsort((columns, rows, np.hypot(rows - row, columns - column), -depth, label))
    labels, first = np.unique(label[order], return_index=True)
    chosen = order[first]
    return {
        int(room): (int(rows[cell]), int(columns[cell]))
        for room, cell in zip(labels, chosen, strict=True)
    }


def _longest_run(rooms: LevelRooms, room: RoomId) -> tuple[int, int]:
    """Return the middle cell of the longest row of cells of a room that is in no sample."""
    regions = rooms.regions
    runs = np.flatnonzero(regions.labels == rooms.label_of(room))
    longest = runs[np.argmax(regions.ends[runs] - regions.starts[runs])]
    middle = int(regions.starts[longest] + regions.ends[longest]) // 2
    row, column = divmod(middle, regions.shape[1])
    return row, column
