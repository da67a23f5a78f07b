"""How soon a closed door opens: not how often it changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from semmap_log.analysis.probabilities.chain.first_passages import Passages, first_passages
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.chains import stretches_of
from tests.analysis.probabilities.known import evidence, hours_ns

UTC = LocalClock("UTC")


def passages(
    stretches: list[tuple[float, float, bool]], hours: float, *, until_open: bool = True
) -> Passages:
    known = evidence(stretches).up_to(int(hours_ns(hours)) - 1)
    return first_passages(known, UTC, until_open=until_open)


@pytest.mark.parametrize("until_open", [True, False])
def test_rates_of_a_door_without_hours_come_back(*, until_open: bool) -> None:
    """Shut for five hours on average, open for two, over a year."""
    stretches = stretches_of(24.0 * 365, 5.0, 2.0, np.random.default_rng(3))

    found = passages(stretches, 24.0 * 365, until_open=until_open)

    assert (1 / 5 if until_open else 1 / 2) == pytest.approx(found.per_h.mean(), rel=0.15)
    least, most = found.interval(lambda per_h: 1 / per_h.mean())
    assert least < (5 if until_open else 2) < most < 1.5 * least


def test_a_burst_of_openings_is_one() -> None:
    """Ten openings within ten minutes are one passage for one half hour's look."""
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


def test_a_slot_is_an_hour_of_one_weekday() -> None:
    """Opened on Wednesdays at ten: nobody passes at that hour of a Thursday."""
    stretches, last = [], 0.0
    for week in range(8):
        opens = week * 168 + 58.25
        stretches += [(last, opens, False), (opens, opens + 1, True)]
        last = opens + 1
    found = passages([*stretches, (last, 8.0 * 168, False)], 8.0 * 168)

    assert found.per_h[2, 10] > 1
    assert found.per_h[3, 10] < 0.2


def test_the_interval_narrows_with_what_was_seen() -> None:
    """Shut for five hours on average, open for two: of two weeks, of two months, of half a year."""
    stretches = stretches_of(24.0 * 182, 5.0, 2.0, np.random.default_rng(5))

    ratios = []
    for hours in (24.0 * 14, 24.0 * 60, 24.0 * 182):
        told = [(start, min(end, hours), is_open) for start, end, is_open in stretches
                if start < hours]  # fmt: skip
        least, most = passages(told, hours).interval(lambda per_h: 1 / per_h.mean())
        ratios.append(most / least)

    assert ratios[0] > ratios[1] > ratios[2] > 1


def test_the_interval_is_wide_where_days_differ() -> None:
    """Ten openings on one day of ten are as many as one on each, but less certain."""
    each = [(24.0 * day + 12, 24.0 * day + 12.1) for day in range(40)]
    some = [(24.0 * day + hour, 24.0 * day + hour + 0.1) for day in range(4, 40, 10)
            for hour in range(8, 18)]  # fmt: skip

    found = []
    for opened in (each, some):
        shut = [0.0, *[end for _, end in opened]]
        stretches = [
            part
            for closed, (opens, closes) in zip(shut, opened, strict=False)
            for part in ((closed, opens, False), (opens, closes, True))
        ]
        least, most = passages([*stretches, (shut[-1], 960.0, False)], 960.0).interval(
            lambda per_h: 1 / per_h.mean()
        )
        found.append(most / least)

    assert found[1] > 2 * found[0]


def test_visits_tell_of_passages_between_them() -> None:
    """Seen each half hour without errors that matter: closed by night, open by day."""
    visits = [(h / 2, 9 <= h / 2 % 24 < 17) for h in range(2 * 24 * 28)]
    known = evidence(visits=visits)
    known = replace(known, llr=np.sign(known.llr) * 6.0).up_to(int(hours_ns(28 * 24)) - 1)

    found = first_passages(known, UTC, until_open=True)

    assert found.per_h[:, 8].min() > 0.3
    assert found.per_h[:, 20:].max() < 0.05


def test_weekends_have_rates_of_their_own() -> None:
    """Opened and shut all day on working days, never on Saturdays and Sundays."""
    rng = np.random.default_rng(1)
    hours = np.arange(2 * 24 * 42) / 2
    is_open = (
        (hours // 24 % 7 < 5) & (hours % 24 >= 8) & (hours % 24 < 18) & (rng.random(2016) < 0.5)
    )
    reads = is_open == (rng.random(len(hours)) < 0.9)
    known = evidence(visits=list(zip(hours.tolist(), reads.tolist(), strict=True)))

    found = first_passages(known.up_to(int(hours_ns(42 * 24)) - 1), UTC, until_open=True).per_h

    assert found[:5, 9:17].mean() > 0.5
    assert found[5:, 9:17].mean() < 0.05
