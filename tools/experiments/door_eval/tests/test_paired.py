"""Differences of two estimators, by hand and on days that are drawn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from door_eval.day_losses import DayLosses, DoorLosses, LossBook
from door_eval.paired import difference
from semmap_log.analysis.beliefs.trials import Trials
from semmap_log.analysis.probabilities.scores import scores
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.moments import DAY_NS, SECOND_NS, parse_instant

VIENNA = LocalClock("Europe/Vienna")
HOUR_NS = 3600 * SECOND_NS


def trials(hours: Sequence[float], outcome: Sequence[int], door: int = 1) -> Trials:
    """Return forecasts so many hours after a midnight in Vienna."""
    midnight_ns = parse_instant("2026-07-01", tz="Europe/Vienna")
    times_ns = midnight_ns + (np.array(hours) * HOUR_NS).astype(np.int64)
    sure = np.ones(len(hours))
    return Trials(DoorId(door), times_ns, times_ns, np.array(outcome, np.float64), sure, sure)


def losses(each_day: Sequence[float], count: int = 10, door: int = 1) -> dict[DoorId, DayLosses]:
    """Return losses of so many forecasts a day, by their mean on each day."""
    days = np.arange(len(each_day))
    sums = {"brier": np.array(each_day) * count}
    return {DoorId(door): DayLosses(days, np.full(len(days), float(count)), sums)}


def test_losses_are_summed_by_local_days() -> None:
    """
    An hour before and an hour after a midnight in Vienna, which is none in UTC.
    """
    asked, p = trials([-1, 1, 2], [0, 1, 0]), np.array([0.5, 0.9, 0.2])
    book = LossBook(VIENNA)

    book("daily", "filter", asked, p)

    found = book.losses["daily", "filter"][DoorId(1)]
    assert [1, 2] == found.count.tolist()
    assert [1] == np.diff(found.days).tolist()
    assert pytest.approx([0.25, 0.01 + 0.04]) == found.sums["brier"].tolist()
    assert pytest.approx(scores(p, asked.outcome).log_loss) == found.sums["log_loss"].sum() / 3


def test_the_difference_is_that_of_the_means_over_doors() -> None:
    """
    A door with a hundred forecasts weighs what one with ten does.
    """
    ours: DoorLosses = losses([0.1, 0.2]) | losses([0.3, 0.3], count=100, door=2)
    theirs: DoorLosses = losses([0.2, 0.2]) | losses([0.2, 0.2], count=100, door=2)

    found = difference([ours], [theirs], "brier")

    assert found is not None
    assert pytest.approx((-0.05 + 0.1) / 2) == found.mean
    assert (2, 1) == (found.days, found.seeds)


def test_the_interval_is_what_draws_of_the_days_give() -> None:
    """
    As the theory says of a mean of many days: its standard error, and about twice that around it.
    """
    apart = np.random.default_rng(1).normal(0.02, 0.05, 200)

    found = difference([losses(list(0.1 + apart))], [losses([0.1] * 200)], "brier")

    assert found is not None
    error = np.std(apart) / np.sqrt(200)
    assert pytest.approx(np.mean(apart)) == found.mean
    assert pytest.approx(error, rel=0.08) == found.standard_error
    assert pytest.approx(np.mean(apart) - 1.96 * error, abs=0.1 * error * 1.96) == found.low
    assert pytest.approx(np.mean(apart) + 1.96 * error, abs=0.1 * error * 1.96) == found.high
    assert found.is_clear == (found.low > 0)
    assert found == difference([losses(list(0.1 + apart))], [losses([0.1] * 200)], "brier")


def test_five_days_are_no_proof() -> None:
    """
    All days of them on one side: so are those of one in sixteen pairs that do not differ.
    """
    found = [
        difference([losses([0.2, 0.3] * (days // 2) + [0.2] * (days % 2))], [losses([0.1] * days)],
                   "brier")
        for days in (5, 6)
    ]  # fmt: skip

    assert [False, True] == [one is not None and one.is_clear for one in found]
    assert all(one is not None and one.low > 0 for one in found)


def test_doors_of_a_day_are_drawn_together() -> None:
    """
    Ten doors that differ on the same day are one case, not ten: the interval is as wide as of one.
    """
    each = [0.1, 0.0, 0.3, 0.0, 0.2, 0.0]
    one = difference([losses(each)], [losses([0.0] * 6)], "brier")
    ours, theirs = {}, {}
    for door in range(1, 11):
        ours |= losses(each, door=door)
        theirs |= losses([0.0] * 6, door=door)

    ten = difference([ours], [theirs], "brier")

    assert one is not None
    assert ten is not None
    assert pytest.approx((one.low, one.high)) == (ten.low, ten.high)
    assert one.high - one.low > 0.1


def test_a_door_that_is_not_drawn_does_not_count() -> None:
    """
    It was forecast on one day only; resamples without that day are of the other door.
    """
    ours: DoorLosses = losses([0.1] * 20) | losses([0.1], door=2)
    theirs: DoorLosses = losses([0.0] * 20) | losses([0.0], door=2)

    found = difference([ours], [theirs], "brier")

    assert found is not None
    assert pytest.approx([0.1, 0.1, 0.1]) == [found.mean, found.low, found.high]


def test_seeds_are_paired() -> None:
    """
    What both lose on a seed does not count; a constant difference has no error.
    """
    seeds = [0.1, 0.3, 0.2]

    found = difference(
        [losses([of + 0.01] * 5) for of in seeds], [losses([of] * 5) for of in seeds], "brier"
    )

    assert found is not None
    assert pytest.approx(0.01) == found.mean
    assert pytest.approx(0, abs=1e-12) == found.standard_error
    assert 3 == found.seeds


def test_where_nothing_was_forecast_there_is_no_difference() -> None:
    """
    Not a 0: nobody is level there.
    """
    book = LossBook(VIENNA)
    book("lag_24h", "filter", trials([], []), np.zeros(0))
    nothing = book.losses["lag_24h", "filter"]

    assert difference([nothing], [nothing], "brier") is None


def test_days_are_those_of_the_clock() -> None:
    """
    A day of 23 hours is one, too.
    """
    start_ns = parse_instant("2026-03-29", tz="Europe/Vienna")
    times_ns = start_ns + np.arange(0, 2 * DAY_NS, HOUR_NS)
    sure = np.ones(len(times_ns))
    asked = Trials(DoorId(1), times_ns, times_ns, sure, sure, sure)

    found = DayLosses.of(asked, sure, VIENNA)

    assert [23, 24, 1] == found.count.tolist()
