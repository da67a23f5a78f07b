"""The chained persistence filters: against Bayes by hand, and on doors whose habits are known."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from asks import Ask, Readings
from chained import (
    Chain,
    ChainedFilter,
    Exponential,
    LogNormal,
    durations_s,
    forecasts,
    learnt,
    predict,
    states,
)
from numpy.typing import NDArray

NEVER = 1e-12
"""A threshold at which no state counts as over."""


def readings(
    reads_open: NDArray[np.bool_],
    *,
    missed: float = 0.1,
    false: float = 0.2,
    every_s: float = 600.0,
) -> Readings:
    count = len(reads_open)
    times_s = np.arange(count) * every_s
    return Readings(times_s, reads_open, np.full(count, missed), np.full(count, false))


@pytest.mark.parametrize("is_open", [True, False])
@pytest.mark.parametrize("prior", [Exponential(2000.0), LogNormal(np.log(1500.0), 0.7)])
def test_a_filter_is_bayes(prior: Exponential | LogNormal, is_open: bool) -> None:
    """
    P(the state still lasts | readings), summed up over a fine grid of when it may have ended.
    """
    said = readings(np.array([True, True, False, True, False, False]))
    door = ChainedFilter(Chain((prior, prior), NEVER), 0.0, is_open=is_open)
    for at, read in zip(said.times_s.tolist(), said.reads_open.tolist(), strict=True):
        door.read(at, reads_open=read, missed=0.1, false=0.2)
    times_s = np.array([3000.0, 3600.0, 6000.0])

    found = door.p_open(times_s)

    ends_s = np.arange(0.5, 200_000)
    mass = prior.survive(ends_s - 0.5) - prior.survive(ends_s + 0.5)
    lasts = ends_s[:, None] > said.times_s
    door_is_open = lasts if is_open else ~lasts
    p_reads = np.where(door_is_open, 0.9, 0.2)
    weight = mass * np.where(said.reads_open, p_reads, 1 - p_reads).prod(1)
    p_lasts = (weight[:, None] * (ends_s[:, None] > times_s)).sum(0) / weight.sum()
    assert pytest.approx(p_lasts if is_open else 1 - p_lasts, abs=2e-3) == found


def test_states_take_turns_in_the_future() -> None:
    """
    Open for about an hour, closed for about two: the belief falls to a half there, and begins anew.
    """
    closed, opened = (LogNormal(np.log(hours * 3600), 0.1) for hours in (2, 1))
    door = ChainedFilter(Chain((closed, opened), 0.5), 0.0, is_open=True)

    p_open = door.p_open(np.array([0.5, 1.5, 2.9, 3.5, 4.5, 6.5]) * 3600)

    assert [True, False, False, True, False, True] == (p_open > 0.5).tolist()
    assert p_open[[0, 3, 5]].min() > 0.99


def test_a_door_opens_again() -> None:
    """
    What vanished comes back: the filter of the other state takes over.
    """
    chain = Chain((Exponential(7200.0), Exponential(7200.0)), 0.25)
    door = np.repeat([True, False, True], 12)

    found = forecasts(chain, readings(door), np.arange(36) * 600.0, np.arange(36))

    assert (found[[11, 23, 35]] > 0.5).tolist() == [True, False, True]
    assert ((found > 0.5) == door).mean() > 0.9


def test_a_forecast_knows_no_later_reading() -> None:
    """
    Nor do the settings know what the first forecast may not.
    """
    random = np.random.default_rng(3)
    door = np.repeat(random.random(40) < 0.5, random.integers(4, 30, 40))
    seen = readings(door ^ (random.random(len(door)) < 0.1))
    later = Readings(
        seen.times_s, np.where(np.arange(len(door)) > 500, ~seen.reads_open, seen.reads_open),
        seen.missed, seen.false,
    )  # fmt: skip
    last = np.arange(400, 501)
    times_s = seen.times_s[last] + 300.0

    found = [predict(Ask((1, 0, 600), known, times_s, last, 401)) for known in (seen, later)]

    assert found[0].tolist() == found[1].tolist()
    assert np.mean((found[0] - door[last]) ** 2) < 0.1


def test_likely_states_are_the_likeliest() -> None:
    """
    Of all 256 sequences of eight states, with a price for each change.
    """
    said = readings(np.array([True, False, True, True, False, False, True, False]))

    def log_p(door: tuple[bool, ...]) -> float:
        p_open = np.where(np.array(door), 0.9, 0.2)
        p = np.where(said.reads_open, p_open, 1 - p_open)
        return float(np.log(p).sum() - 1.2 * np.abs(np.diff(np.array(door, int))).sum())

    best = max(product([False, True], repeat=8), key=log_p)

    assert list(best) == states(said, 1.2).tolist()


def test_durations_are_those_of_the_states() -> None:
    """
    A single wrong reading makes none; a state that was never seen lasts no time.
    """
    said = readings(np.array([False] * 6 + [True] * 5 + [False, True] + [True] * 3 + [False] * 4))

    closed, opened = durations_s(said, 4.0)

    assert ([3600.0, 1800.0], [6000.0]) == (closed.tolist(), opened.tolist())
    assert [1.0] == durations_s(readings(np.zeros(9, np.bool_)), 4.0)[1].tolist()


def test_settings_are_those_that_forecast_best() -> None:
    """
    Doors that stay for a typical time are told from doors that keep no time.
    """
    random = np.random.default_rng(5)
    typical = np.tile(np.repeat([True, False], [20, 40]), 30)
    whenever = np.repeat(
        np.arange(400) % 2 == 0, np.maximum(1, random.exponential(20, 400)).astype(int)
    )

    chains = [
        learnt(Ask((1, 0, 600), readings(door, missed=0.01, false=0.01), np.array([at * 600.0]),
                   np.array([at - 24]), at - 24))
        for door, at in ((typical, len(typical)), (whenever, len(whenever)))
    ]  # fmt: skip

    assert [LogNormal, Exponential] == [type(chain.lasting[1]) for chain in chains]
