"""A door's timeline for people."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from semmap_log.core.folds.timeline import Hold, Timeline
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.moments import duration
from semmap_log.views.timeline_table import (
    PAGE_ROWS,
    hold_text,
    timeline_pages,
    timeline_totals,
)
from tests.views.test_tables import printed

SECOND = 10**9
MINUTE, HOUR, DAY = 60 * SECOND, 3600 * SECOND, 24 * 3600 * SECOND
START = 1_772_400_000 * SECOND


def lasting(*lengths: tuple[int, DoorState], removed: bool = False) -> Timeline:
    """Return a timeline of these lengths and states, which begins at `START`."""
    ends = START + np.cumsum([ns for ns, _ in lengths])
    return Timeline(
        DoorId(1),
        start_ns=np.append(START, ends)[:-1],
        end_ns=ends,
        state=np.array([state for _, state in lengths], np.uint8),
        event=np.arange(len(lengths)) * 1000,
        sightings=np.arange(len(lengths)) + 1,
        removed=removed,
    )


def test_a_row_an_interval_and_the_shares_below() -> None:
    """In the log's zone; shares are of the time in which a sighting held."""
    timeline = lasting(
        (25 * MINUTE, DoorState.UNKNOWN),
        (9 * HOUR, DoorState.OPEN),
        (DAY - 9 * HOUR, DoorState.CLOSED),
    )
    timeline = replace(
        timeline,
        lapse_start_ns=timeline.end_ns[-1:] - 15 * HOUR // 2,
        lapse_end_ns=timeline.end_ns[-1:],
        hold=Hold(gaps=3, gap_ns=30 * MINUTE, looks=40),
    )

    text = printed(
        *timeline_pages(timeline, tz="Europe/Vienna"), timeline_totals(timeline, tz="Europe/Vienna")
    )

    assert (
        """\
since               until                    lasted state    seen   event unseen
2026-03-01 22:20:00 2026-03-01 22:45:00      25 min UNKNOWN     1       0
2026-03-01 22:45:00 2026-03-02 07:45:00         9 h OPEN        2    1000
2026-03-02 07:45:00 2026-03-02 22:45:00        15 h CLOSED      3    2000    50%
open 54.5%, closed 45.5% of the 16 h 30 min in which that was known (67.6%)
not seen for 7 h 30 min (30.7%), not since 2026-03-02 15:15:00+01:00
a sighting holds for 1 h 30 min (3 median gaps between looks)
up to 2026-03-02 22:45:00+01:00 (Europe/Vienna)"""
        == text
    )


def test_a_removed_door_and_one_that_nobody_saw() -> None:
    """Said in words; nothing is divided by nothing."""
    unseen = lasting((HOUR, DoorState.UNKNOWN), removed=True)

    text = printed(timeline_totals(unseen, tz="UTC"))

    assert "never known to be open or closed" in text
    assert "removed at 2026-03-01 22:20:00+00:00 (UTC)" in text


def test_pages_of_a_long_timeline_line_up() -> None:
    """The head stands once, and no row is lost."""
    states = (DoorState.OPEN, DoorState.OFFLINE)
    timeline = lasting(*((23 * HOUR + 59 * MINUTE, states[i % 2]) for i in range(PAGE_ROWS + 20)))

    lines = printed(*timeline_pages(timeline, tz="UTC")).splitlines()

    assert 1 + PAGE_ROWS + 20 == len(lines)
    assert ["23 h 59 min"] * (PAGE_ROWS + 20) == [line[40:51] for line in lines[1:]]
    assert all(one[20:39] == other[:19] for one, other in pairwise(lines[1:]))


@pytest.mark.parametrize(
    ("ns", "expected"),
    [
        (0, "0 s"),
        (250_000_000, "0.250 s"),
        (9 * SECOND, "9 s"),
        (45 * SECOND + 7, "45 s"),
        (MINUTE, "1 min"),
        (61 * SECOND, "1 min 1 s"),
        (HOUR + 30 * SECOND, "1 h"),
        (26 * HOUR, "1 d 2 h"),
        (400 * DAY, "400 d"),
    ],
)
def test_a_length_of_time_in_its_largest_unit_and_the_next(ns: int, expected: str) -> None:
    """Short ones to the millisecond."""
    assert expected == duration(ns)


def test_the_hour_that_comes_twice_is_told_apart() -> None:
    """By the offset, in a line of its own: the columns stay as narrow as ever."""
    timeline = replace(
        lasting((HOUR, DoorState.OPEN), (30 * MINUTE, DoorState.CLOSED)),
        start_ns=np.array([1_761_438_600, 1_761_442_200]) * SECOND,
        end_ns=np.array([1_761_442_200, 1_761_444_000]) * SECOND,
    )

    text = printed(*timeline_pages(timeline, tz="Europe/Vienna"))

    assert (
        """\
since               until                    lasted state    seen   event unseen
2025-10-26 02:30:00 2025-10-26 02:30:00         1 h OPEN        1       0
+02:00              +01:00
2025-10-26 02:30:00 2025-10-26 03:00:00      30 min CLOSED      2    1000
+01:00"""
        == text
    )


@pytest.mark.parametrize(
    ("hold", "expected"),
    [
        (None, "until the next report"),
        (Hold(3, HOUR, 1), "for 3 h (3 gaps of 1 h, as 1 look tells no median gap)"),
        (Hold(1, 20 * MINUTE, 9), "for 20 min (1 median gap between looks)"),
    ],
)
def test_it_says_how_long_a_sighting_holds(hold: Hold | None, expected: str) -> None:
    """And why: the setting of the log, and what the door's looks tell."""
    assert f"a sighting holds {expected}" == hold_text(hold)
