"""Local clocks against zoneinfo: every zone's hours, those that come twice and those skipped."""

from __future__ import annotations

from datetime import datetime, timedelta, timezone
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semmap_log.core.model.local_clock import DAY_S, HOUR_S, LocalClock
from semmap_log.core.model.moments import parse_instant
from semmap_log.errors import MomentError

ZONES = [
    "Europe/Vienna",
    "America/New_York",
    "Australia/Lord_Howe",  # half an hour of daylight saving time
    "Africa/Casablanca",  # back to winter for Ramadan
    "Asia/Kathmandu",  # +05:45
    "America/Sao_Paulo",  # midnights that were skipped
    "America/St_Johns",  # clocks put back over midnight: a date that comes twice
    "Pacific/Apia",  # a day that was skipped
    "UTC",
]
MONDAY = datetime(1970, 1, 5)
SECOND_NS, HOUR_NS = 10**9, 3600 * 10**9
zones = st.sampled_from(ZONES)
instants = st.integers(0, 70 * 366 * DAY_S * SECOND_NS)


def instant(text: str, tz: str) -> int:
    return parse_instant(text, tz=tz)


def day_of(text: str) -> int:
    return (datetime.fromisoformat(text) - MONDAY).days


def shown(ns: int, tz: str) -> datetime:
    """Return what the zone's clocks show, to the second."""
    utc = datetime.fromtimestamp(ns // SECOND_NS, timezone.utc)
    return utc.astimezone(ZoneInfo(tz)).replace(tzinfo=None)


@settings(deadline=None)
@given(zones, st.lists(instants, min_size=1, max_size=5))
def test_the_clocks_show_what_zoneinfo_says(tz: str, times: list[int]) -> None:
    """Seconds since a Monday's midnight, and hours, whatever times were asked for before."""
    clock = LocalClock(tz)

    for ns in times:
        expected = shown(ns, tz) - MONDAY
        exact_s = expected.total_seconds() + ns % SECOND_NS / SECOND_NS
        assert exact_s == pytest.approx(clock.wall_s(np.array([ns]))[0], rel=0, abs=1e-6)
        assert expected // timedelta(hours=1) == clock.hour_of(np.array([ns]))[0]


@settings(deadline=None)
@given(zones, instants)
def test_a_time_that_is_shown_comes_back_as_the_first_instant_that_shows_it(
    tz: str, ns: int
) -> None:
    """The very instant, or one an hour (a day) earlier that looks the same."""
    clock = LocalClock(tz)
    ns -= ns % SECOND_NS

    (found,) = clock.instants_ns(clock.wall_s(np.array([ns]))).tolist()

    assert shown(ns, tz) == shown(found, tz)
    first = shown(ns, tz).replace(tzinfo=ZoneInfo(tz), fold=0)
    assert first.timestamp() * SECOND_NS == found <= ns


def test_a_time_that_is_skipped_is_the_moment_of_the_skip() -> None:
    """02:30 of the night in spring, and a midnight that did not exist."""
    vienna, sao_paulo = LocalClock("Europe/Vienna"), LocalClock("America/Sao_Paulo")
    half_past_two = np.array([day_of("2026-03-29") * DAY_S + 2.5 * HOUR_S])

    found = vienna.instants_ns(half_past_two)
    midnight = sao_paulo.midnights_ns(np.array([day_of("2018-11-04")]))

    assert [instant("2026-03-29T03:00", "Europe/Vienna")] == found.tolist()
    assert [instant("2018-11-04T01:00", "America/Sao_Paulo")] == midnight.tolist()


def test_the_hour_that_comes_twice_is_first_the_first() -> None:
    """02:30 in autumn is meant in summer time, as everywhere here."""
    clock = LocalClock("Europe/Vienna")

    found = clock.instants_ns(np.array([day_of("2026-10-25") * DAY_S + 2.5 * HOUR_S]))

    assert [instant("2026-10-25T02:30+02:00", "UTC")] == found.tolist()


@pytest.mark.parametrize(
    ("tz", "day", "hours"),
    [
        ("Europe/Vienna", "2026-03-29", 23),
        ("Europe/Vienna", "2026-10-25", 25),
        ("Europe/Vienna", "2026-10-26", 24),
        ("Australia/Lord_Howe", "2026-04-05", 24.5),
        ("Australia/Lord_Howe", "2026-10-04", 23.5),
        ("Africa/Casablanca", "2026-02-15", 25),
        ("Africa/Casablanca", "2026-03-22", 23),
        ("America/Sao_Paulo", "2018-11-04", 23),
        ("Pacific/Apia", "2011-12-30", 0),
        ("Asia/Kathmandu", "1986-01-01", 23.75),
    ],
)
def test_days_last_from_midnight_to_midnight(tz: str, day: str, hours: float) -> None:
    """23 and 25 hours, a half, a quarter, none at all."""
    clock = LocalClock(tz)
    days = np.array([day_of(day), day_of(day) + 1])

    lasts = np.diff(clock.midnights_ns(days)).tolist()
    pieces = clock.hours(24 * int(days[0]), 24 * int(days[1]))

    assert [hours * HOUR_NS] == lasts
    assert hours * HOUR_NS == (pieces.end_ns - pieces.start_ns).sum()


@settings(deadline=None)
@given(zones, st.integers(0, 24 * 25_000), st.integers(1, 24 * 10))
def test_hours_are_pieces_that_show_one_hour_and_leave_nothing_out(
    tz: str, first: int, count: int
) -> None:
    """Each piece shows its hour from its start up to its last second, and not after."""
    clock = LocalClock(tz)

    pieces = clock.hours(first, first + count)

    assert (pieces.hour == clock.hour_of(pieces.start_ns)).all()
    assert (pieces.hour == clock.hour_of(pieces.end_ns - SECOND_NS)).all()
    assert (pieces.start_ns < pieces.end_ns).all()
    assert (pieces.start_ns[1:] >= pieces.end_ns[:-1]).all()
    around_ns = pieces.start_ns.min(initial=2**62) - DAY_S * SECOND_NS, pieces.end_ns.max(initial=0)
    every_ns = np.arange(around_ns[0], around_ns[1] + 2 * DAY_S * SECOND_NS, 900 * SECOND_NS)
    hour = clock.hour_of(every_ns)
    inside = np.searchsorted(pieces.start_ns, every_ns, "right") - 1
    covered = (inside >= 0) & (every_ns < pieces.end_ns[inside])
    assert (covered == ((hour >= first) & (hour < first + count))).all()


def test_a_date_that_comes_twice_is_in_pieces_before_and_after() -> None:
    """St John's put the clocks back at 00:01 to 23:01: a minute of the new day came first."""
    clock = LocalClock("America/St_Johns")
    day = day_of("2009-11-01")

    pieces = clock.hours(24 * day, 24 * day + 1)

    lasts_s = ((pieces.end_ns - pieces.start_ns) // SECOND_NS).tolist()
    assert [60, 3600] == lasts_s
    assert 59 * 60 * SECOND_NS == pieces.start_ns[1] - pieces.end_ns[0]


@pytest.mark.parametrize("tz", ZONES)
def test_no_change_of_the_offset_is_missed(tz: str) -> None:
    """Looked at every half hour for ten years, as zoneinfo has it."""
    clock = LocalClock(tz)
    seconds = np.arange(40 * 365 * DAY_S, 50 * 365 * DAY_S, 1800)

    found = clock.offset_s(seconds)

    zone = ZoneInfo(tz)
    offsets = [datetime.fromtimestamp(s, zone).utcoffset() for s in seconds.tolist()]
    assert [offset.total_seconds() for offset in offsets] == found.tolist()


def test_nothing_asked_is_nothing_answered() -> None:
    """Empty columns go through, before and after others."""
    clock = LocalClock("Europe/Vienna")

    for _ in range(2):
        assert 0 == len(clock.wall_s(np.empty(0, np.int64)))
        assert 0 == len(clock.instants_ns(np.empty(0)))
        clock.wall_s(np.array([10**18]))


def test_an_unknown_zone_is_refused() -> None:
    """With the error of all zones."""
    with pytest.raises(MomentError, match="time zone 'Mars/Olympus'"):
        LocalClock("Mars/Olympus")
