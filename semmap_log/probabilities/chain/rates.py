"""How often doors change, learnt from sightings by expectation maximisation.

What a chain did between two sightings nobody saw; expected numbers of changes and times in each
state, given both ends, have a closed form for two states (the end-point-conditioned statistics of
Hobolth and Jensen, J. Appl. Prob. 48, 2011), and give the rates that explain the sightings better.
Changes that fall between two sightings are none: rates are those at the pace of looking, which is
the pace at which they are used. Raw counts of a contact's changes would make a chain that forgets
in minutes, since half of all openings are over in two.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from semmap_log.probabilities.chain.markov_chain import (
    CLOSED,
    OPEN,
    ChainLikelihoods,
    Nodes,
    Rates,
    passage,
    steps_of,
)

Reals = NDArray[np.float64]

START_PER_S = 1 / (4 * 3600)
"""A door of which nothing is known changes every four hours."""
LEAST_PER_S, MOST_PER_S = 1 / (60 * 86400), 1 / 20
ENOUGH = 1e-6
"""Of the log-likelihood: a round that gains less, relatively, is a door's last."""
PRIOR_S = 24 * 3600.0
"""An hour's own rates count as much as the door's once it was seen for so long at that hour."""

OnRound = Callable[[int, Reals], None]


def learn_rates(
    nodes: Nodes,
    doors: int = 1,
    *,
    bins: int = 1,
    prior: Rates | None = None,
    most_rounds: int = 100,
    on_round: OnRound | None = None,
) -> Rates:
    """Return the rates of each door that make what was seen likeliest, or likely enough.

    Args:
        nodes: Of all doors; `bin` is door x bins + bin.
        doors: How many.
        bins: Rates of each.
        prior: (doors,): rates that each bin's own are shrunk to, by a gamma prior of the weight of
            `PRIOR_S`; None: no prior.
        most_rounds: When to stop in any case.
        on_round: Told the round and each door's log-likelihood, before its rates are made better.
    """
    door = nodes.bin // bins
    count = doors * bins
    rates = Rates(np.full(count, START_PER_S), np.full(count, START_PER_S))
    if prior is not None:
        rates = Rates(np.repeat(prior.opening, bins), np.repeat(prior.closing, bins))
    expected = rates
    learns = np.ones(doors, np.bool_)
    last = np.full(doors, -np.inf)
    for number in range(most_rounds):
        along = passage(nodes, rates)
        likelihood = np.bincount(door, along.log_likelihood, doors).astype(np.float64)
        if on_round is not None:
            on_round(number, likelihood)
        learns &= ~(likelihood - last <= ENOUGH * np.abs(likelihood))
        if not learns.any():
            break
        last = likelihood
        weight_s = 0.0 if prior is None else PRIOR_S
        better = _likeliest(happened(nodes, rates, along, count), expected, weight_s)
        kept = ~np.repeat(learns, bins)
        rates = Rates(
            np.where(kept, rates.opening, better.opening),
            np.where(kept, rates.closing, better.closing),
        )
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


def happened(nodes: Nodes, rates: Rates, along: ChainLikelihoods, count: int) -> Reals:
    """Return (4, count): openings, closings, seconds closed and seconds open to expect, by bin."""
    inner = np.flatnonzero(~nodes.begins)
    before, gap_s = nodes.bin[inner - 1], nodes.gap_s[inner]
    opening, closing = rates.opening[before], rates.closing[before]
    relaxation = opening + closing
    kept = np.exp(-relaxation * gap_s)
    shares = closing / relaxation, opening / relaxation
    """In the long run closed, open."""
    once_s = (1 - kept) / relaxation
    both_s = gap_s * kept

    def moves(start: int, end: int) -> Reals:
        """P(end | start) = moved to the long run + what is kept of the start."""
        return shares[end] + kept * ((start == end) - shares[end])

    def time_s(start: int, leaving: int, entered: int, end: int) -> Reals:
        """Integral over t of P(leaving at t | start) P(end | entered at t), seconds."""
        own = (start == leaving) - shares[leaving], (entered == end) - shares[end]
        return (
            shares[leaving] * shares[end] * gap_s
            + (shares[leaving] * own[1] + own[0] * shares[end]) * once_s
            + own[0] * own[1] * both_s
        )

    weights = _pairs(nodes, rates, along, inner)
    found = np.zeros((4, len(inner)))
    for start in (CLOSED, OPEN):
        for end in (CLOSED, OPEN):
            weight = weights[start, end] / np.maximum(moves(start, end), 1e-300)
            found[0] += weight * opening * time_s(start, CLOSED, OPEN, end)
            found[1] += weight * closing * time_s(start, OPEN, CLOSED, end)
            found[2] += weight * time_s(start, CLOSED, CLOSED, end)
            found[3] += weight * time_s(start, OPEN, OPEN, end)
    return np.stack([np.bincount(before, part, count) for part in found])


def _pairs(nodes: Nodes, rates: Rates, along: ChainLikelihoods, inner: NDArray[np.intp]) -> Reals:
    """Return (2, 2, inner): P(state at the node before, state here), by all that was seen."""
    steps = steps_of(nodes, rates)
    was = np.stack([1 - along.filtered, along.filtered])[:, inner - 1]
    opens = np.stack([steps.from_closed, steps.from_open])[:, inner]
    sees = 1 / (1 + np.exp(-nodes.llr[inner]))
    later = np.stack([(1 - sees) * (1 - along.later[inner]), sees * along.later[inner]])
    pairs = was[:, None] * np.stack([1 - opens, opens], axis=1) * later[None]
    scaled: Reals = pairs / pairs.sum((0, 1))
    return scaled
