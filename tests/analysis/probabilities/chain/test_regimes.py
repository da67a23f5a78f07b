"""How doors go on: what each regime keeps of a moment, and where it tends to."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.probabilities.chain import regimes
from tests.analysis.probabilities.known import HOUR_NS

FOLLOWS = np.flatnonzero(~regimes.IS_LEFT)
LEFT_CLOSED, LEFT_OPEN = np.flatnonzero(regimes.IS_LEFT).tolist()


def hours(*each: float) -> np.ndarray:
    return (np.array(each) * HOUR_NS).astype(np.int64)


def ahead(p_open: float, told: float, then: float, gap_h: float, age_h: float) -> np.ndarray:
    """Return P(open) by each regime, of one forecast."""
    now = np.full((1, len(regimes.PRIOR)), p_open)
    one = np.array([told]), np.array([then])
    return regimes.ahead(now, *one, hours(gap_h), hours(age_h))[0]


def test_before_anything_is_known_the_hours_are_likelier_than_to_be_left() -> None:
    """Shares of one; closed and open alike, together a quarter."""
    assert 1 == pytest.approx(regimes.PRIOR.sum())
    assert regimes.PRIOR[LEFT_CLOSED] == regimes.PRIOR[LEFT_OPEN] == pytest.approx(0.125)


def test_what_is_fresh_is_kept_whole() -> None:
    """At once each regime says what was believed, whatever the schedule says."""
    np.testing.assert_allclose(ahead(0.7, 0.2, 0.2, 0.0, 0.0), 0.7)


def test_a_deviation_is_forgotten_at_each_pace() -> None:
    """Of a door that follows its hours; it is added to what these say then."""
    found = ahead(0.9, 0.5, 0.3, 4.0, 4.0)[FOLLOWS]

    np.testing.assert_allclose(found, 0.3 + 0.4 * np.exp(-4.0 / regimes.PACES_H))


def test_a_door_that_is_left_stays_so_for_days() -> None:
    """Two days behind the last look e-fold less than left; after a month its hours speak again."""
    soon, later = (ahead(0.03, 0.5, 0.5, h, h)[LEFT_CLOSED] for h in (48.0, 720.0))

    assert 0.5 - 0.47 / np.e == pytest.approx(soon)
    assert 0.5 == pytest.approx(later, abs=1e-3)
    assert 0.97 == pytest.approx(ahead(0.97, 0.5, 0.5, 9.0, 0.0)[LEFT_OPEN])


def test_nothing_is_surer_than_a_forecast_may_be() -> None:
    """Nor does time go backward."""
    assert ahead(1.0, 0.0, 0.9, 0.0, 0.0).max() <= 0.999
    assert [1.0] * len(regimes.PRIOR) == regimes.kept(hours(-3.0))[0].tolist()
    assert [1.0] == regimes.still_left(hours(-3.0)).tolist()
