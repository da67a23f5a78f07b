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
    """Of a door that is shut it takes longer until it is open; habits alone tell no wait."""
    asked = {"door": "front", "at": "2026-03-26T20:30"}

    open_s, shut_s = (best_time(log, state=state, **asked).wait_s for state in ("open", "closed"))
    habits = best_time(log, estimator="schedule", **asked)

    assert open_s is not None
    assert shut_s is not None
    assert 0 <= shut_s < open_s < 24 * 3600
    assert habits.wait_s is None


def test_of_a_door_that_was_hardly_seen_there_are_no_windows(log: sl.DoorLog) -> None:
    """Never, or for a single day."""
    office = sl.read(Path(__file__).parents[3] / "recordings" / "office")
    for found in (best_time(log, "attic"), best_time(office, "main_door")):
        assert not found.is_known
        assert ([], [], None) == (found.of_the_week, found.next_ones, found.wait_s)


@pytest.mark.parametrize(
    ("probability", "usable", "expected"),
    [
        (
            [0.9, 0.91, 0.7, 0.93, 0.93, 0.2, 0.72],
            [1, 1, 1, 1, 0, 1, 1],
            [(0, 2), (3, 4), (2, 3), (6, 7)],
        ),
        ([0.2, 0.9, 0.6, 0.7], [1, 1, 1, 1], [(1, 2), (3, 4)]),
        ([1.0, 1.0, 1.0], [0, 0, 0], []),
        ([1.0, 1.0, 1.0], [1, 1, 1], [(0, 3)]),
    ],
)
def test_runs_are_cells_about_as_good(
    probability: list[float], usable: list[int], expected: list[tuple[int, int]]
) -> None:
    """Best first; cells that may not be used cut them, those far below the best are left out."""
    runs = best_runs(np.array(probability), np.array(usable, bool), most=4)

    assert expected == [(run.start, run.stop) for run in runs]
