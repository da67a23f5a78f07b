"""What covers an area of the floor: its cells, beside a plain loop over each of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from benchmark.plain_costmap import line as line_of_the_thesis
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.analysis.costmap_2d.costs import (
    FREE_SPACE,
    LETHAL,
    NO_INFORMATION,
    DoorLayer,
    DoorLine,
    area_cells,
    drawn,
)
from semmap_log.analysis.costmap_2d.grid import GridGeometry

Point = tuple[float, float]
GRID = GridGeometry(23, 17, 0.25, -1.0, 2.0)

points = st.tuples(st.integers(-12, 35), st.integers(-12, 30)).map(
    lambda quarter: (quarter[0] / 4 + 0.0625, quarter[1] / 4 + 0.0625)
)
"""Never on the middle of a cell, where rounding would decide."""


def cells_by_hand(corners: list[Point]) -> set[tuple[int, int]]:
    """Each cell: is its middle within, or does a side, drawn as the thesis draws doors, hit it?"""
    cells = {
        (x, y)
        for y in range(GRID.height)
        for x in range(GRID.width)
        if is_within((GRID.origin_x + (x + 0.5) / 4, GRID.origin_y + (y + 0.5) / 4), corners)
    }
    ends = [tuple(math.floor((v - o) * 4) for v, o in zip(c, (-1.0, 2.0), strict=True))
            for c in corners]  # fmt: skip
    for start, end in zip(ends, [*ends[1:], ends[0]], strict=True):
        cells |= {
            (x, y)
            for x, y in line_of_the_thesis(*start, *end)
            if 0 <= x < GRID.width and 0 <= y < GRID.height
        }
    return cells


def is_within(point: Point, corners: list[Point]) -> bool:
    """Count the sides that a ray to the right crosses."""
    x, y = point
    crossed = 0
    for (x0, y0), (x1, y1) in zip(corners, [*corners[1:], corners[0]], strict=True):
        if (y0 <= y) != (y1 <= y):
            crossed += x < x0 + (y - y0) / (y1 - y0) * (x1 - x0)
    return crossed % 2 == 1


@given(st.lists(points, min_size=3, max_size=9))
def test_a_polygon_has_the_cells_that_a_loop_finds(corners: list[Point]) -> None:
    """Concave ones, ones that cross themselves, ones partly or wholly off the map."""
    flat = area_cells(GRID, corners)

    assert flat.tolist() == sorted(y * GRID.width + x for x, y in cells_by_hand(corners))


def test_a_ring_has_a_hole() -> None:
    """The even-odd rule: what lies between two sides is not within."""
    outer = [(0.1, 2.6), (4.1, 2.6), (4.1, 5.6), (0.1, 5.6)]
    inner = [(1.1, 3.6), (1.1, 4.6), (3.1, 4.6), (3.1, 3.6)]
    ring = [*outer, outer[0], *inner, inner[0]]

    grid = np.zeros(GRID.shape, np.bool_)
    grid.reshape(-1)[area_cells(GRID, ring)] = True

    assert not grid[8, 12]  # (2.125, 4.125)
    assert grid[4, 12]


@pytest.mark.parametrize("wrong", [math.nan, math.inf, 1e12])
def test_what_has_no_place_draws_nothing(wrong: float) -> None:
    assert not len(area_cells(GRID, [(0.0, 3.0), (1.0, 3.0), (wrong, 4.0)]))


SHAPES = st.one_of(
    st.builds(DoorLine, st.floats(-2, 6), st.floats(0, 8), st.floats(-4, 4), st.floats(0, 3),
              st.sampled_from([LETHAL, FREE_SPACE, NO_INFORMATION])),
    st.builds(lambda corners, cost: DoorLine(*corners[0], 0.0, 0.0, cost, tuple(corners), True),
              st.lists(points, min_size=3, max_size=5), st.sampled_from([LETHAL, 100])),
    st.none(),
)  # fmt: skip


@given(st.lists(st.dictionaries(st.integers(1, 9), SHAPES, max_size=9), max_size=6))
def test_areas_come_and_go_as_lines_do(steps: list[dict[int, DoorLine | None]]) -> None:
    """The layer after any changes is that of what is there: areas on top, the greatest id first."""
    layer, there = DoorLayer(GRID), dict[int, DoorLine]()
    for changes in steps:
        layer.update(changes)
        there |= {number: line for number, line in changes.items() if line}
        for number in [n for n, line in changes.items() if line is None]:
            there.pop(number, None)
        by_hand = np.full(GRID.shape, NO_INFORMATION, np.uint8)
        for number in sorted(there, key=lambda number: (there[number].is_on_floor, number)):
            one = drawn(GRID, {number: there[number]})
            alone = drawn(GRID, {number: DoorLine(*_shape(there[number]))})
            by_hand[alone == 7] = one[alone == 7]

        np.testing.assert_array_equal(by_hand, layer.costs)


def _shape(line: DoorLine) -> tuple[float, float, float, float, int, object]:
    """Return the same at a cost that nothing else has: it tells which cells are its own."""
    return (line.x, line.y, line.theta, line.width, 7, line.outline)
