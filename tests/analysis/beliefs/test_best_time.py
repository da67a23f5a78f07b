"""When to go to a door."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.analysis.beliefs.best_times import best_runs, best_time
from semmap_log.core.model.moments import DAY_NS, parse_instant
from tests.analysis.beliefs.patrolled import OPEN_HOURS, ROUNDS, VIENNA, patrolled

HOUR_NS = 3600 * 10**9


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> sl.DoorLog:
    return patrolled(tmp_path_factory.mktemp("best") / "log")


def test_the_next_windows_are_opening_hours(log: sl.DoorLog) -> None:
    """Asked on Sunday evening: within the opening hours of working days, in order of time."""
    found = best_time(log, "front", at="2026-03-22T20:30")

    assert found.is_known
    assert 5 == len(found.next_ones) == len(found.of_the_week)
    assert sorted(w.start_ns for w in found.next_ones) == [w.start_ns for w in found.next_ones]
    for window in (*found.next_ones, *found.of_the_week):
        day, hour = divmod(window.first_hour, 24)
        assert day < 5
        assert hour in OPEN_HOURS
        assert hour + window.hours <= OPEN_HOURS.stop
        assert window.probability > 0.7
        assert window.low <= window.probability <= window.high
        assert window.hours * HOUR_NS == window.end_ns - window.start_ns
        assert 0 < window.start_ns - found.now.known_ns < 7 * DAY_NS


def test_no_window_lies_where_nobody_looked(log: sl.DoorLog) -> None:
    """The door is closed at night, but nobody knows: the best hours for that are seen ones."""
    found = best_time(log, "front", "closed", at="2026-03-22T20:30", most=50)

    seen = [window.first_hour % 24 for window in found.of_the_week]
    assert set(seen) <= set(ROUNDS)
    assert (found.never_seen[:, 0:7]).all()
    assert 1 - found.now.p_open == pytest.approx(found.now.p_closed)
    assert found.of_the_week[0].probability > 0.7


def test_a_window_that_is_under_way_begins_now(log: sl.DoorLog) -> None:
    """On a Friday at 10:20 the first of all windows starts at 10:20."""
    found = best_time(log, "front", at="2026-03-27T10:20", most=168)

    first = found.next_ones[0]
    assert parse_instant("2026-03-27T10:20", tz=VIENNA) == first.start_ns
    assert 4 * 24 + 10 == first.first_hour


def test_summer_time_skips_an_hour(log: sl.DoorLog) -> None:
    """Asked on the Saturday before: Monday's window begins at the local hour that it names."""
    found = best_time(log, "front", at="2026-03-28T21:00")

    first = found.next_ones[0]
    hour = first.first_hour % 24
    assert parse_instant(f"2026-03-30T{hour:02}:00", tz=VIENNA) == first.start_ns


def test_the_wait_is_short_where_the_door_is_in_that_state(log: sl.DoorLog) -> None:
    """
    On a Thursday evening, when the front door was just seen shut, it takes longer until it is open
    than until it is shut, and less than a day; habits alone tell no wait.
    """
    asked = {"door": "front", "at": "2026-03-26T20:30"}

    open_s, shut_s = (best_time(log, state=state, **asked).wait_s for state in ("open", "closed"))
    habits = best_time(log, estimator="schedule", **asked)

    assert open_s is not None
    assert shut_s is not None
    assert 0 <= shut_s < open_s < 24 * 3600
    assert habits.wait_s is None


def test_of_a_door_never_seen_nothing_is_said(log: sl.DoorLog) -> None:
    """No windows, no wait."""
    found = best_time(log, "attic")

    assert not found.is_known
    assert ([], [], None) == (found.of_the_week, found.next_ones, found.wait_s)


def test_runs_are_cells_about_as_good() -> None:
    """Best first, about as good ones in order of time; cells that may not be used cut them."""
    probability = np.array([0.9, 0.91, 0.7, 0.93, 0.93, 0.2, 0.72])
    usable = np.array([True, True, True, True, False, True, True])

    runs = best_runs(probability, usable, most=4)

    assert [slice(0, 2), slice(3, 4), slice(2, 3), slice(6, 7)] == runs


def test_hours_far_below_the_best_are_no_good() -> None:
    """However many runs are asked for: an hour of .2 is not when to go where there is one of .9."""
    runs = best_runs(np.array([0.2, 0.9, 0.6, 0.7]), np.ones(4, bool), most=9)

    assert [slice(1, 2), slice(3, 4)] == runs


def test_where_nothing_may_be_used_there_is_no_run() -> None:
    """Nor more than there are cells."""
    assert [] == best_runs(np.ones(3), np.zeros(3, bool), most=5)
    assert [slice(0, 3)] == best_runs(np.ones(3), np.ones(3, bool), most=5)


def test_of_a_door_that_was_hardly_seen_nothing_is_said_either() -> None:
    """A day in the office is too little for a week: no windows, and no wait, made of nothing."""
    office = Path(__file__).parents[3] / "recordings" / "office"

    found = best_time(sl.read(office), "main_door")

    assert not found.is_known
    assert ([], [], None) == (found.of_the_week, found.next_ones, found.wait_s)
