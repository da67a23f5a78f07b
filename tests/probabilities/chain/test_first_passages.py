"""How soon a closed door opens: not how often it changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from semmap_log.probabilities.chain.first_passages import Passages, first_passages
from semmap_log.probabilities.local_clock import LocalClock
from tests.probabilities.chains import stretches_of
from tests.probabilities.known import evidence, hours_ns

UTC = LocalClock("UTC")


def passages(
    stretches: list[tuple[float, float, bool]], hours: float, *, until_open: bool = True
) -> Passages:
    known = evidence(stretches).up_to(int(hours_ns(hours)) - 1)
    return first_passages(known, UTC, until_open=until_open)


@pytest.mark.parametrize("until_open", [True, False])
def test_rates_of_a_door_without_hours_come_back(*, until_open: bool) -> None:
    """
    Shut for five hours on average, open for two, over a year.
    """
    stretches = stretches_of(24.0 * 365, 5.0, 2.0, np.random.default_rng(3))

    found = passages(stretches, 24.0 * 365, until_open=until_open)

    assert (1 / 5 if until_open else 1 / 2) == pytest.approx(found.per_h.mean(), rel=0.15)
    assert found.is_seen_between
    assert found.count < 1 / (1 - 0.5 ** (1 / 56)), "days, discounted, however many there were"


def test_a_burst_of_openings_is_one() -> None:
    """
    Each day a quarter past noon the door opens ten times within ten minutes: for one half hour's
    look that is one passage, and who comes at eleven waits for more than an hour.
    """
    stretches, last = [], 0.0
    for day in range(28):
        for minute in range(10):
            opens = 24.0 * day + 12.25 + minute / 60
            stretches += [(last, opens, False), (opens, opens + 1 / 120, True)]
            last = opens + 1 / 120
    found = passages([*stretches, (last, 24.0 * 28, False)], 24.0 * 28)

    assert 1 < found.per_h[:, 12].min()
    assert found.per_h[:, 12].max() < 8
    assert found.per_h[:, 13:].max() < 0.05
    assert 20 < found.count < 28


def test_a_slot_is_an_hour_of_one_weekday() -> None:
    """
    Opened on Wednesdays at ten: nobody passes at that hour of a Thursday.
    """
    stretches, last = [], 0.0
    for week in range(8):
        opens = week * 168 + 58.25
        stretches += [(last, opens, False), (opens, opens + 1, True)]
        last = opens + 1
    found = passages([*stretches, (last, 8.0 * 168, False)], 8.0 * 168)

    assert found.per_h[2, 10] > 1
    assert found.per_h[3, 10] < 0.2


def test_the_interval_narrows_with_what_was_seen() -> None:
    """
    Of one passage, of ten, of a hundred; where visits are too rare there is no bound above.
    """
    of = [Passages(np.ones((7, 24)), count, is_seen_between=True).bounds for count in (1, 10, 100)]

    assert all(least < 1 < most for least, most in of)
    assert of[0][1] / of[0][0] > of[1][1] / of[1][0] > of[2][1] / of[2][0]
    assert np.isinf(replace(Passages(np.ones((7, 24)), 9, is_seen_between=False)).bounds[1])


def test_visits_tell_of_passages_between_them() -> None:
    """
    Seen each half hour without errors that matter: closed by night, open by day.
    """
    visits = [(h / 2, 9 <= h / 2 % 24 < 17) for h in range(2 * 24 * 28)]
    known = evidence(visits=visits)
    known = replace(known, llr=np.sign(known.llr) * 6.0).up_to(int(hours_ns(28 * 24)) - 1)

    found = first_passages(known, UTC, until_open=True)

    assert found.per_h[:, 8].min() > 0.3
    assert found.per_h[:, 20:].max() < 0.05


def test_weekends_have_rates_of_their_own() -> None:
    """
    Opened and shut all day on working days, never on Saturdays and Sundays; a sensor that is right
    nine times of ten: what it misreads there is not taken for openings, as it might be in the week.
    """
    rng = np.random.default_rng(1)
    hours = np.arange(2 * 24 * 42) / 2
    is_open = (
        (hours // 24 % 7 < 5) & (hours % 24 >= 8) & (hours % 24 < 18) & (rng.random(2016) < 0.5)
    )
    reads = is_open == (rng.random(len(hours)) < 0.9)
    known = evidence(visits=list(zip(hours.tolist(), reads.tolist(), strict=True)))

    found = first_passages(known.up_to(int(hours_ns(42 * 24)) - 1), UTC, until_open=True).per_h

    assert found[:5, 9:17].mean() > 0.5
    assert found[5:, 9:17].mean() < 0.13
