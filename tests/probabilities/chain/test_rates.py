"""Rates of simulated doors come back, and each round of learning explains the looks better."""

from __future__ import annotations

import numpy as np
import pytest

from semmap_log.probabilities.chain.markov_chain import Nodes, Rates, passage
from semmap_log.probabilities.chain.rates import LEAST_PER_S, MOST_PER_S, PRIOR_S, learn_rates
from tests.probabilities.chains import HOUR_S, looked_at, states_at

OPENING, CLOSING = 1 / (6 * HOUR_S), 1 / (2 * HOUR_S)


def a_door(days: float, seed: int, *, every_s: float = 1800.0, jitter: float = 0.0) -> Nodes:
    rng = np.random.default_rng(seed)
    times_s = np.arange(0, days * 86400, every_s)
    times_s = np.sort(times_s + jitter * rng.uniform(-1, 1, len(times_s)) * every_s)
    return looked_at(times_s, states_at(times_s - times_s[0], OPENING, CLOSING, rng), 0.9, rng)


@pytest.mark.parametrize("jitter", [0.0, 3.0])
def test_rates_of_a_simulated_door_come_back_within_5_percent(jitter: float) -> None:
    """
    Half-hourly looks that are right nine times in ten, at even and at quite irregular times.
    """
    nodes = a_door(1500, 3, jitter=jitter)

    found = learn_rates(nodes)

    assert found.opening[0] == pytest.approx(OPENING, rel=0.05)
    assert found.closing[0] == pytest.approx(CLOSING, rel=0.05)


def test_the_likelihood_never_falls() -> None:
    """
    Every round explains what was seen at least as well as the one before.
    """
    told: list[float] = []

    learn_rates(a_door(60, 5, jitter=5.0), on_round=lambda _, found: told.append(found))

    assert len(told) > 3
    assert np.diff(told).min() > -1e-9


def test_with_a_prior_the_likelihood_and_the_prior_together_never_fall() -> None:
    """
    Rates of each hour, shrunk to the door's own by a gamma prior: that is what is made greatest.
    """
    nodes = a_door(40, 6)
    times_s = np.cumsum(nodes.gap_s)
    hourly = nodes.with_bins((times_s % 86400 // 3600).astype(np.intp))
    prior = learn_rates(nodes)
    told = []
    rounds = [learn_rates(hourly, bins=24, prior=prior, most_rounds=n) for n in range(1, 8)]
    for rates in rounds:
        likelihood = float(passage(hourly, rates).log_likelihood.sum())
        told.append(likelihood + log_prior(rates, prior))

    assert np.diff(told).min() > -1e-9
    assert told[-1] > told[0]


def log_prior(rates: Rates, prior: Rates) -> float:
    """Return the log density, up to a constant, of a gamma prior with that mean and weight."""
    return sum(
        float((PRIOR_S * mean * np.log(found) - PRIOR_S * found).sum())
        for found, mean in ((rates.opening, prior.opening), (rates.closing, prior.closing))
    )


def test_hours_get_rates_of_their_own() -> None:
    """
    A door that opens by day only, and is shut at night: its rates tell the hours apart.
    """
    rng = np.random.default_rng(8)
    times_s = np.arange(0, 200 * 86400, 900.0)
    hour = (times_s % 86400 // 3600).astype(np.intp)
    by_day = (hour >= 8) & (hour < 18)
    nodes = looked_at(times_s, states_at(times_s, OPENING, CLOSING, rng) & by_day, 0.9, rng)

    found = learn_rates(nodes.with_bins(hour), bins=24, prior=learn_rates(nodes))

    assert found.stationary[[10, 12, 15]].min() > 0.15
    assert found.stationary[[0, 3, 21]].max() < 0.05


def test_a_door_never_seen_open_hardly_ever_opens() -> None:
    """
    No prior rate pushes it up: the longer it stays shut, the less it is expected to open.
    """
    times_s = np.arange(0, 60 * 86400, 1800.0)
    shut = np.zeros(len(times_s), np.bool_)

    found = learn_rates(looked_at(times_s, shut, 0.999999, np.random.default_rng(1)))

    assert found.opening[0] < 2 * LEAST_PER_S


@pytest.mark.slow
def test_rates_stay_within_what_looks_can_tell() -> None:
    """
    A door that is always shut opens no more seldom than once in sixty days; one that is otherwise
    at every look, however soon, changes no faster than each twenty seconds.
    """
    times_s = np.arange(0, 400 * 86400, 1800.0)
    seconds = np.arange(0.0, 20_000)
    sure = np.random.default_rng(1)

    shut = learn_rates(looked_at(times_s, np.zeros(len(times_s), np.bool_), 0.999999, sure))
    flickers = learn_rates(looked_at(seconds, seconds % 2 == 1, 0.999999, sure))

    assert LEAST_PER_S == shut.opening[0]
    assert shut.closing[0] <= MOST_PER_S
    assert MOST_PER_S == pytest.approx(flickers.opening[0])
    assert MOST_PER_S == pytest.approx(flickers.closing[0])
