"""A door as a hidden Markov chain in continuous time: two states, seen now and then.

The state is never seen for sure, and at any times: looks weigh on it by their likelihood. This is
the continuous-time form of the hidden Markov models of Meyer-Delius et al. (AAAI 2012) for cells
that change.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.chain.matrix_scan import states
from semmap_log.core.lazy.late_dataclass import dataclass

Reals = NDArray[np.float64]

CLOSED, OPEN = 0, 1


@dataclass(frozen=True, slots=True)
class Steps:
    """From each look to the next: how likely the door is open there; of some chains."""

    from_closed: Reals
    """(n, chains): P(open at look i | closed at the one before)."""
    from_open: Reals
    """(n, chains): P(open at look i | open at the one before)."""

    def predicted(self, before: Reals) -> Reals:
        """Return (n, chains): P(open) at each look, where it was (n, chains) at the one before."""
        return self.from_closed + before * (self.from_open - self.from_closed)


def filtered(steps: Steps, llr: Reals, first: Reals) -> tuple[Reals, Reals]:
    """Return P(open) at each look by what was seen up to there, and at the one before.

    Args:
        steps: Of chains.
        llr: (n,), what is seen at each.
        first: (chains,), P(open) before the first.

    Returns:
        Both (n, chains).
    """
    after = states(step_matrices(steps, llr), np.stack([1 - first, first]))[OPEN]
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


def step_matrices(steps: Steps, llr: Reals) -> Reals:
    """Return (2, 2, n, chains): from the closed and open weight at a look to those at the next."""
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
