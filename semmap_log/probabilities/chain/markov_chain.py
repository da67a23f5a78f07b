"""A door as a hidden Markov chain in continuous time: two states, and rates for each time of day.

The state is never seen for sure, and at any times: sightings weigh on it by their likelihood. This
is the continuous-time form of the hidden Markov models of Meyer-Delius et al. (AAAI 2012) for cells
that change; forward and backward passes are Baum and Welch's.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.common.late_dataclass import dataclass
from semmap_log.probabilities.chain.matrix_scan import states

Reals = NDArray[np.float64]

CLOSED, OPEN = 0, 1


@dataclass(frozen=True, slots=True)
class Rates:
    """How often a door changes: one row a bin, such as an hour of the day."""

    opening: Reals
    """(bins,): of a closed door, per second."""
    closing: Reals
    """(bins,): of an open door, per second."""

    @property
    def relaxation(self) -> Reals:
        """(bins,): per second; 1 / it is how long what was seen goes on to count."""
        return self.opening + self.closing

    @property
    def stationary(self) -> Reals:
        """(bins,): P(open) after long times of such rates."""
        return self.opening / self.relaxation


@dataclass(frozen=True, slots=True)
class Nodes:
    """One or more doors' sequences, one behind the other: sightings, and places without any.

    Between two nodes of a sequence the rates are those of the first one's bin: where rates change,
    a node without a sighting stands.
    """

    gap_s: Reals
    """(n,): since the node before; 0 where a sequence begins."""
    llr: Reals
    """(n,): log P(what was read | open) / P(... | closed), nats; 0 where nothing was."""
    bin: NDArray[np.intp]
    """(n,): which of the rates hold from here on."""
    begins: NDArray[np.bool_]
    """(n,): a sequence begins here; the first one does."""

    def __len__(self) -> int:
        return len(self.llr)

    def with_bins(self, bins: NDArray[np.intp]) -> Nodes:
        """Return the same nodes with other bins."""
        return Nodes(self.gap_s, self.llr, bins, self.begins)

    def only_seen(self) -> Nodes:
        """Return those at which something was seen, of one sequence."""
        seen = self.llr != 0
        passed_s = np.cumsum(self.gap_s)[seen]
        first = np.arange(len(passed_s)) == 0
        return Nodes(np.diff(passed_s, prepend=passed_s[:1]), self.llr[seen], self.bin[seen], first)


@dataclass(frozen=True, slots=True)
class ChainLikelihoods:
    """The likelihoods of a chain along nodes."""

    filtered: Reals
    """(n,): P(open) by all that was seen up to there."""
    predicted: Reals
    """(n,): P(open) by what was seen before."""
    later: Reals
    """(n,): how what is seen later weighs: P(it | open) / (P(it | open) + P(it | closed))."""
    log_likelihood: Reals
    """(n,): of what is seen there, after all before; up to a constant of the sensor."""

    @property
    def smoothed(self) -> Reals:
        """(n,): P(open) by all that was seen, before and after."""
        opened = self.filtered * self.later
        found: Reals = opened / (opened + (1 - self.filtered) * (1 - self.later))
        return found


@dataclass(frozen=True, slots=True)
class Steps:
    """From each node to the next: how likely the door is open there; of some chains."""

    from_closed: Reals
    """(n, chains): P(open at node i | closed at the one before)."""
    from_open: Reals
    """(n, chains): P(open at node i | open at the one before)."""

    def predicted(self, before: Reals) -> Reals:
        """Return (n, chains): P(open) at each node, where it was (n, chains) at the one before."""
        return self.from_closed + before * (self.from_open - self.from_closed)


def steps_of(nodes: Nodes, rates: Rates) -> Steps:
    """Return the steps of one chain; where a sequence begins, open and closed are as likely."""
    before = np.append(0, nodes.bin[:-1])
    long_run = np.where(nodes.begins, 0.5, rates.stationary[before])
    kept = np.where(nodes.begins, 0.0, np.exp(-rates.relaxation[before] * nodes.gap_s))
    from_closed = (long_run * (1 - kept))[:, None]
    return Steps(from_closed, from_closed + kept[:, None])


def filtered(steps: Steps, llr: Reals, first: Reals) -> tuple[Reals, Reals]:
    """Return P(open) at each node by what was seen up to there, and at the one before.

    Args:
        steps: Of chains.
        llr: (n,), what is seen at each node.
        first: (chains,), P(open) before the first node.

    Returns:
        Both (n, chains).
    """
    after = states(_matrices(steps, llr), np.stack([1 - first, first]))[OPEN]
    return after, np.concatenate([first[None], after])[:-1]


def likelihood(p_open: Reals, llr: Reals) -> Reals:
    """Return (n, chains): how likely it is to see that, (n,); up to a constant of the sensor."""
    sees = _sigmoid(llr)[:, None]
    found: Reals = p_open * sees + (1 - p_open) * (1 - sees)
    return found


def weighed(p_open: Reals, llr: Reals) -> Reals:
    """Return (n, chains): P(open) after something was seen, (n,), where it was that before."""
    found: Reals = p_open * _sigmoid(llr)[:, None] / likelihood(p_open, llr)
    return found


def passage(nodes: Nodes, rates: Rates) -> ChainLikelihoods:
    """Return the likelihoods of one chain along nodes, forward and backward."""
    steps = steps_of(nodes, rates)
    after, before = filtered(steps, nodes.llr, np.full(1, 0.5))
    predicted = steps.predicted(before)
    backward = _matrices(steps, nodes.llr)[:, :, :0:-1].swapaxes(0, 1)
    later = np.append(states(backward, np.full((2, 1), 0.5))[OPEN, ::-1, 0], 0.5)
    seen = np.log(likelihood(predicted, nodes.llr)[:, 0])
    return ChainLikelihoods(after[:, 0], predicted[:, 0], later, seen)


def _matrices(steps: Steps, llr: Reals) -> Reals:
    """Return (2, 2, n, chains): from the closed and open weight of a node to those of the next."""
    opened = _sigmoid(llr)[:, None]
    matrices = np.empty((2, 2, *steps.from_open.shape))
    matrices[CLOSED, CLOSED] = (1 - opened) * (1 - steps.from_closed)
    matrices[CLOSED, OPEN] = (1 - opened) * (1 - steps.from_open)
    matrices[OPEN, CLOSED] = opened * steps.from_closed
    matrices[OPEN, OPEN] = opened * steps.from_open
    return matrices


def _sigmoid(x: Reals) -> Reals:
    found: Reals = 1 / (1 + np.exp(-x))
    return found
