"""What a door's rates leave of a belief, by the hour of the building's day."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.probabilities.chain.forgetting import START, Forgetting, forgettings_of
from semmap_log.probabilities.chain.markov_chain import Rates
from semmap_log.probabilities.chain.nodes import Looks, looks
from semmap_log.probabilities.local_clock import LocalClock
from tests.probabilities.chains import HOUR_S, looked_at, states_at
from tests.probabilities.known import HOUR_NS, evidence, hours_ns

UTC = LocalClock("UTC")
BY_HOUR = Forgetting(
    Rates(np.linspace(1, 24, 24) / 5e5, np.linspace(24, 1, 24)[::-1] / 9e5), changes=99.0
)


def patrolled(days: float, opening: float, closing: float, seed: int) -> Looks:
    """Return half-hourly looks, right nine times in ten, at a door of these rates."""
    rng = np.random.default_rng(seed)
    times_s = np.arange(0, days * 86400, 1800.0)
    nodes = looked_at(times_s, states_at(times_s, opening, closing, rng), 0.9, rng)
    hour = (times_s % 86400 // 3600).astype(np.intp)
    return Looks(hours_ns(times_s / 3600), nodes.llr, hour)


@pytest.mark.parametrize("span", [(0.0, 0.0), (3.2, 3.7), (3.2, 4.1), (22.5, 25.0), (5.0, 77.7)])
def test_what_is_kept_is_what_each_hours_rates_leave(span: tuple[float, float]) -> None:
    """
    Over hours, midnights and days: e to the minus sum of the rates, second by second.
    """
    seconds = np.arange(round(span[0] * 3600), round(span[1] * 3600))
    expected = np.exp(-BY_HOUR.rates.relaxation[seconds // 3600 % 24].sum())

    found = BY_HOUR.kept(*hours_ns(span)[:, None], UTC)

    assert expected == pytest.approx(found[0], rel=1e-9)


def test_a_belief_of_later_is_kept_whole() -> None:
    """
    Nothing is more than fresh, whatever the order of the times.
    """
    found = BY_HOUR.kept(hours_ns([9.0]), hours_ns([7.0]), UTC)

    assert 1.0 == found[0]


def test_forgetting_goes_by_the_buildings_hours() -> None:
    """
    A door that forgets at noon only does so when it is noon where it is.
    """
    noon = np.where(np.arange(24) == 12, 1 / 600, 1e-9)
    forgetting = Forgetting(Rates(noon, noon), 9.0)
    tokyo = LocalClock("Asia/Tokyo")  # 9 hours ahead

    at_noon = forgetting.kept(hours_ns([3.0]), hours_ns([4.0]), tokyo)
    in_utc = forgetting.kept(hours_ns([3.0]), hours_ns([4.0]), UTC)

    assert at_noon[0] < 0.01
    assert in_utc[0] > 0.99


def test_the_mean_over_the_day_is_that_of_all_its_hours() -> None:
    """
    What is left some hours after a full hour, on average.
    """
    ahead_h = np.array([0.0, 1.0, 6.5, 32.0])
    starts = np.arange(24.0)
    expected = [
        BY_HOUR.kept(hours_ns(starts), hours_ns(starts + ahead), UTC).mean() for ahead in ahead_h
    ]

    found = BY_HOUR.mean_kept(ahead_h)

    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_rates_of_many_changes_are_surer() -> None:
    """
    What is fresh, or long forgotten, is so for sure; between, four times the changes halve it.
    """
    kept = np.array([0.0, 0.3, 1.0])
    few, many = (Forgetting(BY_HOUR.rates, changes) for changes in (24.0, 99.0))

    found = few.unsure(kept), many.unsure(kept)

    assert [0.0, 0.0] == pytest.approx([found[0][0], found[0][2]], abs=1e-9)
    assert found[0][1] == pytest.approx(2 * found[1][1])
    assert found[1][1] == pytest.approx(0.3 * np.log(1 / 0.3) / 10)


def test_of_a_door_that_nobody_saw_nothing_is_learnt() -> None:
    """
    Looks that see nothing leave the rates that every door starts with, and no changes.
    """
    unseen = looks(evidence(), UTC, int(hours_ns(0)), int(hours_ns(48)))

    found = forgettings_of([unseen])

    assert [START] == found
    assert 0.0 == found[0].changes


def test_changes_are_about_those_of_the_door() -> None:
    """
    Open two hours and closed six, on average: six changes a day, of either kind.
    """
    days = 200

    (found,) = forgettings_of([patrolled(days, 1 / (6 * HOUR_S), 1 / (2 * HOUR_S), 3)])

    assert found.changes == pytest.approx(days * 24 / (6 + 2) * 2, rel=0.15)
    assert found.rates.stationary.mean() == pytest.approx(0.25, abs=0.03)


def test_many_doors_learn_what_each_learns_alone() -> None:
    """
    Side by side, one of them never seen: the same rates and changes, in the order given.
    """
    doors = [
        patrolled(40, 1 / (6 * HOUR_S), 1 / (2 * HOUR_S), 1),
        looks(evidence(), UTC, int(hours_ns(0)), int(hours_ns(48))),
        patrolled(25, 1 / (2 * HOUR_S), 1 / (9 * HOUR_S), 2),
    ]
    alone = [forgettings_of([door])[0] for door in doors]

    found = forgettings_of(doors)

    for one, expected in zip(found, alone, strict=True):
        np.testing.assert_allclose(one.rates.opening, expected.rates.opening, rtol=1e-3)
        np.testing.assert_allclose(one.rates.closing, expected.rates.closing, rtol=1e-3)
        assert one.changes == pytest.approx(expected.changes, rel=1e-3)


@pytest.mark.parametrize("day", ["2026-03-29", "2026-10-25"])
def test_an_hour_is_an_hour_when_the_clocks_change(day: str) -> None:
    """
    From half past to half past in the night of the change, real time passes, not that of clocks.
    """
    rates = Rates(np.full(24, 1 / 7200), np.full(24, 1 / 9000))
    from_ns = np.array([f"{day}T00:30"], "M8[ns]").astype(np.int64)

    found = Forgetting(rates, 9.0).kept(from_ns, from_ns + HOUR_NS, LocalClock("Europe/Vienna"))

    assert np.exp(-3600 * (1 / 7200 + 1 / 9000)) == pytest.approx(found[0])
