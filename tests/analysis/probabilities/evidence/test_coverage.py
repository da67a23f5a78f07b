"""Which hours of the week a door was seen in."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from semmap_log.analysis.probabilities.evidence.coverage import (
    WEEK,
    Coverage,
    spans_in_short,
    spans_text,
)
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.moments import parse_instant

VIENNA = "Europe/Vienna"


def evidence(
    *, stretches: Sequence[tuple[str, str]] = (), seen: Sequence[str] = ()
) -> DoorEvidence:
    """What is known of a door whose state was known for some stretches, and sighted at times."""
    edges = np.array([[parse_instant(t, tz=VIENNA) for t in both] for both in stretches], np.int64)
    edges = edges.reshape(-1, 2)
    times = np.array([parse_instant(t, tz=VIENNA) for t in seen], np.int64)
    half, yes = np.full(len(seen), 0.9), np.full(len(seen), True)
    return DoorEvidence(
        DoorId(1), 2**62, edges[:, 0], edges[:, 1], np.full(len(edges), True),
        times, half, half, half, yes, yes, np.arange(len(seen)),
    )  # fmt: skip


def week(*spans: tuple[int, int, int]) -> np.ndarray:
    """Hours of the week: (day, first hour, hour after the last)."""
    hours = np.zeros(WEEK, bool)
    for day, first, end in spans:
        hours[day, first:end] = True
    return hours


def test_a_stretch_covers_the_hours_that_it_touches() -> None:
    """From Monday 22:30 to Tuesday 02:00 sharp: four hours, on the building's clocks."""
    known = evidence(stretches=[("2026-03-02T22:30", "2026-03-03T02:00")])

    coverage = Coverage.of(known, LocalClock(VIENNA))

    np.testing.assert_array_equal(week((0, 22, 24), (1, 0, 2)), coverage.is_seen)
    assert (164, 4 / 24) == (coverage.hours_never_seen, coverage.days)


def test_an_hour_counts_once_a_date() -> None:
    """Ten sightings within an hour are one hour; the same hour a week later is another."""
    known = evidence(
        seen=[f"2026-03-02T08:{minute}0" for minute in range(6)] + ["2026-03-09T08:59"],
        stretches=[("2026-03-02T08:10", "2026-03-02T08:20")],
    )

    coverage = Coverage.of(known, LocalClock(VIENNA))

    assert 2 == coverage.times_seen[0, 8] == coverage.times_seen.sum()


def test_the_clocks_of_summer_and_winter_are_told_apart() -> None:
    """On both sides of the switch, nine o'clock is nine o'clock."""
    known = evidence(seen=["2026-03-27T09:30", "2026-04-03T09:30"])

    coverage = Coverage.of(known, LocalClock(VIENNA))

    assert 2 == coverage.times_seen[4, 9]


def test_a_door_never_seen_covers_nothing() -> None:
    """All 168 hours are unseen, and there are no days of evidence."""
    coverage = Coverage.of(evidence(), LocalClock("UTC"))

    assert (168, 0.0) == (coverage.hours_never_seen, coverage.days)
    assert ["at any hour"] == spans_text(~coverage.is_seen)


def test_a_night_is_one_span() -> None:
    """What is common to all days goes over midnight."""
    nights = week(*((day, 22, 24) for day in range(7)), *((day, 0, 6) for day in range(7)))

    assert ["22:00-06:00"] == spans_text(nights)


@pytest.mark.parametrize(
    ("hours", "expected", "short"),
    [
        (week(), [], ""),
        (week((5, 0, 24), (6, 0, 24)), ["Sat, Sun"], "Sat, Sun"),
        (week(*((day, 0, 24) for day in (0, 1, 2, 5))), ["Mon-Wed, Sat"], "Mon-Wed, Sat"),
        (
            week((6, 0, 24), *((day, 0, 6) for day in range(6)), (0, 14, 16), (2, 14, 16)),
            ["Sun", "00:00-06:00", "Mon, Wed 14:00-16:00"],
            "Sun; 00:00-06:00; 4 more hours of the week",
        ),
        (week((3, 23, 24), (4, 0, 1)), ["Thu 23:00-24:00", "Fri 00:00-01:00"],
         "2 hours of the week"),
        (week((3, 8, 9)), ["Thu 08:00-09:00"], "1 hour of the week"),
    ],
)  # fmt: skip
def test_hours_are_told_as_people_say_them(hours, expected: list[str], short: str) -> None:
    """Whole days, then what is common to the others, then the rest."""
    assert expected == spans_text(hours)
    assert short == spans_in_short(hours)
