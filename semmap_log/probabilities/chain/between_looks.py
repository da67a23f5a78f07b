"""What a chain is to be expected to have done between two looks, which nobody saw.

Given both ends, expected numbers of changes and times in each state have a closed form for two
states: the end-point-conditioned statistics of Hobolth and Jensen (J. Appl. Prob. 48, 2011).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.probabilities.chain.markov_chain import (
    CLOSED,
    OPEN,
    ChainLikelihoods,
    Nodes,
    Rates,
    steps_of,
)

Reals = NDArray[np.float64]


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
    opens = np.stack([steps.from_closed, steps.from_open])[:, inner, 0]
    sees = 1 / (1 + np.exp(-nodes.llr[inner]))
    later = np.stack([(1 - sees) * (1 - along.later[inner]), sees * along.later[inner]])
    pairs = was[:, None] * np.stack([1 - opens, opens], axis=1) * later[None]
    scaled: Reals = pairs / pairs.sum((0, 1))
    return scaled
