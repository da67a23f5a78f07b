"""Ticks of a time axis: by the building's clocks, whatever these do."""

from __future__ import annotations

from datetime import datetime, timedelta, timezone
from itertools import pairwise
from zoneinfo import ZoneInfo

import pytest

from semmap_log.views.time_axis import Tick, WallClock, time_ticks
from semmap_log.views.zone_times import Span, zone_offsets
from tests.views.time_spans import DAY, Axis, axes

EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)


def ticks_of(axis: Axis, anchor: float = 0.0) -> list[Tick]:
    clock = WallClock(axis.offsets)
    return time_ticks(axis.start_ms, axis.end_ms, clock, letters=axis.letters, short=axis.short,
                      anchor=anchor)  # fmt: skip


def local(ms: int, tz: str) -> datetime:
    """What the clocks show, as zoneinfo knows it."""
    return (EPOCH + timedelta(milliseconds=ms)).astimezone(ZoneInfo(tz))


@pytest.mark.slow
@pytest.mark.parametrize("anchor", [0.0, 0.5])
def test_ticks_are_what_their_labels_say_in_every_zone(anchor: float) -> None:
    """Ascending, on the axis, none covers another, and no two neighbours say the same."""
    zones, again, most_gap = set(), 0, 0.0
    for axis in axes()[int(2 * anchor) :: 2]:
        ticks = ticks_of(axis, anchor)

        assert all(a.at_ms < b.at_ms for a, b in pairwise(ticks)), axis
        assert all(axis.start_ms <= tick.at_ms <= axis.end_ms for tick in ticks), axis
        said = [tick for tick in ticks if tick.label]
        assert all(a.label != b.label for a, b in pairwise(said)), (axis, said)
        for tick in said:
            assert_true(tick, axis.tz)
            again += " " in tick.label and ":" in tick.label
        boxes = [box_of(tick, axis, anchor) for tick in said]
        assert all(b[0] - a[1] >= 0.999 for a, b in pairwise(boxes)), (axis, said)
        assert all(right <= axis.letters + anchor * 15 for _, right in boxes), axis
        assert boxes, axis
        zones.add(axis.tz)
        edges = [0.0, *(box[0] for box in boxes), axis.letters]
        most_gap = max(most_gap, *((b - a) for a, b in pairwise(edges)))
    assert len(zones) > 100
    assert again > 50
    assert most_gap < 100


def box_of(tick: Tick, axis: Axis, anchor: float) -> tuple[float, float]:
    """Where its label begins and ends, in letters."""
    share = (tick.at_ms - axis.start_ms) / (axis.end_ms - axis.start_ms)
    left = share * axis.letters - anchor * len(tick.label)
    return left, left + len(tick.label)


def assert_true(tick: Tick, tz: str) -> None:
    """A time of day is the clocks'; a day, a month, a year begins there, and not before."""
    now = local(tick.at_ms, tz)
    if ":" in tick.label:
        text, _, offset = tick.label.partition(" ")
        shown = text if text.count(":") == 2 else f"{text}:00"
        assert now.strftime("%H:%M:%S") == shown, (tick, now)
        assert not offset or now.strftime("%z") == offset.replace("\N{MINUS SIGN}", "-").replace(
            ":", ""
        )
        return
    assert tick.begins_day
    before = [local(tick.at_ms - ms, tz) for ms in (1, *range(DAY // 48, DAY + 1, DAY // 48))]
    day = f"{now.day} {now:%b}"
    if tick.label == f"{now:%Y}":
        assert all(each.year < now.year for each in before), tick
    elif tick.label in {f"{now:%b %Y}", f"{now:%b}"}:
        assert all((each.year, each.month) < (now.year, now.month) for each in before), tick
    else:
        assert tick.label in {day, f"{now:%a} {day}"}
        assert all(each.date() < now.date() for each in before), tick


@pytest.mark.parametrize(
    ("tz", "start", "hours", "letters", "expected"),
    [
        ("America/New_York", "2026-11-01T04:00", 4, 112,
         "Sun 1 Nov,00:30,01:00,01:30,01:00 \N{MINUS SIGN}05:00,01:30,02:00,02:30"),
        ("America/New_York", "2026-10-30T04:00", 72, 168,
         "Fri 30 Oct,06:00,12:00,18:00,Sat 31 Oct,06:00,12:00,18:00,Sun 1 Nov,06:00,12:00,18:00"),
        ("America/New_York", "2026-03-08T05:00", 4, 112,
         "Sun 8 Mar,00:30,01:00,01:30,03:00,03:30,04:00,04:30"),
        ("Australia/Lord_Howe", "2026-04-04T13:30", 3, 84,
         "00:30,01:00,01:30,01:30 +10:30,02:00,02:30"),
        ("Pacific/Apia", "2011-12-29T10:00", 72, 168,
         "Thu 29 Dec,06:00,12:00,18:00,Sat 31 Dec,06:00,12:00,18:00,Sun 1 Jan,06:00,12:00,18:00"),
        ("Pacific/Apia", "2011-12-28T10:00", 120, 80,
         "Wed 28 Dec,Thu 29 Dec,Sat 31 Dec,Sun 1 Jan,Mon 2 Jan"),
        ("Europe/Vienna", "2026-10-01T00:00", 1000, 80,
         "Mon 5 Oct,Mon 12 Oct,Mon 19 Oct,Mon 26 Oct,Mon 2 Nov"),
        ("America/Havana", "2026-11-01T04:00", 4, 112,
         "Sun 1 Nov,00:30,00:00 \N{MINUS SIGN}05:00,00:30,01:00,01:30,02:00,02:30"),
        ("America/Sao_Paulo", "2018-11-04T02:00", 4, 112,
         "23:00,23:30,Sun 4 Nov,01:30,02:00,02:30,03:00,03:30"),
        ("Africa/Casablanca", "2026-02-15T00:00", 4, 112,
         "01:00,01:30,02:00,02:30,02:00 +00:00,02:30,03:00,03:30"),
    ],
)  # fmt: skip
def test_days_on_which_clocks_are_changed(
    tz: str, start: str, hours: int, letters: int, expected: str
) -> None:
    """What comes twice is told apart; what was left out is not made up."""
    start_ms = int(datetime.fromisoformat(f"{start}+00:00").timestamp() * 1000)
    span = Span(start_ms, start_ms + hours * 3_600_000)

    ticks = time_ticks(span.begin_ms, span.end_ms, WallClock(zone_offsets(span.widened(DAY), tz)),
                       letters=letters)  # fmt: skip

    assert expected == ",".join(tick.label for tick in ticks if tick.label)


def test_the_shortest_axis_has_ticks_of_seconds() -> None:
    """And one of no length at all is no trap."""
    clock = WallClock([(0, 3600)])

    ticks = time_ticks(1500, 7500, clock, letters=100.0)
    none = time_ticks(1500, 1500, clock, letters=100.0)

    assert [f"01:00:0{n}" for n in range(2, 8)] == [tick.label for tick in ticks]
    assert [] == none
