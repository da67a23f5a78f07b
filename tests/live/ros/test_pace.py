"""When the log's moments are due, by a clock that the test sets."""

from __future__ import annotations

import math

import pytest

from semmap_log.live.ros.player import Pace

SECOND = 10**9
BEGIN = 1_772_400_000 * SECOND


class Wall:
    """A clock that stands still unless it is set."""

    def __init__(self) -> None:
        self.ns = 7 * SECOND

    def __call__(self) -> int:
        return self.ns


@pytest.mark.parametrize("rate", [0.25, 1.0, 3.0, 1e6])
def test_being_late_delays_nothing_that_follows(rate: float) -> None:
    """
    After thousands of messages, each of them taken too late, the last is due to the nanosecond.
    """
    wall = Wall()
    pace = Pace(BEGIN, rate, now_ns=wall)
    begun_ns = wall.ns

    for number in range(5000):
        due_ns = pace.due_ns(BEGIN + number * SECOND)
        assert begun_ns + round(number * SECOND / rate) == due_ns
        wall.ns = due_ns + 12_345_678


def test_the_logs_time_never_runs_back_nor_ahead_of_the_next_message() -> None:
    """Read between messages at odd times, at a rate that rounds; late messages hold it back."""
    wall = Wall()
    pace = Pace(BEGIN, 7777.7, now_ns=wall)
    read = []

    for number in range(1, 500):
        at_ns = BEGIN + number * 333_333_333
        due_ns = pace.due_ns(at_ns)
        for now_ns in (wall.ns, due_ns - 1, due_ns, due_ns + number % 3 * 10_000):
            wall.ns = max(wall.ns, now_ns)
            read.append(pace.log_ns())
            assert read[-1] <= at_ns
        assert at_ns - read[-1] < 7778

    assert sorted(read) == read
    assert len(set(read)) > 900


def test_a_message_that_is_out_is_not_ahead_of_the_logs_time() -> None:
    """
    Though 700 ns of the log, at this rate, are due after 1 ns of the wall's that passes for 600.
    """
    wall = Wall()
    pace = Pace(BEGIN, 600.0, now_ns=wall)

    wall.ns = pace.due_ns(BEGIN + 700)
    pace.due_ns(BEGIN + SECOND)

    assert BEGIN + 700 == pace.log_ns()


def test_long_empty_stretches_are_left_out() -> None:
    """What comes behind one is due with what comes before it; shorter ones are waited for."""
    wall = Wall()
    pace = Pace(BEGIN, 2.0, longest_gap_ns=10 * SECOND, now_ns=wall)
    moments_s = [0, 4, 14, 1000, 1002, 5000, 5010]

    due_s = [(pace.due_ns(BEGIN + at_s * SECOND) - wall.ns) / SECOND for at_s in moments_s]

    assert [0, 2, 7, 7, 8, 8, 13] == due_s


def test_the_logs_time_goes_on_behind_a_stretch_that_was_left_out() -> None:
    """From there, and not from where the wall's clock would have it."""
    wall = Wall()
    pace = Pace(BEGIN, 1.0, longest_gap_ns=10 * SECOND, now_ns=wall)
    pace.due_ns(BEGIN + 1000 * SECOND)
    pace.due_ns(BEGIN + 1008 * SECOND)

    wall.ns += 3 * SECOND

    assert BEGIN + 1003 * SECOND == pace.log_ns()


def test_without_waiting_everything_is_due_at_once() -> None:
    """And the log's time is that of the next message."""
    wall = Wall()
    pace = Pace(BEGIN, math.inf, now_ns=wall)

    due_ns = pace.due_ns(BEGIN + 10**6 * SECOND)

    assert (wall.ns, BEGIN + 10**6 * SECOND) == (due_ns, pace.log_ns())
