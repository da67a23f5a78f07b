"""Moments as people write them, instants as we print them."""

from datetime import datetime, timezone

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import semmap_log as sl
from semmap_log.core.model.moments import (
    Moment,
    both_instants,
    format_local,
    format_short,
    format_utc,
    format_wall,
    parse_duration,
    parse_instant,
    parse_moment,
    parse_range,
    zone,
)
from semmap_log.errors import ClockTimeWarning, MomentError
from tests.conftest import SteadyClock

VIENNA = "Europe/Vienna"
END_NS = parse_instant("2026-03-01T14:00", tz=VIENNA)
ZONES = [
    VIENNA,
    "UTC",
    "America/St_Johns",
    "Asia/Kathmandu",
    "Australia/Lord_Howe",
    "Pacific/Apia",
    "America/New_York",
]


def utc(text: str) -> int:
    return int(datetime.fromisoformat(text).replace(tzinfo=timezone.utc).timestamp()) * 10**9


@pytest.mark.parametrize(
    ("text", "expected_ns"),
    [
        ("2026-03-01", utc("2026-02-28T23:00:00")),
        ("2026-03-01 14:02", utc("2026-03-01T13:02:00")),
        ("2026-03-01T14:02:03", utc("2026-03-01T13:02:03")),
        ("2026-03-01T14:02:03.123456789", utc("2026-03-01T13:02:03") + 123_456_789),
        ("2026-03-01T14:02:03,5", utc("2026-03-01T13:02:03") + 500_000_000),
        ("2026-03-01T14:02Z", utc("2026-03-01T14:02:00")),
        ("2026-03-01T14:02:00+05:30", utc("2026-03-01T08:32:00")),
        ("2026-03-01T14:02:00-0330", utc("2026-03-01T17:32:00")),
        ("2026-03-01T14:02:00+05", utc("2026-03-01T09:02:00")),
        ("@1772373720", utc("2026-03-01T14:02:00")),
        ("@1772373720.000000001", utc("2026-03-01T14:02:00") + 1),
        ("@1772373720000000001", utc("2026-03-01T14:02:00") + 1),
        (1772373720, utc("2026-03-01T14:02:00")),
        (1772373720.25, utc("2026-03-01T14:02:00") + 250_000_000),
        (1772373720000000001, utc("2026-03-01T14:02:00") + 1),
    ],
)
def test_an_instant_is_read_to_the_nanosecond(text, expected_ns):
    """ISO-8601 with and without an offset, seconds and nanoseconds."""
    assert expected_ns == parse_instant(text, tz=VIENNA)


@pytest.mark.parametrize(
    ("text", "same_as"),
    [
        ("now", "2026-03-01T14:00"),
        ("2h ago", "2026-03-01T12:00"),
        ("90 min ago", "2026-03-01T12:30"),
        ("1.5 hours ago", "2026-03-01T12:30"),
        ("3 days ago", "2026-02-26T14:00"),
        ("2 weeks ago", "2026-02-15T14:00"),
        ("yesterday 14:00", "2026-02-28T14:00"),
        ("Yesterday", "2026-02-28"),
        ("today 09:30", "2026-03-01T09:30"),
        ("13:59", "2026-03-01T13:59"),
        ("14:00", "2026-03-01T14:00"),
        ("14:00:01", "2026-02-28T14:00:01"),
        ("Sun 10:00", "2026-03-01T10:00"),
        ("sunday 15:00", "2026-02-22T15:00"),
        ("Tue 10:00", "2026-02-24T10:00"),
        ("Monday", "2026-02-23"),
        (" 2026-03-01 ", "2026-03-01"),
    ],
)
def test_a_moment_counts_from_the_end_of_the_log(text, same_as):
    """Not from the clock on the wall: yesterday is the log's last day but one."""
    assert Moment(ns=parse_instant(same_as, tz=VIENNA)) == parse_moment(
        text, tz=VIENNA, end_ns=lambda: END_NS
    )


def test_a_moment_can_be_an_event():
    """`event:1234` is the state just after that event."""
    assert Moment(event=1234) == parse_moment("event:1234", tz=VIENNA, end_ns=lambda: END_NS)


def in_vienna(text: str) -> Moment:
    return parse_moment(text, tz=VIENNA, end_ns=lambda: END_NS)


