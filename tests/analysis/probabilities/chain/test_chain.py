"""The hidden chain's forward pass against sums over every path that the door could have taken."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from semmap_log.analysis.probabilities.chain.matrix_scan import Steps, filtered, likelihood, weighed


def some_steps(count: int, seed: int) -> tuple[Steps, np.ndarray]:
    """Return steps of two chains, and what is seen at each look."""
    rng = np.random.default_rng(seed)
    return Steps(rng.random((count, 2)), rng.random((count, 2))), rng.normal(0, 2, count)


def by_all_paths(steps: Steps, llr: np.ndarray, chain: int, first: float) -> tuple[float, float]:
    """Return P(open) at the last look by all that was seen, and the log-likelihood of that."""
    sees = 1 / (1 + np.exp(-llr))
    weights = {False: 0.0, True: 0.0}
    for before in (False, True):
        for path in product((False, True), repeat=len(llr)):
            weight, last = first if before else 1 - first, before
            for i, state in enumerate(path):
                p_open = (steps.from_open if last else steps.from_closed)[i, chain]
                weight *= (p_open * sees[i]) if state else ((1 - p_open) * (1 - sees[i]))
                last = state
            weights[last] += weight
    total = sum(weights.values())
    return weights[True] / total, float(np.log(total))


@pytest.mark.parametrize("seed", range(4))
def test_filtering_is_the_mean_over_all_paths(seed: int) -> None:
    """What 2^10 paths say of the last look, of two chains side by side."""
    steps, llr = some_steps(9, seed)
    first = np.array([0.2, 0.7])

    after, before = filtered(steps, llr, first)
    said = np.log(likelihood(steps.predicted(before), llr)).sum(0)

    for chain in (0, 1):
        p_open, total = by_all_paths(steps, llr, chain, first[chain])
        assert p_open == pytest.approx(after[-1, chain], rel=1e-9)
        assert total == pytest.approx(said[chain], rel=1e-9)


def test_filtering_knows_nothing_later() -> None:
    """What is believed at a look does not move when looks come after it."""
    steps, llr = some_steps(300, 1)
    cut = Steps(steps.from_closed[:200], steps.from_open[:200])

    found = filtered(steps, llr, np.full(2, 0.5))[0]

    assert (found[:200] == filtered(cut, llr[:200], np.full(2, 0.5))[0]).all()


def test_a_look_weighs_what_was_believed() -> None:
    """Bayes' rule with a reading that is nine times as likely of an open door."""
    found = weighed(np.array([[0.5, 0.1]]), np.array([np.log(9)]))

    np.testing.assert_allclose(found, [[0.9, 0.5]])
