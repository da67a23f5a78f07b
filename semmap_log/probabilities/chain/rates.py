"""How often a door changes, learnt from sightings by expectation maximisation.

What a chain did between two sightings nobody saw; what is to be expected (`between_looks`) gives
the rates that explain the sightings better, and so on. Changes that fall between two sightings are
none: rates are those at the pace of looking. Each hour of working days and of weekends has its own,
shrunk to the door's by a gamma prior.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from semmap_log.probabilities.chain.between_looks import happened
from semmap_log.probabilities.chain.markov_chain import Nodes, Rates, passage

Reals = NDArray[np.float64]

START_PER_S = 1 / (4 * 3600)
"""A door of which nothing is known changes every four hours."""
LEAST_PER_S, MOST_PER_S = 1 / (60 * 86400), 1 / 20
ENOUGH = 1e-6
"""Of the log-likelihood: a round that gains less, relatively, is the last."""
PRIOR_S = 24 * 3600.0
"""An hour's own rates count as much as the door's once it was seen for so long at that hour."""

OnRound = Callable[[int, float], None]


def rates_by_bin(nodes: Nodes, bins: int) -> Rates:
    """Return the rates of a door, (bins,): first those of the door, then each bin's own.

    Args:
        nodes: Of the door.
        bins: How many there are, such as hours of a day.
    """
    seen = nodes.only_seen()
    overall = learn_rates(seen.with_bins(np.zeros(len(seen), np.intp)))
    return learn_rates(nodes, bins=bins, prior=overall)


def learn_rates(
    nodes: Nodes,
    *,
    bins: int = 1,
    prior: Rates | None = None,
    most_rounds: int = 100,
    on_round: OnRound | None = None,
) -> Rates:
    """Return the rates that make what was seen likeliest, or likely enough.

    Args:
        nodes: Of a door.
        bins: How many there are.
        prior: (1,): rates that each bin's own are shrunk to, by a gamma prior of the weight of
            `PRIOR_S`; None: no prior.
        most_rounds: When to stop in any case.
        on_round: Told the round and the log-likelihood, before its rates are made better.
    """
    start = Rates(np.full(1, START_PER_S), np.full(1, START_PER_S)) if prior is None else prior
    weight_s = 0.0 if prior is None else PRIOR_S
    rates = expected = Rates(np.repeat(start.opening, bins), np.repeat(start.closing, bins))
    last = -np.inf
    for number in range(most_rounds):
        along = passage(nodes, rates)
        likelihood = float(along.log_likelihood.sum())
        if on_round is not None:
            on_round(number, likelihood)
        if likelihood - last <= ENOUGH * abs(likelihood):
            break
        last = likelihood
        rates = _likeliest(happened(nodes, rates, along, bins), expected, weight_s)
    return rates


def _likeliest(happened: Reals, expected: Rates, weight_s: float) -> Rates:
    """Return the rates by which what happened is likeliest; where nothing could, those expected."""
    openings, closings, closed_s, open_s = happened

    def rate(times: Reals, during_s: Reals, otherwise: Reals) -> Reals:
        enough = during_s + weight_s > 1.0
        found = (times + weight_s * otherwise) / np.where(enough, during_s + weight_s, 1.0)
        return np.clip(np.where(enough, found, otherwise), LEAST_PER_S, MOST_PER_S)

    return Rates(
        rate(openings, closed_s, expected.opening), rate(closings, open_s, expected.closing)
    )
