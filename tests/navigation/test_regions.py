"""Regions of a grid against a flood fill, cell by cell."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from navigation.regions import regions_of

GRIDS = arrays.arrays(np.bool_, arrays.array_shapes(min_dims=2, max_dims=2, max_side=9))


def flooded(free: np.ndarray, start: tuple[int, int]) -> np.ndarray:
    found, queue = np.zeros(free.shape, np.bool_), [start]
    while queue:
        row, column = queue.pop()
        if found[row, column]:
            continue
        found[row, column] = True
        queue += [
            (row + dy, column + dx)
            for dy in (-1, 0, 1)
            for dx in (-1, 0, 1)
            if 0 <= row + dy < free.shape[0] and 0 <= column + dx < free.shape[1]
            and free[row + dy, column + dx]
        ]  # fmt: skip
    return found


@given(GRIDS)
def test_regions_are_those_of_a_flood_fill(free: np.ndarray) -> None:
    labels = regions_of(free)

    assert ((labels == 0) == ~free).all()
    for start in np.argwhere(free):
        assert ((labels == labels[tuple(start)]) == flooded(free, tuple(start))).all()


@given(st.integers(2, 40))
def test_a_comb_is_one_region(teeth: int) -> None:
    """
    Its teeth hang together at the last row only.
    """
    free = np.zeros((12, 2 * teeth), np.bool_)
    free[:, ::2] = True
    assert regions_of(free).max() > 0
    assert len(np.unique(regions_of(free))) == teeth + 1
    free[-1] = True
    assert len(np.unique(regions_of(free))) == 2


@pytest.mark.parametrize("value", [True, False])
def test_all_and_nothing(value: bool) -> None:
    assert len(np.unique(regions_of(np.full((5, 6), value)))) == 1
