"""The hidden chain's passes against sums over every path that the door could have taken."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from semmap_log.probabilities.chain.markov_chain import Nodes, Rates, passage, steps_of

RATES = Rates(np.array([1 / 7200, 1 / 900]), np.array([1 / 3600, 1 / 30_000]))


def some_nodes(count: int, seed: int, second_begins: int | None = None) -> Nodes:
    rng = np.random.default_rng(seed)
    begins = np.arange(count) == 0
    if second_begins is not None:
        begins[second_begins] = True
    gap_s = np.where(begins, 0.0, rng.exponential(3000, count))
    return Nodes(gap_s, rng.normal(0, 2, count), rng.integers(0, 2, count), begins)


def by_all_paths(nodes: Nodes) -> tuple[np.ndarray, float]:
    """Return P(open) at each node by all that was seen, and the log-likelihood of that."""
    steps = steps_of(nodes, RATES)
    sees = 1 / (1 + np.exp(-nodes.llr))
    weights, opened = [], []
    for path in product((0, 1), repeat=len(nodes)):
        weight = 1.0
        for i, state in enumerate(path):
            p_open = (steps.from_open if i and path[i - 1] else steps.from_closed)[i, 0]
            weight *= p_open if state else 1 - p_open
            weight *= sees[i] if state else 1 - sees[i]
        weights.append(weight)
        opened.append(path)
    total = np.array(weights)
    return total @ np.array(opened) / total.sum(), float(np.log(total.sum()))


@pytest.mark.parametrize("second_begins", [None, 4])
@pytest.mark.parametrize("seed", range(4))
def test_smoothing_is_the_mean_over_all_paths(seed: int, second_begins: int | None) -> None:
    """
    Forward and backward passes together say what 2^n paths say, also where a sequence begins anew.
    """
    nodes = some_nodes(9, seed, second_begins)

    found = passage(nodes, RATES)

    expected, likelihood = by_all_paths(nodes)
    np.testing.assert_allclose(found.smoothed, expected, rtol=1e-9)
    assert found.log_likelihood.sum() == pytest.approx(likelihood, rel=1e-9)


def test_filtering_knows_nothing_later() -> None:
    """
    What is believed at a look does not move when looks come after it.
    """
    nodes = some_nodes(300, 1)
    cut = Nodes(nodes.gap_s[:200], nodes.llr[:200], nodes.bin[:200], nodes.begins[:200])

    found = passage(nodes, RATES)

    np.testing.assert_allclose(found.filtered[:200], passage(cut, RATES).filtered, rtol=1e-9)


def test_in_the_long_run_nothing_is_left_of_what_was_seen() -> None:
    """
    After a year without a look the door is as its rates say: stationary.
    """
    year_s = 365 * 86400.0
    nodes = Nodes(
        np.array([0, year_s]), np.array([9.0, 0.0]), np.zeros(2, np.intp), np.array([1, 0]) == 1
    )

    found = passage(nodes, RATES)

    assert RATES.stationary[0] == pytest.approx(found.filtered[1])
