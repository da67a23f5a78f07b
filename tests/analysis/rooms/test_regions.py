"""Regions by runs are those of a flood fill."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from semmap_log.analysis.rooms import regions
from semmap_log.analysis.rooms.regions import Regions, regions_of
from tests.analysis.rooms.flood import flooded

GRIDS = st.tuples(st.integers(1, 12), st.integers(1, 12)).flatmap(
    lambda shape: arrays(np.bool_, shape, elements=st.booleans())
)


def _labels(found: Regions) -> NDArray[np.int64]:
    return found.label_at(*np.indices(found.shape))


@given(GRIDS)
def test_each_cell_has_the_region_of_a_flood_fill(free: NDArray[np.bool_]) -> None:
    """Numbers, too: by the first cell."""
    found = regions_of(free)

    assert np.array_equal(flooded(free), _labels(found))
    assert np.array_equal(flooded(free), found.label_grid())


@given(GRIDS)
def test_cells_that_share_a_corner_belong_together_if_asked(free: NDArray[np.bool_]) -> None:
    """Never around the end of a row."""
    assert np.array_equal(
        flooded(free, by_corners=True), regions_of(free, by_corners=True).label_grid()
    )


@given(GRIDS)
def test_what_is_told_of_a_region_is_counted_in_its_cells(free: NDArray[np.bool_]) -> None:
    """How many, whether one is at the border, and which they are."""
    labels, found = flooded(free), regions_of(free)
    border = {*labels[0], *labels[-1], *labels[:, 0], *labels[:, -1]} - {0}
    odd = np.arange(found.count + 1) % 2 == 1

    assert [(labels == n).sum() for n in range(1, found.count + 1)] == found.cell_counts()[
        1:
    ].tolist()
    assert sorted(border) == np.flatnonzero(found.at_border()).tolist()
    assert np.array_equal(odd[labels], found.mask(odd))


def test_runs_are_the_same_however_many_rows_are_looked_at_together(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A large plan is looked at in blocks; a region may lie in several."""
    free = np.random.default_rng(2).random((50, 40)) < 0.6
    whole = _labels(regions_of(free))

    monkeypatch.setattr(regions, "BLOCK_CELLS", 90)

    assert np.array_equal(whole, _labels(regions_of(free)))


def test_no_cell_off_the_grid_has_a_region() -> None:
    """Neither left of it, where the row before ends, nor anywhere else."""
    found = regions_of(np.ones((2, 3), np.bool_))

    assert [0, 0, 0, 0, 1] == found.label_at([1, 0, -1, 2, 1], [-1, 3, 0, 0, 2]).tolist()
    assert [0] == regions_of(np.zeros((2, 3), np.bool_)).label_at([0], [0]).tolist()
