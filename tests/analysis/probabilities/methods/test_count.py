"""Shares of the known time by hand, and readings that are corrected by what their sensor errs."""

from __future__ import annotations

import pytest

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.methods.count import DoorCount
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.known import evidence, hours_ns

UTC = LocalClock("UTC")


def share(told: DoorEvidence, *hours: float) -> list[float]:
    """Return P(open) as it was known at these hours."""
    times_ns = hours_ns(hours)
    return DoorCount(told, UTC).predict(times_ns, times_ns).p_open.tolist()


def test_it_is_the_share_of_the_known_time() -> None:
    """Closed for 6 hours, open for 3, a gap, open for 1: at each moment what had passed by then."""
    told = evidence([(0.0, 6.0, False), (6.0, 9.0, True), (20.0, 21.0, True)])

    found = share(told, 7.0, 7.5, 9.0, 19.0, 20.5, 21.0, 400.0)

    assert [1 / 7, 1.5 / 7.5, 3 / 9, 3 / 9, 3.5 / 9.5, 0.4, 0.4] == pytest.approx(found)


def test_too_little_is_unknown() -> None:
    """Under three hours it is UNKNOWN, and between one half and what was seen."""
    learnt = DoorCount(evidence([(0.0, 4.0, True)]), UTC)
    times_ns = hours_ns([0.0, 1.0, 2.99, 3.0])

    found = learnt.predict(times_ns, times_ns)

    assert [False, False, False, True] == found.is_known.tolist()
    assert 0.5 == found.p_open[0]
    assert 0.5 < found.p_open[1] < found.p_open[2] < found.p_open[3]
    assert found.high[0] - found.low[0] > 0.9


def test_readings_are_corrected() -> None:
    """Wrong once in ten at a door open a tenth of the time: it reads open 18 times in 100."""
    visits = [(float(hour), hour % 50 < 9) for hour in range(1000)]

    found = share(evidence(visits=visits), 1000.0)

    assert 0.1 == pytest.approx(found[0], abs=1e-6)
