"""How long until a door is open, or closed: what a filter expects, beside what then came."""

from __future__ import annotations

import math

import numpy as np
import pytest

from semmap_log.analysis.probabilities.methods.filter import DoorFilter, Filter, LearntFilter
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.chains import stretches_of
from tests.analysis.probabilities.known import DOOR, evidence, hours_ns

UTC = LocalClock("UTC")
DAYS = 200
CLOSED_H, OPEN_H = 20.0, 12.0


@pytest.fixture(scope="module")
def stretches() -> list[tuple[float, float, bool]]:
    return stretches_of(24.0 * DAYS * 3, CLOSED_H, OPEN_H, np.random.default_rng(8))


@pytest.fixture(scope="module")
def learnt(stretches: list[tuple[float, float, bool]]) -> LearntFilter:
    """Return what was learnt of the whole: rates are those of the days before each moment."""
    told = evidence(stretches).up_to(int(hours_ns(24 * DAYS * 3)))
    return Filter().learn({DOOR: told}, UTC)


@pytest.mark.slow
@pytest.mark.parametrize("until_open", [True, False])
def test_the_wait_is_that_of_the_door(
    stretches: list[tuple[float, float, bool]], learnt: LearntFilter, *, until_open: bool
) -> None:
    """The mean wait is what it came to be, asked at many moments."""
    asked_h = 24 * DAYS + np.arange(0, 24 * DAYS * 1.9, 37.0)
    starts = np.array([start for start, _, _ in stretches])
    ends = np.array([end for _, end, _ in stretches])
    place = np.searchsorted(starts, asked_h, "right") - 1
    waits = np.array([is_open != until_open for _, _, is_open in stretches])[place]
    came_h = (ends[place] - asked_h)[waits].mean()

    found_h = np.mean([
        learnt.wait_s(DOOR, int(at_ns), until_open=until_open) / 3600
        for at_ns in hours_ns(asked_h[waits])
    ])  # fmt: skip

    assert came_h == pytest.approx(found_h, rel=0.15)
    assert (CLOSED_H if until_open else OPEN_H) == pytest.approx(found_h, rel=0.15)


@pytest.mark.parametrize("until_open", [True, False])
def test_a_door_that_is_so_already_is_not_waited_for(*, until_open: bool) -> None:
    """The wait for a state that holds is a thousandth of the other's."""
    told = stretches_of(24.0 * 30 - 1, CLOSED_H, OPEN_H, np.random.default_rng(3))
    now_ns = int(hours_ns(24 * 30))
    held = evidence([*told, (24.0 * 30 - 1, 24.0 * 30, until_open)]).up_to(now_ns)
    learnt = DoorFilter(held, UTC)

    found = learnt.wait_s(now_ns, until_open=until_open)

    assert 0 < found < 0.01 * learnt.wait_s(now_ns, until_open=not until_open)


def test_a_door_that_never_opens_is_waited_for_long() -> None:
    """Shut for half a year: the wait is weeks at least, and a number."""
    now_ns = int(hours_ns(24 * 180))
    learnt = DoorFilter(evidence([(0.0, 24.0 * 180, False)]).up_to(now_ns), UTC)

    until_open = learnt.wait_s(now_ns, until_open=True)

    assert 20 * 86400 < until_open < math.inf
    assert learnt.wait_s(now_ns, until_open=False) < 3600


def test_the_wait_is_longer_in_the_evening_of_a_door_that_is_used_by_day() -> None:
    """Open off and on from 8 to 18: at 9 it opens soon, at 20 not before the morning."""
    stretches: list[tuple[float, float, bool]] = []
    shut = 0.0
    for day in range(42):
        for hour in np.arange(8, 18, 1.0):
            opens = 24 * day + float(hour)
            stretches += [(shut, opens, False), (opens, opens + 0.5, True)]
            shut = opens + 0.5
    learnt = DoorFilter(evidence(stretches).up_to(int(hours_ns(shut))), UTC)

    morning, evening = (
        learnt.wait_s(int(hours_ns(24 * 40 + hour)), until_open=True) / 3600
        for hour in (8.75, 20.0)
    )

    assert morning < 2
    assert evening > 8


@pytest.mark.parametrize("most_s", [60.0, 1000.0, 7 * 3600.0, 90 * 86_400.0])
def test_who_waits_only_so_long_waits_less(learnt: LearntFilter, most_s: float) -> None:
    """Of a steady rate the mean wait m becomes m (1 - e^(-most / m))."""
    at_ns = next(
        int(at)
        for at in hours_ns(24 * DAYS + np.arange(0, 240, 1.0))
        if learnt.predict(DOOR, np.array([at]), np.array([at])).p_open[0] < 0.01
    )

    mean_s = learnt.wait_s(DOOR, at_ns)
    found_s = learnt.wait_s(DOOR, at_ns, most_s=most_s)

    assert found_s == pytest.approx(mean_s * -math.expm1(-most_s / mean_s), rel=0.05)
    assert found_s <= mean_s


def test_of_a_door_that_nobody_told_of_it_is_not_known(learnt: LearntFilter) -> None:
    """No number at all, rather than one that somebody might plan with."""
    found = learnt.wait_s(DoorId(99), int(hours_ns(0)))

    assert math.isnan(found)
