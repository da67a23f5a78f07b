"""Which tint each room of a level is drawn in: rooms beside each other get different ones."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.rooms import RoomId
from semmap_log.analysis.rooms.level_rooms import LevelRooms
from semmap_log.views.palette import ROOM_TINTS

BESIDE_CELLS = 9
"""Rooms so near to each other are beside each other: a wall lies between."""
MOST_CELLS = 4_000_000

Image = NDArray[np.uint8]


def rooms_image(rooms: LevelRooms, *, alpha: int = 255, most_cells: int = MOST_CELLS) -> Image:
    """Return the rooms in their tints: (rows, columns, RGBA), row 0 at the lowest y.

    What is no room is left out. Of a plan with more cells each second, third … is drawn: it covers
    the same area.

    Args:
        rooms: A level's.
        alpha: How much a tint covers, 0..255.
        most_cells: How large the picture may be.
    """
    labels = sampled(rooms, most_cells)
    tint_of = room_tints(labels)
    colours = np.zeros((int(labels.max(initial=0)) + 1, 4), np.uint8)
    for room, tint in tint_of.items():
        colours[room] = (*ROOM_TINTS[tint], alpha)
    image: Image = colours[labels]
    return image


def sampled(rooms: LevelRooms, most_cells: int) -> NDArray[np.int64]:
    """Return the room of each cell, or of each second …: (rows, columns); 0: none."""
    grid = rooms.geometry
    stride = max(1, math.ceil(math.sqrt(grid.width * grid.height / most_cells)))
    rows = np.arange(stride // 2, grid.height, stride)
    columns = np.arange(stride // 2, grid.width, stride)
    found = rooms.room_of[rooms.regions.label_at(rows[:, None], columns[None, :])]
    return np.maximum(found, 0)


def room_tints(labels: NDArray[np.int64]) -> dict[RoomId, int]:
    """Return the number of each room's tint, for a picture of rooms."""
    beside = _beside(labels)
    tints: dict[RoomId, int] = {}
    for room in sorted(beside):
        taken = {tints[other] for other in beside[room] if other in tints}
        free = [tint for tint in range(len(ROOM_TINTS)) if tint not in taken]
        tints[room] = free[room % len(free)] if free else room % len(ROOM_TINTS)
    return tints


def _beside(labels: NDArray[np.int64]) -> dict[RoomId, set[RoomId]]:
    """Return the rooms beside each room: a few cells away along a row or a column."""
    found: dict[RoomId, set[RoomId]] = {int(room): set() for room in np.unique(labels) if room}
    for gap in range(1, BESIDE_CELLS + 1):
        for one, other in ((labels[gap:], labels[:-gap]), (labels[:, gap:], labels[:, :-gap])):
            differ = (one != other) & (one > 0) & (other > 0)
            pairs = np.unique(np.stack([one[differ], other[differ]]), axis=1)
            for a, b in pairs.T.tolist():
                found[a].add(b)
                found[b].add(a)
    return found
