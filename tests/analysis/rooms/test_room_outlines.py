"""A room's outline has the room's cells inside, and only those."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.analysis.rooms.level_rooms import LevelRooms, Point
from semmap_log.analysis.rooms.regions import regions_of
from semmap_log.analysis.rooms.room_outlines import room_outline

GRIDS = st.tuples(st.integers(1, 8), st.integers(1, 8)).flatmap(
    lambda shape: arrays(np.bool_, shape, elements=st.booleans())
)
CELL_M = 0.5


def _area(ring: list[Point]) -> float:
    pairs = pairwise(ring)
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in pairs) / 2


def _is_inside(ring: list[Point], x: float, y: float) -> bool:
    """Tell it as a textbook does: by the edges that a ray to the right crosses."""
    crossed = [
        x0 for (x0, y0), (x1, y1) in pairwise(ring)
        if x0 == x1 and x0 > x and min(y0, y1) < y < max(y0, y1)
    ]  # fmt: skip
    return len(crossed) % 2 == 1


@given(GRIDS)
def test_a_cell_lies_inside_the_first_ring_and_in_no_other(free: NDArray[np.bool_]) -> None:
    """Rings are closed and come to no corner twice, as GIS programs want them."""
    regions = regions_of(free)
    geometry = GridGeometry(free.shape[1], free.shape[0], CELL_M, -1.0, 3.0)
    rooms = LevelRooms(0, geometry, regions, np.arange(regions.count + 1))
    labels = regions.label_at(*np.indices(free.shape))

    for room in rooms.rooms:
        outer, *holes = room_outline(rooms, room)
        assert all(ring[0] == ring[-1] for ring in (outer, *holes))
        assert all(len(ring) - 1 == len(set(ring)) for ring in (outer, *holes))
        assert _area(outer) > 0 > max((_area(hole) for hole in holes), default=-1)
        for (row, column), label in np.ndenumerate(labels):
            at = geometry.map_to_world(column, row)
            inside = _is_inside(outer, *at) and not any(_is_inside(hole, *at) for hole in holes)
            assert inside == (label == room)


def test_a_hole_may_touch_the_ring_around_it() -> None:
    """Two rings in a corner, not one that crosses itself."""
    free = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 0]], np.bool_)
    rooms = LevelRooms(0, GridGeometry(3, 3, 1.0), regions_of(free), np.array([0, 1]))

    outer, hole = room_outline(rooms, 1)

    assert ({(2.0, 2.0)}, 8.0, -1.0) == (set(outer) & set(hole), _area(outer), _area(hole))


def test_a_straight_wall_is_one_line() -> None:
    """A rectangle has four corners, told from the lower left one on."""
    rooms = LevelRooms(
        0, GridGeometry(4, 3, CELL_M), regions_of(np.ones((3, 4), np.bool_)), np.array([0, 1])
    )

    assert [[(0, 0), (2, 0), (2, 1.5), (0, 1.5), (0, 0)]] == room_outline(rooms, 1)