def test_a_range_has_two_moments():
    """T1..T2, each in any of the forms."""
    assert (Moment(ns=END_NS - 3600 * 10**9), Moment(event=7)) == parse_range(
        "1h ago..event:7", in_vienna
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nonsense", "Expected a moment such as 2h ago, .* got 'nonsense'"),
        ("2026-13-01", "month must be in 1..12"),
        ("2026-02-30", "'2026-02-30' is not a time: day"),
        ("2026-03-01T24:00", "hour must be in 0..23"),
        ("2026-03-01T14:02+24:00", "expected an offset up to 23:59"),
        ("1969-12-31T00:00Z", "expected a time from 1970 to 2262"),
        ("2263-01-01", "expected a time from 1970 to 2262"),
        ("100 weeks 1 day ago", "Expected a moment"),
        ("9000 weeks ago", "expected a time from 1970 to 2262"),
        ("@1e9", "Expected @ and the seconds or nanoseconds since 1970, got '1e9'"),
        ("@", "Expected @ and the seconds"),
        ("@17724348000", "at most 10 digits, or the nanoseconds, of 18 or 19; got 11 digits."),
        ("@1772434800123", r"got 13 digits \(milliseconds\?\)"),
        ("@17724348001234", r"got 14 digits \(milliseconds\?\)"),
        ("@1772434800123456", r"got 16 digits \(microseconds\?\)"),
        ("@17724348001234567", r"got 17 digits \(microseconds\?\)"),
        ("2025-03-30T02:30", "the clocks of Europe/Vienna skip this hour"),
        ("event:9999999999999999999", "expected an event number up to"),
        ("\u0662\u0660\u0662\u0666-03-01", "Expected a moment"),
    ],
)
def test_what_is_no_moment_is_said(text, message):
    """What was expected and what was got."""
    with pytest.raises(MomentError, match=message):
        parse_moment(text, tz=VIENNA, end_ns=lambda: END_NS)


@pytest.mark.parametrize(
    "value",
    [float("nan"), float("inf"), 10**400, True, None, -1, 1e300, 1772434800123, 1.8e15, 10**16],
)
def test_what_is_no_instant_is_said(value):
    """Numbers out of JSON can be anything."""
    with pytest.raises(MomentError, match=r"Expected|expected"):
        parse_instant(value, tz=VIENNA)


@pytest.mark.parametrize("text", ["today", "now..yesterday", "2026-03-02..2026-03-01"])
def test_what_is_no_range_is_said(text):
    """Two moments, the earlier one first."""
    with pytest.raises(MomentError, match=r"T1\.\.T2"):
        parse_range(text, in_vienna)


def test_in_the_hour_that_comes_twice_the_first_is_taken():
    """02:30 came at +02:00 and, an hour later, at +01:00."""
    first, second = both_instants("2025-10-26T02:30", tz=VIENNA)

    assert utc("2025-10-26T00:30:00") == first == parse_instant("2025-10-26T02:30", tz=VIENNA)
    assert utc("2025-10-26T01:30:00") == second


@pytest.mark.parametrize("name", ["Nowhere/X", "../../etc/passwd", "", "\0", "Europe", "a" * 999])
def test_an_unknown_zone_says_how_to_write_one(name):
    """Names out of files never reach the file system."""
    with pytest.raises(MomentError, match="expected an IANA name such as Europe/Vienna"):
        zone(name)


def test_printing():
    """UTC with all nanoseconds for machines, local with milliseconds at most for people."""
    ns = parse_instant("2026-03-01T14:02:03.0405", tz=VIENNA)

    assert "2026-03-01T13:02:03.040500000Z" == format_utc(ns)
    assert "2026-03-01 14:02:03.040+01:00" == format_local(ns, VIENNA)
    assert "2026-03-01 14:00:00+01:00" == format_local(END_NS, VIENNA)
    assert "2026-03-01T14:02:03.0405+01:00" == format_wall(ns, VIENNA)
    assert "2025-10-26T02:30:00+01:00" == format_wall(utc("2025-10-26T01:30:00"), VIENNA)


