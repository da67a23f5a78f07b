"""Products of matrices in blocks are those of one after another."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.probabilities.chain.matrix_scan import states


@pytest.mark.parametrize("count", [0, 1, 2, 3, 4, 5, 16, 17, 1000])
def test_blocks_give_what_a_loop_gives(count: int) -> None:
    """For any number of matrices of three chains, also where it fills no whole blocks."""
    rng = np.random.default_rng(count)
    matrices = rng.random((2, 2, count, 3)) ** 8  # some nearly singular
    first = np.array([[0.3, 0.5, 1.0], [0.7, 0.5, 0.0]])
    expected = np.empty((2, count, 3))
    for chain in range(3):
        vector = first[:, chain]
        for i in range(count):
            vector = matrices[:, :, i, chain] @ vector
            vector = vector / vector.sum()
            expected[:, i, chain] = vector

    found = states(matrices, first)

    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_products_of_very_many_stay_finite() -> None:
    """A hundred thousand steps that each shrink the weight a thousandfold do not underflow."""
    matrices = np.full((2, 2, 100_000, 1), 1e-3)
    matrices[0, 0] = 2e-3

    found = states(matrices, np.full((2, 1), 0.5))

    np.testing.assert_allclose(found.sum(0), 1.0)
    assert np.isfinite(found).all()


def test_what_follows_changes_no_digit() -> None:
    """What stands at a place is the same bit for bit, however many matrices come behind it."""
    rng = np.random.default_rng(7)
    matrices, first = rng.random((2, 2, 700, 2)) ** 4, np.array([[0.2, 0.9], [0.8, 0.1]])
    whole = states(matrices, first)

    for count in (1, 2, 7, 8, 9, 63, 64, 65, 70, 255, 256, 257, 300, 699):
        np.testing.assert_array_equal(states(matrices[:, :, :count], first), whole[:, :count])
