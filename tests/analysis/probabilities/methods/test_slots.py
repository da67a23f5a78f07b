"""A door that opens in one hour of the week only is known to, after some weeks; others are not."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.analysis.beliefs.protocol import Patrol, visited
from semmap_log.analysis.beliefs.trials import StateIntervals
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.methods.schedule import DoorSchedule
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.known import DOOR, HOUR_NS, evidence, hours_ns

UTC = LocalClock("UTC")
WEEK_H = 168
WEDNESDAY_11 = 2 * 24 + 11
SEEDS = range(12)


def slot_door(opens: list[bool]) -> list[tuple[float, float, bool]]:
    """Return stretches of a door that is open on Wednesdays from ten to twelve, some weeks."""
    found, last = [], 0.0
    for week, is_open in enumerate(opens):
        if is_open:
            start = week * WEEK_H + 58.0
            found += [(last, start, False), (start, start + 2, True)]
            last = start + 2
    return [*found, (last, float(len(opens) * WEEK_H), False)]


def random_weeks(weeks: int, p_open: float, seed: int) -> list[bool]:
    return (np.random.default_rng([7, seed]).random(weeks) < p_open).tolist()


def patrolled(stretches: list[tuple[float, float, bool]], seed: int) -> DoorEvidence:
    start, end, is_open = zip(*stretches, strict=True)
    life = StateIntervals(hours_ns(start), hours_ns(end), np.array(is_open))
    return visited({DOOR: life}, Patrol(HOUR_NS // 2, 0.9, seed)).door(DOOR)


def next_week(known: DoorEvidence, weeks: int) -> np.ndarray:
    """Return P(open) in the middle of each hour of the week that comes."""
    now_ns = int(hours_ns(weeks * WEEK_H))
    schedule = DoorSchedule(known.up_to(now_ns - 1), UTC)
    hours = now_ns + np.arange(WEEK_H) * HOUR_NS + HOUR_NS // 2
    return schedule.predict(hours, np.full(WEEK_H, now_ns)).p_open


def test_a_slot_that_is_mostly_open_is_known_after_six_weeks() -> None:
    """Open nine times of ten: the schedule says it, and names that hour as best."""
    found = [next_week(evidence(slot_door(random_weeks(6, 0.9, s))), 6) for s in SEEDS]

    assert np.mean([week[WEDNESDAY_11] for week in found]) > 0.7
    assert all(58 <= week.argmax() < 60 for week in found)


def test_a_slot_is_found_through_the_errors_of_a_sensor() -> None:
    """A patrol each half hour, right nine times of ten; open in 56 of a hundred weeks."""
    found = [next_week(patrolled(slot_door(random_weeks(6, 0.56, s)), s), 6) for s in SEEDS]

    assert np.mean([week[WEDNESDAY_11] for week in found]) > 0.33


def test_once_is_no_slot() -> None:
    """A door that was opened once, for two hours, three weeks ago is not expected to be again."""
    week = next_week(evidence(slot_door([False, False, True, False, False])), 5)

    assert week[WEDNESDAY_11] < 0.1


def test_a_slot_that_ended_is_forgotten() -> None:
    """Ten weeks as ever, then five in which nobody comes."""
    stretches = slot_door([True] * 10 + [False] * 5)

    assert next_week(evidence(stretches), 10)[WEDNESDAY_11] > 0.92
    assert next_week(evidence(stretches), 15)[WEDNESDAY_11] < 0.45


@pytest.mark.parametrize("first_day", [0, 1, 5, 6])
def test_weeks_begin_on_any_day(first_day: int) -> None:
    """A record that begins on another weekday: the slot is where it is."""
    stretches = slot_door([True] * 6)
    begins = 24.0 * first_day
    cut = [(max(a, begins), b, is_open) for a, b, is_open in stretches if b > begins]

    week = next_week(evidence(cut), 6)

    assert 58 <= week.argmax() < 60
    assert week[WEDNESDAY_11] > 0.6
