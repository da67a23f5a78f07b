"""Looks at such hours of such days, and which doors are left out for them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from semmap_log.analysis.planning.door_chances import (
    DAY_S,
    DoorChances,
    LooksAtHour,
    SkipRule,
    looks_at_hour,
)
from semmap_log.analysis.probabilities.evidence.evidence import Evidence
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved, DoorUpdated
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.meaning import Changed
from semmap_log.core.model.moments import HOUR_NS, parse_instant

TZ = "Europe/Vienna"
MONDAY_NS = parse_instant("2026-03-02", tz=TZ)
DOOR = DoorId(1)


def seen(*times_h: float, state: DoorState = DoorState.CLOSED) -> Evidence:
    """Return the evidence of looks at a door, hours after Monday 00:00."""
    evidence = Evidence()
    evidence.apply(EventBatch.of(DoorAdded, happened_ns=MONDAY_NS - HOUR_NS, door_id=[DOOR]))
    times_ns = MONDAY_NS + np.round(np.array(times_h) * HOUR_NS).astype(np.int64)
    evidence.apply(
        EventBatch.of(
            DoorObserved, happened_ns=times_ns, door_id=np.full(len(times_ns), DOOR, np.uint32),
            state=np.full(len(times_ns), state, np.uint8), accuracy_open=0.9, accuracy_closed=0.9,
        )
    )  # fmt: skip
    return evidence


def at(evidence: Evidence, hour: float) -> LooksAtHour:
    time_ns = MONDAY_NS + round(hour * HOUR_NS)
    return looks_at_hour(evidence.door(DOOR), LocalClock(TZ), time_ns=time_ns, known_ns=time_ns)


@pytest.mark.parametrize(
    ("looks_h", "hour", "counted"),
    [
        ((10, 34, 39, 24 + 23, 5 * 24 + 10), 3 * 24 + 11, 2),
        ((10, 34, 39, 24 + 23, 5 * 24 + 10), 3 * 24 + 1, 1),
        ((10, 34, 39, 24 + 23, 5 * 24 + 10), 6 * 24 + 11, 1),
        ((10, 34), 30, 0),
        ((10, 34), 12, 1),
        ((10,), 28 * 24 + 10, 0),
    ],
    ids=["within three hours", "over midnight", "another kind of day", "at six", "later", "old"],
)
def test_looks_count_at_about_that_time_of_day(
    looks_h: tuple[float, ...], hour: float, counted: int
) -> None:
    """Only what was known then, of the last four weeks."""
    assert at(seen(*looks_h), hour) == (counted, 0)


def test_a_pass_is_one_look() -> None:
    """What the last of its sightings said counts."""
    evidence = seen(10, 10.004, 10.008)
    evidence.apply(
        EventBatch.of(
            DoorObserved, happened_ns=[MONDAY_NS + round(10.012 * HOUR_NS)], door_id=[DOOR],
            state=[int(DoorState.OPEN)], accuracy_open=1.0, accuracy_closed=1.0,
        )
    )  # fmt: skip

    assert at(evidence, 11.0) == (1, 1)


def test_a_state_that_is_known_counts_by_the_hour() -> None:
    """Shut from eight to noon: four looks."""
    evidence = seen()
    for hour, state in ((8, DoorState.CLOSED), (12, DoorState.UNKNOWN)):
        evidence.apply(
            EventBatch.of(
                DoorUpdated, happened_ns=[MONDAY_NS + hour * HOUR_NS], door_id=[DOOR],
                changed=[int(Changed.STATE)], state=[int(state)],
            )
        )  # fmt: skip

    assert at(evidence, 24 + 10.0) == (4, 0)


def test_the_upper_end_of_jeffreys_interval() -> None:
    """Of five looks that found it shut .306, the 95 % point of Beta(.5, 5.5); without a look 1."""
    assert LooksAtHour(0, 0).high == 1.0
    assert LooksAtHour(5, 0).high == pytest.approx(0.30575, abs=1e-4)
    assert LooksAtHour(10, 10).high > 0.99


def chances(looks: list[tuple[int, int]], unseen_s: list[float]) -> DoorChances:
    """Return doors of P .01 that were looked at so often."""
    count = len(looks)
    low = np.full((count, 1), 0.01)
    return DoorChances(
        low, low, low + 0.05, np.ones(count, np.bool_), np.array(looks),
        np.array([LooksAtHour(*each).high for each in looks]), np.array(unseen_s), 300.0,
    )  # fmt: skip


def test_a_door_is_left_out_on_the_upper_end_alone() -> None:
    """However low P is: few looks do not do, nor none; and one that was open once does."""
    known = chances([(0, 0), (2, 0), (9, 0), (9, 3)], [60.0] * 4)

    assert SkipRule().is_skipped(known).tolist() == [False, False, True, False]
    assert not SkipRule(below=0.0).is_skipped(known).any()


def test_a_door_that_may_be_open_this_time_is_not_left_out() -> None:
    """At such hours it was always shut."""
    alike = chances([(9, 0)] * 3, [60.0] * 3)
    known = replace(alike, p_passes=np.array([[0.6, 0.2], [0.01, 0.5], [0.1, 0.1]]))

    assert SkipRule().seem_shut(known).tolist() == [False, False, True]
    assert SkipRule().is_skipped(known).tolist() == [False, False, True]


def test_a_low_p_alone_leaves_no_door_out() -> None:
    """What is left out on the mean is never learnt."""
    known = replace(chances([(2, 0), (9, 4)], [60.0] * 2), p_passes=np.zeros((2, 3)))

    assert not SkipRule().seem_shut(known).any()


def test_what_is_left_out_is_looked_at_again_after_a_day() -> None:
    """Else it would never be learnt that it opens now."""
    known = chances([(9, 0)] * 3, [DAY_S - 1, DAY_S, math.inf])

    assert SkipRule().is_skipped(known).tolist() == [True, False, False]
    assert SkipRule().seem_shut(known).all()


def test_an_unknown_door_counts_as_the_others_and_by_its_looks() -> None:
    """The mean of those that are known, as two looks; .5 where there are none; never in silence."""
    p = np.array([[0.9], [0.7], [0.5], [0.5]])
    known = replace(
        chances([(0, 0), (0, 0), (0, 0), (6, 0)], [60.0] * 4),
        p_passes=p, is_known=np.array([True, True, False, False]),
    )  # fmt: skip

    found = known.with_stand_ins()
    nothing = replace(known, is_known=np.zeros(4, np.bool_)).with_stand_ins()

    assert found.p_passes[:, 0].tolist() == pytest.approx([0.9, 0.7, 0.8, 0.2])
    assert (found.low[2, 0], found.high[2, 0]) == (0.0, 1.0)
    assert found.is_known.tolist() == [True, True, False, False]
    assert nothing.p_passes[2, 0] == 0.5
