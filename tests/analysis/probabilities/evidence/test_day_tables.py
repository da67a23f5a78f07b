"""Hours known and hours open, by local day and hour."""

from __future__ import annotations

from datetime import datetime, timedelta
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.analysis.probabilities.evidence.day_tables import DayTables, day_tables
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import LocalClock
from tests.analysis.probabilities.telling import DOOR, added, known, ns_of, put, seen, told_of
from tests.calls import calls_of

HOUR, DAY = 3600, 86_400
UTC = LocalClock("UTC")
MONDAY = datetime(1970, 1, 5)
TELLS = 0.8**2
"""What a visit of a 90 % sensor is worth, as a share of its hour."""


def since(text: str, tz: str) -> float:
    """Return a local time in seconds since the beginning of what is told."""
    return datetime.fromisoformat(text).replace(tzinfo=ZoneInfo(tz)).timestamp() - ns_of(0) / 1e9


def row_of(tables: DayTables, text: str) -> int:
    return (datetime.fromisoformat(text) - MONDAY).days - int(tables.days[0])


def held(*, start: str, end: str, tz: str, state: str = "open") -> DayTables:
    """Return the tables of a door that was in one state between two local times."""
    told = added(), put(state, since(start, tz)), put("unknown", since(end, tz))
    return day_tables(known(*told, until_s=since(end, tz)), LocalClock(tz))


def test_a_stretch_counts_by_its_duration_in_each_hour() -> None:
    """Open from 01:45, closed from 03:30: a quarter of an hour, one hour, half and half."""
    told = added(), put("open", 1.75 * HOUR), put("closed", 3.5 * HOUR), put("unknown", 4 * HOUR)

    tables = day_tables(known(*told), UTC)

    assert (1, 24) == tables.known_h.shape
    assert [0, 0.25, 1, 1, 0] == tables.known_h[0, :5].tolist()
    assert [0, 0.25, 1, 0.5, 0] == tables.open_h[0, :5].tolist()
    assert [row_of(tables, "1997-05-19") + int(tables.days[0])] == tables.days.tolist()


def test_rows_are_local_days_from_the_first_evidence_to_the_time_asked_for() -> None:
    """What is to come of the last day is not known, though the state still holds."""
    tz = "Asia/Kathmandu"
    told = added(), put("open", since("1997-05-20T22:30", tz))

    tables = day_tables(known(*told, until_s=since("1997-05-22T01:15", tz)), LocalClock(tz))

    assert 3 == len(tables)
    assert 0 == row_of(tables, "1997-05-20")
    assert [1.5, 24, 1.25] == tables.known_h.sum(axis=1).tolist()
    assert [0.5, 1] == tables.known_h[0, 22:].tolist()
    assert [1, 0.25, 0] == tables.open_h[2, :3].tolist()


@pytest.mark.parametrize(
    ("tz", "day", "known_h", "day_h"),
    [
        ("Europe/Vienna", "2001-10-28", [1, 1, 2, 1], 25),
        ("America/New_York", "2001-04-01", [1, 1, 0, 1], 23),
        ("Australia/Lord_Howe", "2001-03-25", [1, 1.5, 1, 1], 24.5),
        ("Australia/Lord_Howe", "2001-10-28", [1, 1, 0.5, 1], 23.5),
    ],
)
def test_an_hour_that_comes_twice_or_never_counts_as_often(
    tz: str, day: str, known_h: list[float], day_h: float
) -> None:
    next_day = datetime.fromisoformat(day) + timedelta(days=1)
    tables = held(start=day, end=next_day.isoformat(), tz=tz)

    assert known_h == tables.known_h[0, :4].tolist()
    assert day_h == tables.open_h[0].sum()


BOTH = (0.7, 0.95)
J = 0.7 + 0.95 - 1
VISITS = {
    "a certain one, and two of a 90 % sensor": (
        [seen("open", 0, 1.0), seen("open", HOUR), seen("closed", 2 * HOUR)],
        [1, TELLS, TELLS],
        [1, TELLS * 0.9 / 0.8, TELLS * -0.1 / 0.8],
    ),
    "two accuracies: (reading - (1 - accuracy_closed)) / J": (
        [seen("open", 0, BOTH), seen("closed", HOUR, BOTH)],
        [J**2, J**2],
        [J * 0.95, J * -0.05],
    ),
    "four passes of one hour, one of fifty sightings": (
        [
            seen("closed", 0),
            *(seen("open", 600 + i) for i in range(50)),
            seen("closed", 1800),
            seen("closed", 3000),
        ],
        [TELLS],
        [TELLS * (0.25 - 0.1) / 0.8],
    ),
    "a sensor that tosses a coin, alone and beside another": (
        [seen("open", 0, 0.5), seen("open", HOUR, 0.5), seen("closed", HOUR + 900)],
        [0, TELLS],
        [0, TELLS * -0.1 / 0.8],
    ),
    "the half hour that a state leaves": (
        [put("closed", 0), seen("open", 1800)],
        [1],
        [0.5 * 0.9 / 0.8],
    ),
}


