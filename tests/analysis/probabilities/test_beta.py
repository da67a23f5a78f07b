"""Beta intervals against exact and tabulated values."""

from __future__ import annotations

import pytest

from semmap_log.analysis.probabilities.beta import beta_interval


@pytest.mark.parametrize(
    ("alpha", "beta", "low", "high"),
    [
        (1, 1, 0.05, 0.95),  # uniform
        (2, 1, 0.05**0.5, 0.95**0.5),  # the distribution function is x^2
        (0.5, 0.5, 0.0061558297, 0.9938441703),  # arcsine: sin^2(0.05 pi / 2)
        (90.5, 10.5, 0.84222526, 0.94092417),  # this and below: scipy.stats.beta.ppf
        (10.5, 0.5, 0.82922689, 0.99980826),
        (1e5, 1e4, 0.90766097, 0.9105124),
    ],
)
def test_the_ends_are_the_quantiles(alpha: float, beta: float, low: float, high: float) -> None:
    """A twentieth lies below the lower end, a twentieth above the upper one."""
    found = beta_interval(alpha, beta)

    assert pytest.approx((low, high), abs=1e-6) == found