@given(ns=st.integers(0, 2**62), tz=st.sampled_from(ZONES))
def test_what_is_printed_reads_as_the_same_instant(ns, tz):
    """Both ways, in zones with odd offsets and odd changes of clocks."""
    assert ns == parse_instant(format_utc(ns), tz=tz)
    assert ns == parse_instant(format_wall(ns, tz), tz=tz)


@pytest.mark.parametrize(
    ("text", "seconds", "minutes"),
    [
        ("2025-10-26T02:29:59.9+02:00", "2025-10-26 02:29:59+02:00", "2025-10-26 02:29+02:00"),
        ("2025-10-26T02:30:00+01:00", "2025-10-26 02:30:00+01:00", "2025-10-26 02:30+01:00"),
        ("2025-10-26T01:59:59+02:00", "2025-10-26 01:59:59", "2025-10-26 01:59"),
        ("2025-10-26T03:00:00+01:00", "2025-10-26 03:00:00", "2025-10-26 03:00"),
        ("2026-03-29T03:00:00+02:00", "2026-03-29 03:00:00", "2026-03-29 03:00"),
    ],
)
def test_a_short_time_has_its_offset_in_the_hour_that_comes_twice(text, seconds, minutes):
    """And only there: tables stay narrow. In spring no time is told twice."""
    ns = parse_instant(text, tz=VIENNA)

    assert (seconds, minutes) == (format_short(ns, VIENNA), format_short(ns, VIENNA, seconds=False))


@given(
    second=st.integers(0, 2**62 // 10**9), later=st.integers(1, 3 * 3600), tz=st.sampled_from(ZONES)
)
@example(second=1_761_438_600, later=3600, tz=VIENNA)
@example(second=1_743_864_300, later=1800, tz="Australia/Lord_Howe")
def test_no_two_seconds_have_the_same_short_time(second, later, tz):
    """Nor is there one that means another instant."""
    ns, later_ns = second * 10**9, (second + later) * 10**9

    assert format_short(ns, tz) != format_short(later_ns, tz)
    assert ns == parse_instant(format_short(ns, tz), tz=tz)


@given(text=st.text(max_size=40))
def test_any_text_is_a_moment_or_an_error(text):
    """Nothing else ever comes out."""
    try:
        moment = parse_moment(text, tz=VIENNA, end_ns=lambda: END_NS)
    except MomentError:
        return

    assert (moment.ns is None) != (moment.event is None)


@pytest.mark.parametrize(
    ("text", "expected_s"),
    [("30m", 1800), ("2h", 7200), ("1.5 d", 129_600), (" 90 S", 90), ("0 min", 0), ("1w", 604_800)],
)
def test_a_length_of_time_is_a_number_and_a_unit(text, expected_s):
    """In the units of `2h ago`."""
    assert expected_s * 10**9 == parse_duration(text)


@pytest.mark.parametrize("text", ["", "2", "h", "-2h", "2h ago", "2 fortnights"])
def test_no_other_text_is_a_length_of_time(text):
    """The error shows how to write one."""
    with pytest.raises(MomentError, match=r"such as 30m, 2h or 1\.5d; got"):
        parse_duration(text)


def test_a_range_reads_its_ends_as_a_log_reads_moments(tmp_path):
    """A clock time is the last one before anything was last said of a door's state."""
    clock = SteadyClock(END_NS)
    with sl.create(tmp_path / "log", tz=VIENNA, clock=clock) as log:
        door = log.add_door()
        log.observe(door, "open")
        clock.now_ns += 3 * 86_400 * 10**9
        log.annotate(door, "note", "new lock")
        with pytest.warns(ClockTimeWarning, match="12:30 is taken as 2026-03-01"):
            single = log.moment("12:30")
        with pytest.warns(ClockTimeWarning):
            ranged = log.span("12:30..now")[0]

    assert single == ranged


@pytest.mark.parametrize("number", [1_772_373_720, 1_772_373_720_000, 1_772_373_720_000_000])
def test_a_number_of_another_unit_is_refused_whichever_moment_it_is(tmp_path, number):
    with sl.create(tmp_path / "log", tz=VIENNA, clock=SteadyClock(END_NS)) as log:
        log.add_door()

    for moment in ({"at": number}, {"known_at": number}):
        with pytest.raises(MomentError, match="seconds; multiply by"):
            sl.read(tmp_path / "log").replay(**moment)