@pytest.mark.parametrize("case", VISITS)
def test_a_visit_counts_as_what_it_tells_of_its_hour(case: str) -> None:
    told, known_h, open_h = VISITS[case]
    tables = day_tables(known(added(), *told, until_s=3 * HOUR - 1), UTC)

    assert known_h == pytest.approx(tables.known_h[0, : len(known_h)])
    assert open_h == pytest.approx(tables.open_h[0, : len(open_h)])


def test_a_pass_over_midnight_does_not_move_the_day_that_ended() -> None:
    """Each day has its part of the visit."""
    told = added(), seen("open", DAY - 20), seen("closed", DAY + 20)

    before = day_tables(known(*told, until_s=DAY), UTC)
    after = day_tables(known(*told, until_s=2 * DAY), UTC)

    assert pytest.approx(TELLS * 0.9 / 0.8) == after.open_h[0, 23]
    assert pytest.approx(TELLS * -0.1 / 0.8) == after.open_h[1, 0]
    assert before.open_h[0].tolist() == after.open_h[0].tolist()


def test_noisy_visits_are_right_on_the_average() -> None:
    """A door open in 30 % of its hours, seen by a poor sensor: no pull toward a half."""
    dice = np.random.default_rng(3)
    hours = 24 * 730
    is_open = dice.random(hours) < 0.3
    reads = np.where(dice.random(hours) < np.where(is_open, 0.8, 0.9), is_open, ~is_open)
    words = np.where(reads, "open", "closed").tolist()
    told = [seen(word, h * HOUR, (0.8, 0.9)) for h, word in enumerate(words)]

    tables = day_tables(known(added(), *told), UTC)

    assert pytest.approx(is_open.mean(), abs=0.02) == tables.open_h.sum() / tables.known_h.sum()
    assert abs(reads.mean() - is_open.mean()) > 0.005


def test_a_door_nobody_saw_has_no_rows() -> None:
    """Nothing is known, and nothing fails."""
    tables = day_tables(DoorEvidence.nothing(DoorId(7), ns_of(0)), UTC)

    assert 0 == len(tables)
    assert (0, 24) == tables.known_h.shape == tables.open_h.shape


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from(["UTC", "Europe/Vienna", "Australia/Lord_Howe", "America/Havana"]),
    st.lists(
        st.tuples(
            st.sampled_from([60, 900, 3600, 5000, 20_000, 90_000, 40 * DAY]),
            st.sampled_from(["open", "closed", "unknown", "see open", "see closed"]),
        ),
        min_size=1,
        max_size=25,
    ),
    st.integers(0, 24),
)
def test_rows_of_days_that_ended_are_the_same_whatever_comes_later(
    tz: str, steps: list[tuple[int, str]], place: int
) -> None:
    """What is known up to a time gives the same rows before its day."""
    seconds = np.cumsum([150 * DAY, *(step for step, _ in steps)])[1:].tolist()
    told = [
        seen(word[4:], s) if word.startswith("see") else put(word, s)
        for s, (_, word) in zip(seconds, steps, strict=True)
    ]
    evidence, clock = told_of(added(), *told), LocalClock(tz)
    until_ns = ns_of(seconds[min(place, len(seconds) - 1)] + 1000)

    some = day_tables(evidence.door(DOOR, until_ns), clock)
    found = evidence.door(DOOR, ns_of(seconds[-1] + 2000))
    every = day_tables(found, clock)

    day = int(clock.hour_of(np.array([until_ns]))[0]) // 24
    assert some.before(day).known_h.tolist() == every.before(day).known_h.tolist()
    assert some.before(day).open_h.tolist() == every.before(day).open_h.tolist()
    assert every.known_h.min(initial=0) >= 0
    midnights = clock.midnights_ns(every.rows.midnights)
    assert (every.known_h.sum(axis=1) * 3600e9 <= np.diff(midnights) + 3600e9 + 1).all()
    if not len(found.seen_ns):
        assert every.known_h.sum() * 3600e9 == pytest.approx((found.end_ns - found.start_ns).sum())


@pytest.mark.slow
def test_three_years_of_thirty_thousand_changes_take_a_moment() -> None:
    """5 ms, once the clock knows the years: as columns, without a loop over changes or days."""
    times = np.sort(np.random.default_rng(1).integers(0, 3 * 365 * DAY, 30_000)).tolist()
    told = [put("open" if i % 2 else "closed", s) for i, s in enumerate(times)]
    found, clock = known(added(), *told), LocalClock("Europe/Oslo")

    tables = day_tables(found, clock)
    calls = calls_of(lambda: day_tables(found, clock))

    assert 3 * 365 == pytest.approx(tables.known_h.sum() / 24, abs=1)
    assert calls.total() < 3 * 365
