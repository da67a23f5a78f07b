"""A door's typical week."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs.door_beliefs import WeekPattern, typical_weeks
from tests.analysis.beliefs.patrolled import ATTIC, FRONT, OPEN_HOURS, ROUNDS, patrolled
from tests.conftest import SteadyClock


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> sl.DoorLog:
    return patrolled(tmp_path_factory.mktemp("week") / "log")


def test_the_week_is_told_by_local_hours(log: sl.DoorLog) -> None:
    """Monday first: open hours are likely open, others are not."""
    (front,) = typical_weeks(log, doors=[FRONT])

    likely = front.hours.p_open > 0.5
    expected = np.zeros((7, 24), bool)
    expected[:5, list(OPEN_HOURS)] = True
    seen = front.hours.is_known
    np.testing.assert_array_equal(expected[seen], likely[seen])


def test_a_patrol_by_day_knows_no_night(log: sl.DoorLog) -> None:
    """Cells are known where somebody looked, and nowhere else."""
    (front,) = typical_weeks(log, doors=[FRONT])

    expected = np.zeros((7, 24), bool)
    expected[:, list(ROUNDS)] = True
    np.testing.assert_array_equal(expected, front.is_seen)
    np.testing.assert_array_equal(expected, front.hours.is_known)
    np.testing.assert_array_equal(expected[0], front.by_hour().is_known)
    assert front.by_weekday().is_known.all()


def test_a_door_never_seen_is_known_at_no_hour(log: sl.DoorLog) -> None:
    """Its numbers are a guess, and say so."""
    (attic,) = typical_weeks(log, doors=[ATTIC])

    assert not attic.is_known
    assert not attic.hours.is_known.any()
    assert attic.evidence.is_empty


def test_means_are_of_what_is_known() -> None:
    """A column of which only one cell is known has its value; one without any, that of all."""
    p_open = np.array([[0.2, 0.9, 0.4], [0.8, 0.1, 0.6]])
    known = np.array([[True, False, False], [True, True, False]])

    means = WeekPattern(p_open, p_open - 0.1, p_open + 0.1, known).averaged(0)

    np.testing.assert_allclose([0.5, 0.1, 0.5], means.p_open)
    np.testing.assert_allclose([0.4, 0.0, 0.4], means.low, atol=1e-12)
    np.testing.assert_allclose([0.6, 0.2, 0.6], means.high)
    np.testing.assert_array_equal([True, True, False], means.is_known)


DAY_NS = 86_400 * 10**9


def _note(log: sl.DoorLogWriter, clock: SteadyClock) -> None:
    log.annotate(ATTIC, "note", "new lock")


def _other_door(log: sl.DoorLogWriter, clock: SteadyClock) -> None:
    for hour in range(400):
        log.observe(ATTIC, ("open", "closed")[hour % 2], at=clock.now_ns + 3600 * 10**9 * hour)


def _name(log: sl.DoorLogWriter, clock: SteadyClock) -> None:
    log.update_door(FRONT, x=1.0, reason="measured anew")


@pytest.mark.parametrize("later", [_note, _other_door, _name])
@pytest.mark.parametrize("days", [0.4, 40])
@pytest.mark.parametrize("held", [False, True], ids=["seen", "held"])
def test_a_week_rests_on_what_is_said_of_the_door_alone(
    tmp_path: Path, later: Callable[[sl.DoorLogWriter, SteadyClock], None], days: float, held: bool
) -> None:
    """Whatever else is written later, and however late: no digit changes."""
    path = patrolled(tmp_path / "log").path
    clock = SteadyClock(sl.read(path).end_ns())
    if held:
        with sl.append(path, clock=clock) as log:
            log.update_door(FRONT, state="open")
    (before,) = typical_weeks(sl.read(path), doors=[FRONT])
    clock.now_ns += int(days * DAY_NS)
    with sl.append(path, clock=clock) as log:
        later(log, clock)

    (after,) = typical_weeks(sl.read(path), doors=[FRONT])

    for name in ("p_open", "low", "high", "is_known"):
        np.testing.assert_array_equal(getattr(after.hours, name), getattr(before.hours, name))
    assert before.is_known


@pytest.mark.parametrize("first", ["2026-03-02", "2026-10-05"])
def test_the_week_that_comes_may_change_the_clocks(tmp_path: Path, first: str) -> None:
    """Asked on the Saturday before summer, or winter, time begins: nine is nine on all days."""
    log = patrolled(tmp_path / "log", first=first)
    at = {"2026-03-02": "2026-03-28T21:00", "2026-10-05": "2026-10-24T21:00"}[first]

    (front,) = typical_weeks(log, at=at, doors=[FRONT])

    assert (front.hours.p_open[:5, 8] > 0.5).all()
    assert (front.hours.p_open[:5, 18] < 0.5).all()
