"""Metres and cells, as costmap_2d counts them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.analysis.costmap_2d.grid import CellWindow, GridGeometry, merged
from semmap_log.errors import CostmapError

GRID = GridGeometry(20, 10, 0.5, -1.0, 2.0)
"""x -1..9, y 2..7."""


@pytest.mark.parametrize(
    ("point", "cell"),
    [
        ((-1.0, 2.0), (0, 0)),
        ((-1.0000001, 2.0), None),
        ((8.9999, 6.9999), (19, 9)),
        ((9.0, 3.0), None),
        ((3.0, 7.0), None),
        ((math.nan, 3.0), None),
        ((math.inf, 3.0), None),
        ((-0.75, 2.75), (0, 1)),
    ],
)
def test_the_cell_of_a_point(point: tuple[float, float], cell: tuple[int, int] | None) -> None:
    """Lower edges belong to the map, upper ones do not."""
    assert cell == GRID.world_to_map(*point)


def test_the_centre_of_a_cell() -> None:
    """Its own cell again."""
    assert (-0.75, 2.25) == GRID.map_to_world(0, 0)
    assert (19, 9) == GRID.world_to_map(*GRID.map_to_world(19, 9))


def test_bounds_are_taken_onto_the_map() -> None:
    """As LayeredCostmap::updateMap does: the last cell, and one on the edge, are in the window."""
    assert CellWindow(0, 0, 20, 10) == GRID.window_of(-1e30, -1e30, 1e30, 1e30)
    assert CellWindow(2, 0, 4, 2) == GRID.window_of(0.0, 2.0, 0.9, 2.5)
    assert 0 == GRID.window_of(1e30, 1e30, -1e30, -1e30).area
    with pytest.raises(CostmapError, match="expected metres, got nan"):
        GRID.enforced(math.nan, 0.0)


def test_a_map_gives_its_resolution_in_single_precision() -> None:
    """As nav_msgs/MapMetaData does."""
    geometry = GridGeometry.of_map((3, 4), 0.05, (1.0, 2.0))

    assert 0.05000000074505806 == geometry.resolution
    assert ((3, 4), 4, 3) == (geometry.shape, geometry.width, geometry.height)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ((0, 5, 0.1), "expected 1 x 1 up to"),
        ((5, -1, 0.1), "expected 1 x 1 up to"),
        ((2**16, 2**16, 0.1), "expected 1 x 1 up to"),
        ((5, 5, 0.0), "expected metres a cell, above 0, got 0.0"),
        ((5, 5, -0.1), "got -0.1"),
        ((5, 5, math.nan), "got nan"),
        ((5, 5, 0.1, math.inf), "expected finite metres"),
    ],
)
def test_what_is_no_grid(values: tuple[int, int, float], said: str) -> None:
    """It says what was expected."""
    with pytest.raises(CostmapError, match=said):
        GridGeometry(*values)


RECTANGLE = st.tuples(*[st.integers(0, 12)] * 4).map(
    lambda v: CellWindow(v[0], v[1], v[0] + v[2], v[1] + v[3])
)


@given(st.lists(RECTANGLE, max_size=8))
def test_merged_windows_hold_the_same_and_do_not_overlap(windows: list[CellWindow]) -> None:
    """Every cell of the ones given is in exactly one of them."""

    def holds(window: CellWindow, x: int, y: int) -> bool:
        return window.x0 <= x < window.xn and window.y0 <= y < window.yn

    found = merged(windows)

    for x in range(25):
        for y in range(25):
            times = sum(holds(window, x, y) for window in found)
            assert times <= 1
            if any(holds(window, x, y) for window in windows):
                assert 1 == times
