"""Sweeps over runs find the shortest ways of Dijkstra's algorithm, to the bit."""

from __future__ import annotations

from random import Random

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from semmap_log.analysis.rooms.regions import DistanceFields, regions_of
from tests.analysis.rooms.grid_graph import textbook

GRIDS = st.tuples(st.integers(1, 14), st.integers(1, 14)).flatmap(
    lambda shape: arrays(np.bool_, shape, elements=st.booleans(), fill=st.just(True))
)  # fmt: skip


@given(GRIDS, st.randoms(use_true_random=False))
def test_costs_are_those_of_the_textbook(free: NDArray[np.bool_], dice: Random) -> None:
    """From two cells at once, to every cell of their region."""
    regions = regions_of(free)
    for label in range(1, regions.count + 1):
        fields = DistanceFields(regions, label)
        starts = [dice.randrange(fields.size) for _ in range(2)]
        found = fields.from_cells(np.array(starts))
        cells = [divmod(fields.flat_of(index), free.shape[1]) for index in range(fields.size)]

        for column, start in enumerate(starts):
            costs = textbook(free, cells[start])
            assert [costs[cell] for cell in cells] == found[:, column].tolist()


def test_a_cell_is_found_again() -> None:
    """By its number in the field, and in the grid."""
    free = np.random.default_rng(6).random((9, 9)) < 0.8
    fields = DistanceFields(regions_of(free), 1)
    flats = [fields.flat_of(index) for index in range(fields.size)]

    assert flats == sorted(set(flats))
    assert list(range(fields.size)) == fields.index_of(np.array(flats)).tolist()
