"""Habits come back by hour and day, drift is followed, and what was never seen is UNKNOWN."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.methods.habits import LEADS_D, lead_of
from semmap_log.analysis.probabilities.methods.schedule import DoorSchedule
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities import known
from tests.analysis.probabilities.known import DOOR, hours_ns

UTC = LocalClock("UTC")


def evidence(
    stretches: Sequence[tuple[float, float, bool]] = (), visits: Sequence[tuple[float, bool]] = ()
) -> DoorEvidence:
    """Return evidence up to where it ends."""
    ends = [end for _, end, _ in stretches] + [time for time, _ in visits]
    return known.evidence(stretches, visits).up_to(int(hours_ns(max(ends, default=0.0))))


def working_hours(weeks: int, *, opens: int = 9, closes: int = 17) -> DoorEvidence:
    """Return a door that is open on working days between these hours, all that is known."""
    stretches, shut_since = [], 0.0
    for day in range(7 * weeks):
        if day % 7 < 5:
            stretches += [
                (shut_since, 24.0 * day + opens, False),
                (24.0 * day + opens, 24.0 * day + closes, True),
            ]
            shut_since = 24.0 * day + closes
    return evidence([*stretches, (shut_since, 24.0 * 7 * weeks, False)])


def at(hours: list[float]) -> np.ndarray:
    return hours_ns(hours)


def test_working_hours_come_back() -> None:
    """After eight weeks: sure that it is open on Tuesday at noon, shut at night and on Sunday."""
    learnt = DoorSchedule(working_hours(8), UTC)
    next_week = 24.0 * 7 * 8
    asked = at([next_week + 24 + 12, next_week + 24 + 3, next_week + 6 * 24 + 12])

    found = learnt.predict(asked, np.full(3, hours_ns(next_week)))

    assert found.p_open[0] > 0.95
    assert found.p_open[1:].max() < 0.05
    assert found.is_known.all()
    assert (found.low <= found.p_open).all()
    assert (found.p_open <= found.high).all()


def test_local_hours_are_the_buildings_through_daylight_saving_time() -> None:
    """A door that opens at 09:00 in Oslo opens at 09:00 after the clocks change, not at 10:00."""
    oslo = LocalClock("Europe/Oslo")
    monday_day = 2356  # 2015-02-23, a Monday; the clocks change on 2015-03-29
    opens, closes = (
        oslo.instants_ns((monday_day + np.arange(42)) * 86400.0 + hour * 3600)
        for hour in (9.0, 17.0)
    )
    times = np.stack([opens, closes], 1).ravel()
    base = evidence()
    told = DoorEvidence(
        DOOR, int(times[-1]), times[:-1], times[1:], np.arange(len(times) - 1) % 2 == 0,
        base.seen_ns, base.llr, base.accuracy_open, base.accuracy_closed, base.reads_open,
        base.is_visit, base.visit,
    )  # fmt: skip
    asked = oslo.instants_ns((monday_day + 42) * 86400.0 + np.array([8.5, 9.5]) * 3600)

    in_oslo = DoorSchedule(told, oslo).p_open(asked, np.full(2, times[-1]))
    in_utc = DoorSchedule(told, UTC).p_open(asked, np.full(2, times[-1]))

    assert in_oslo[0] < 0.3
    assert in_oslo[1] > 0.7
    assert abs(in_utc[1] - in_utc[0]) < abs(in_oslo[1] - in_oslo[0])


def test_a_habit_that_changes_is_followed_within_days() -> None:
    """Open all day for six weeks, then no more: a week later it is expected shut."""
    left = 24.0 * 42
    told = evidence([(0.0, left, True), (left, left + 24 * 10, False)])
    learnt = DoorSchedule(told, UTC)
    noon = left + 24 * np.array([0.0, 7.0]) + 12

    found = learnt.p_open(at(noon.tolist()), at((noon - 12).tolist()))

    assert found[0] > 0.9
    assert found[1] < 0.1


def test_far_ahead_the_long_run_counts() -> None:
    """Three unlike days move tomorrow's forecast more than next season's."""
    year = 24.0 * 364
    told = working_hours(52)
    stretches = list(zip(told.start_ns, told.end_ns, told.is_open, strict=True))
    hours = [((a - hours_ns(0)) / 3.6e12, (b - hours_ns(0)) / 3.6e12, o) for a, b, o in stretches]
    shut = evidence([*hours[:-1], (hours[-1][0], year + 72, False)])
    learnt = DoorSchedule(shut, UTC)
    friday_noon = year + 24 * 4 + 12
    known = np.full(2, hours_ns(year + 72))

    tomorrow, in_a_quarter = learnt.p_open(at([friday_noon, friday_noon + 24 * 91]), known)

    assert in_a_quarter > tomorrow


def test_a_door_that_is_seen_by_day_only_is_unknown_at_night() -> None:
    """Hours that no visit ever fell into are said to be UNKNOWN, however many days were seen."""
    visits = [(24.0 * day + hour, True) for day in range(28) for hour in range(9, 17)]
    learnt = DoorSchedule(evidence(visits=visits), UTC)
    asked = at([24 * 28 + 12.0, 24 * 28 + 3.0])

    found = learnt.predict(asked, np.full(2, hours_ns(24 * 28.0)))

    assert [True, False] == found.is_known.tolist()
    assert found.high[1] - found.low[1] > found.high[0] - found.low[0]


def test_before_the_first_midnight_nothing_is_known() -> None:
    """Of a door of which less than a day is known."""
    learnt = DoorSchedule(evidence([(1.0, 20.0, True)]), UTC)

    found = learnt.predict(at([12.0]), at([12.0]))

    assert not found.is_known[0]
    assert 0.5 == found.p_open[0]
    assert found.low[0] < 0.1
    assert found.high[0] > 0.9


def test_the_lead_is_the_greatest_that_was_scored() -> None:
    """Between two leads the shorter one speaks; beyond all, the longest."""
    found = [int(LEADS_D[lead]) for lead in lead_of(np.array([0, 1, 2, 3, 13, 14, 400]))]

    assert [0, 1, 1, 3, 7, 14, 56] == found


def test_a_schedule_that_nobody_confirmed_for_a_year_is_unknown() -> None:
    """Half a year after eight weeks were seen the habits are known still, later not."""
    learnt = DoorSchedule(working_hours(8), UTC)
    end = 24.0 * 7 * 8
    known = at([end + 24 * 180.0, end + 24 * 400.0])

    found = learnt.predict(known, known)

    assert [True, False] == found.is_known.tolist()
