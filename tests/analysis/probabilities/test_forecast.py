"""Intervals around what is forecast."""

from __future__ import annotations

import numpy as np

from semmap_log.analysis.probabilities.forecast import LEAST, MOST, Forecast

KNOWN = np.array([True])


def test_beside_certainty_a_small_variance_is_no_ignorance() -> None:
    """P(open) = .999, give or take .03, does not lie anywhere between 0 and 1."""
    found = Forecast.around(np.array([1.05]), np.array([0.03**2 + 0.0005]), KNOWN)

    assert 0.8 < found.low[0] < 0.9
    assert MOST == found.high[0]


def test_where_nothing_is_known_it_may_lie_anywhere() -> None:
    """One half, give or take one half."""
    found = Forecast.around(np.array([0.5]), np.array([0.25]), ~KNOWN)

    assert (LEAST, MOST) == (found.low[0], found.high[0])
