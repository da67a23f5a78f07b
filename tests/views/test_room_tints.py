"""Rooms in tints: beside each other in different ones, and nothing where no room is."""

from __future__ import annotations

import numpy as np
from hypothesis import given

from semmap_log.analysis.rooms import plan_of
from semmap_log.views.palette import ROOM_TINTS, room_tints, rooms_image, sampled
from tests.analysis.rooms.buildings import Building, buildings


@given(buildings())
def test_rooms_beside_each_other_have_different_tints(building: Building) -> None:
    """Across each door at least, whose wall is thin."""
    plan = plan_of(building.door_map, {0: building.floor})

    tints = room_tints(sampled(plan.levels[0], 10**6))

    assert set(tints) == set(plan.graph.rooms)
    for doorway in plan.graph.doorways.values():
        assert tints[doorway.left] != tints[doorway.right]  # type: ignore[index]


@given(buildings())
def test_the_picture_shows_each_cell_in_its_rooms_tint(building: Building) -> None:
    """A room's point has its tint; the yard around the building has none."""
    plan = plan_of(building.door_map, {0: building.floor})
    rooms = plan.levels[0]
    fine, coarse = rooms_image(rooms, alpha=99), rooms_image(rooms, alpha=99, most_cells=900)

    assert (0, 0, 0, 0) == tuple(fine[0, 0])
    assert fine.shape[:2] == rooms.geometry.shape
    assert coarse.shape[0] * coarse.shape[1] <= 1000
    tints = room_tints(sampled(rooms, 10**6))
    for room in plan.graph.rooms.values():
        row, column = int(room.y / 0.1), int(room.x / 0.1)
        assert (*ROOM_TINTS[tints[room.room_id]], 99) == tuple(fine[row, column])


def test_without_rooms_nothing_is_tinted() -> None:
    assert {} == room_tints(np.zeros((4, 4), np.int64))
