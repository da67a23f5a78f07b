"""Scores of forecasts, worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from semmap_log.analysis.probabilities.scores import BINS, Reliability, Scores, mean_scores, scores


def test_without_forecasts_there_are_no_figures() -> None:
    """None, not NaN: nothing was measured."""
    found = scores(np.empty(0), np.empty(0))

    assert Scores(0, None, None, None, None) == found
    assert found == mean_scores([found])
    assert Reliability.of(np.empty(0), np.empty(0)).ece is None


def test_the_mean_is_over_doors_not_over_forecasts() -> None:
    """A door with a hundred forecasts weighs as much as one with a single one."""
    many = scores(np.zeros(100), np.zeros(100))
    one = scores(np.ones(1), np.zeros(1))
    none = scores(np.empty(0), np.empty(0))

    mean = mean_scores([many, one, none])

    assert (101, 0.5, 0.5, 0.5) == (mean.count, mean.brier, mean.ece, mean.bias)


def test_a_diagram_says_what_came_in_each_bin() -> None:
    """(mean p, frequency, count); the last bin holds p = 1, empty bins are left out."""
    found = Reliability.of(np.array([0.11, 0.15, 0.95, 1.0]), np.array([0.0, 1.0, 1.0, 1.0]))

    assert [
        (pytest.approx(0.13), 0.5, 2),
        (pytest.approx(0.975), 1.0, 2),
    ] == found.rows()
    assert BINS == len(found.count)


@given(st.lists(st.tuples(st.floats(0, 1), st.booleans()), max_size=60), st.integers(0, 60))
def test_diagrams_add_up(told: list[tuple[float, bool]], cut: int) -> None:
    """Those of two parts make that of the whole, so that doors can be taken one by one."""
    p = np.array([said for said, _ in told])
    outcome = np.array([came for _, came in told], np.float64)

    parts = Reliability.of(p[:cut], outcome[:cut]) + Reliability.of(p[cut:], outcome[cut:])

    whole = Reliability.of(p, outcome)
    assert whole.count.tolist() == parts.count.tolist()
    assert pytest.approx(whole.said) == parts.said
    assert pytest.approx(whole.came) == parts.came


@given(st.lists(st.tuples(st.floats(0, 1), st.booleans()), min_size=1, max_size=60))
@example([(0.9, True), (0.2, False), (0.6, False)])
@example([(1.0, False)])
@example([(0.5, False), (0.5, True)])
def test_figures_equal_a_plain_loop(told: list[tuple[float, bool]]) -> None:
    """Forecast by forecast and bin by bin, as the definitions are written."""
    found = scores(np.array([p for p, _ in told]), np.array([float(came) for _, came in told]))

    n = len(told)
    bins: dict[int, list[tuple[float, bool]]] = {}
    for p, came in told:
        bins.setdefault(min(int(p * 10), 9), []).append((p, came))
    ece = sum(abs(sum(p for p, _ in b) - sum(came for _, came in b)) for b in bins.values()) / n
    loss = 0.0
    for p, came in told:
        sure = min(max(p, 0.001), 0.999)
        loss -= math.log(sure if came else 1 - sure) / n
    assert pytest.approx(sum((p - came) ** 2 for p, came in told) / n) == found.brier
    assert pytest.approx(loss) == found.log_loss
    assert pytest.approx(ece) == found.ece
    assert pytest.approx(sum(p - came for p, came in told) / n, abs=1e-12) == found.bias
