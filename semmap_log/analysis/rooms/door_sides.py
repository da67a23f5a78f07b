"""Which rooms lie on a door's two sides.

Seven probes start on the middle 60 % of the door's line and go straight away from it, at most a
metre, to the first cell of a room or of the outside; most of them decide.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.rooms.level_rooms import NO_ROOM, LevelRooms
from semmap_log.analysis.rooms.room_graph import OUTSIDE, RoomId
from semmap_log.core.model.doors import Door

PROBES = np.array([0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8])
"""Where on the line they start, from its middle on: of two equal counts the nearer one decides."""
REACH_M = 1.0
"""How far a probe goes."""
STEPS_A_CELL = 2

LEFT, RIGHT = 1.0, -1.0


def sides_of(rooms: LevelRooms, doors: Sequence[Door]) -> list[tuple[RoomId | None, RoomId | None]]:
    """Return the rooms on the left and on the right of doors; None: no probe found one.

    A door off the plan has none on either side.
    """
    left = _found(rooms, doors, LEFT)
    right = _found(rooms, doors, RIGHT)
    return [(_most(a), _most(b)) for a, b in zip(left, right, strict=True)]


def _found(rooms: LevelRooms, doors: Sequence[Door], side: float) -> NDArray[np.int64]:
    """Return what each door's probes found on a side: (doors, probes)."""
    start_x, start_y, theta, width = (
        np.array([getattr(door, name) for door in doors])[:, None]
        for name in ("x", "y", "theta", "width")
    )
    x = start_x + PROBES * width * np.cos(theta)
    y = start_y + PROBES * width * np.sin(theta)
    found = np.full(x.shape, NO_ROOM, np.int64)
    columns, rows = rooms.cells_at(x, y)
    on_plan = (columns >= 0) & (columns < rooms.geometry.width)
    on_plan &= (rows >= 0) & (rows < rooms.geometry.height)
    step_m = rooms.geometry.resolution / STEPS_A_CELL
    for step in range(int(REACH_M / step_m) + 1):
        seeking = on_plan & (found == NO_ROOM)
        if not seeking.any():
            break
        away = side * step * step_m
        here = rooms.rooms_at(x - away * np.sin(theta), y + away * np.cos(theta))
        found[seeking] = here[seeking]
    return found


def _most(found: NDArray[np.int64]) -> RoomId | None:
    """Return what most probes found; of several the one that comes first."""
    rooms = Counter(room for room in found.tolist() if room >= OUTSIDE)
    return rooms.most_common(1)[0][0] if rooms else None
