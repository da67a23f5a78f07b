"""Shares of the known time by hand, and readings that are corrected by what their sensor errs."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.forecast import MOST
from semmap_log.analysis.probabilities.methods.count import DoorCount
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.known import evidence, hours_ns
from tests.analysis.probabilities.telling import added, known, put, seen

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


def test_changes_do_not_count() -> None:
    """A thousand openings of a minute in a thousand hours: one in sixty, not one in two."""
    pairs = [((h + 0.0, h + 59 / 60, False), (h + 59 / 60, h + 1.0, True)) for h in range(1000)]

    found = share(evidence([stretch for pair in pairs for stretch in pair]), 1000.0)

    assert 1 / 60 == pytest.approx(found[0])


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
    """
    A sensor that errs once in ten at a door open a tenth of the time reads open 18 times in 100.
    """
    visits = [(float(hour), hour % 50 < 9) for hour in range(1000)]

    found = share(evidence(visits=visits), 1000.0)

    assert 0.1 == pytest.approx(found[0], abs=1e-6)


def test_a_sensors_two_accuracies_are_used_apart() -> None:
    """
    One that misses four openings in ten, and invents none: 30 readings of 100 are 50 openings.
    """
    told = [seen("open" if hour % 10 < 3 else "closed", 3600.0 * hour, (0.6, 1.0))
            for hour in range(1000)]  # fmt: skip
    evidence = known(added(at_s=0), *told)

    found = DoorCount(evidence, UTC).predict(*[np.array([evidence.until_ns])] * 2)

    assert 0.5 == pytest.approx(found.p_open[0], abs=1e-6)


def test_readings_that_are_all_open_are_not_more_than_always() -> None:
    """Corrected they would be more than 1: the share is clipped, and so is its interval."""
    told = evidence(visits=[(float(hour), True) for hour in range(30)])
    times_ns = hours_ns([30.0])

    found = DoorCount(told, UTC).predict(times_ns, times_ns)

    assert MOST == found.p_open[0]
    assert found.high[0] == MOST
    assert found.low[0] < MOST


def test_visits_of_one_hour_are_its_mean() -> None:
    """
    Ten readings in the same hour tell no more of the door than that hour: ten hours outweigh them.
    """
    busy = [(i / 60, True) for i in range(10)]
    told = evidence(visits=[*busy, *((float(hour), False) for hour in range(1, 11))])

    found = share(told, 11.0)

    # (1 open hour of 11, corrected: (1/11 - 0.1) / 0.8, below 0.)
    assert 0.001 == found[0]


def test_a_sensor_that_knows_nothing_adds_nothing() -> None:
    """Accuracies of one half: coin tosses count neither as known time nor as open."""
    told = known(
        added(), put("closed", 0.0), put("unknown", 5 * 3600.0),
        *[seen("open", 3600.0 * hour, 0.5) for hour in range(6, 100)],
    )  # fmt: skip

    found = DoorCount(told, UTC).predict(*[np.array([told.until_ns])] * 2)

    assert 0.001 == found.p_open[0]
    assert 5 / 24 == pytest.approx(found.effective_days[0])
