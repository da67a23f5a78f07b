"""What a filter said at a time it says for ever, in whatever order it is asked."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.methods.filter import DoorFilter
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.chains import stretches_of
from tests.analysis.probabilities.known import evidence, hours_ns

UTC = LocalClock("UTC")
DAYS = 60


def a_door(seed: int, *, patrolled: bool = False, days: float = DAYS) -> DoorEvidence:
    """Return a door that is known all through, or looked at each half hour."""
    told = stretches_of(24 * days, 5.0, 2.0, np.random.default_rng(seed))
    until_ns = int(hours_ns(24 * days))
    if not patrolled:
        return evidence(told).up_to(until_ns)
    times = np.arange(0, 24 * days, 0.5)
    is_open = np.searchsorted([end for _, end, _ in told], times, "right") % 2 == 1
    return evidence(visits=list(zip(times.tolist(), is_open.tolist(), strict=True))).up_to(until_ns)


@pytest.mark.parametrize("known_h", [-1000.0, -0.001, 0.0])
def test_before_the_first_sighting_nothing_is_known(known_h: float) -> None:
    """Not even where the door's first state was set at a midnight, at which its evidence begins."""
    learnt = DoorFilter(evidence([(24.0, 90.0, True)]).up_to(int(hours_ns(90))), UTC)
    times_ns = hours_ns([known_h, 24.0, 30.0])

    found = learnt.predict(times_ns, hours_ns(np.full(3, known_h)))

    np.testing.assert_allclose(found.p_open, 0.5)
    assert not found.is_known.any()


@pytest.mark.parametrize("patrolled", [False, True])
def test_a_forecast_of_a_time_knows_nothing_later_than_that(*, patrolled: bool) -> None:
    """Asked with hindsight what was likely then, it says what it said then."""
    learnt = DoorFilter(a_door(7, patrolled=patrolled), UTC)
    times_ns = hours_ns(24 * 31 + np.arange(0, 10, 0.7))

    found = learnt.predict(times_ns, times_ns + int(5 * 3.6e12))

    np.testing.assert_allclose(found.p_open, learnt.predict(times_ns, times_ns).p_open, atol=1e-12)


@pytest.mark.parametrize(
    ("known_d", "near"), [(60.0, 5e-3), (75.0, 1e-6), (103.0, 1e-6), (2000.0, 1e-6)]
)
def test_long_after_the_evidence_ends_it_is_the_schedule(known_d: float, near: float) -> None:
    """Weeks and years after the end of the evidence."""
    learnt = DoorFilter(a_door(2), UTC)
    times_ns = hours_ns([24 * (known_d + 14.0)])

    found = learnt.predict(times_ns, times_ns)

    np.testing.assert_allclose(found.p_open, learnt.schedule.p_open(times_ns, times_ns), atol=near)


@pytest.mark.parametrize("night", ["2026-03-29", "2026-10-25"])
def test_the_night_in_which_the_clocks_change_is_a_night(night: str) -> None:
    """Through the hour that is skipped, or comes twice, a belief fades and never grows."""
    vienna = LocalClock("Europe/Vienna")
    midnight_ns = np.array([np.datetime64(night)], "M8[ns]").astype(np.int64)[0]
    shift_ns = midnight_ns - hours_ns(24.0 * DAYS)
    told = a_door(3)
    moved = evidence([
        ((a - hours_ns(0) + shift_ns) / 3.6e12, (b - hours_ns(0) + shift_ns) / 3.6e12, bool(o))
        for a, b, o in zip(told.start_ns, told.end_ns, told.is_open, strict=True)
    ])  # fmt: skip
    moved = moved.up_to(int(midnight_ns))
    times_ns = midnight_ns + hours_ns(np.arange(0, 6, 0.1)) - hours_ns(0)
    learnt = DoorFilter(moved, vienna)

    found = learnt.predict(times_ns, np.full(len(times_ns), midnight_ns))

    left = np.abs(found.p_open - learnt.schedule.p_open(times_ns, np.full(60, midnight_ns)))
    assert np.isfinite(found.p_open).all()
    assert (found.low <= found.high).all()
    assert left[0] > left[10] > left[59]
