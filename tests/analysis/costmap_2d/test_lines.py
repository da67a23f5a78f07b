"""The thesis's line, of many doors at once."""

from __future__ import annotations

import itertools
import tracemalloc

import numpy as np
from benchmark.plain_costmap import line as line_of_the_thesis
from hypothesis import given
from hypothesis import strategies as st

from semmap_log.analysis.costmap_2d.costs import draw_lines

CELL = st.integers(-60, 90)


def test_all_directions_are_the_loop_of_the_thesis() -> None:
    """Each of 6,561 lines has the cells of the thesis's figure 4.2, in its order."""
    ends = np.array(list(itertools.product(range(-40, 41), repeat=2)))
    starts = np.full_like(ends, 50)

    drawn = draw_lines(starts, starts + ends, (101, 101))

    for row, (dx, dy) in enumerate(ends.tolist()):
        mine = drawn.line == row
        cells = list(zip(drawn.x[mine].tolist(), drawn.y[mine].tolist(), strict=True))
        assert list(line_of_the_thesis(50, 50, 50 + dx, 50 + dy)) == cells
        assert max(abs(dx), abs(dy)) + 1 == len(cells)


@given(
    st.lists(st.tuples(CELL, CELL, CELL, CELL), max_size=8),
    st.integers(1, 40),
    st.integers(1, 40),
)
def test_only_what_is_on_the_map_is_left(
    lines: list[tuple[int, int, int, int]], width: int, height: int
) -> None:
    """Lines that start, end or run off it keep the cells that are on it, line after line."""
    expected = [
        (row, x, y)
        for row, line in enumerate(lines)
        for x, y in line_of_the_thesis(*line)
        if 0 <= x < width and 0 <= y < height
    ]
    ends = np.array(lines, np.int64).reshape(-1, 4)

    drawn = draw_lines(ends[:, :2], ends[:, 2:], (height, width))

    assert expected == list(
        zip(drawn.line.tolist(), drawn.x.tolist(), drawn.y.tolist(), strict=True)
    )


def test_a_line_across_a_continent_takes_no_room() -> None:
    """Of 200,000,000 cells only those on the map are ever made."""
    starts, ends = np.array([[-(10**8), -(10**8)]]), np.array([[10**8, 10**8]])
    tracemalloc.start()

    drawn = draw_lines(starts, ends, (30, 20))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()

    assert peak < 100_000
    assert list(range(20)) == drawn.x.tolist() == drawn.y.tolist()
