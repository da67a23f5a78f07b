"""How a door is used in an hour of the week, in one of a few modes: night, office hours, a slot.

A mode is how much of the time the door is open in the long run, and at what pace it forgets. All
that may be stand on a grid. Which of them a door has, and in which hours, its hours say together:
the mixing distribution is fitted without a form of its own (N. Laird, J. Am. Stat. Assoc. 73,
1978), so that a hundred quiet nights say how quiet the next one is, and one slot stays one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.chain.regimes import likely_paces
from semmap_log.core.model.local_clock import WORKING_DAYS

Reals = NDArray[np.float64]

SHARES = np.array([0.001, 0.003, 0.01, 0.03, 0.1, 0.22, 0.4, 0.6, 0.78, 0.9, 0.98])
"""P(open) in the long run."""
PACES_PER_H = 2.0 ** np.arange(-6, 5)
"""Opening and closing rate together, an hour."""
SHARE, PER_H = (part.ravel() for part in np.meshgrid(SHARES, PACES_PER_H, indexing="ij"))
"""(modes,): of each."""

PRIOR = likely_paces(1 / PER_H)
"""(modes,): the prior of each; long runs are equally likely."""
PRIOR_HOURS = 0.2
"""The weight of that prior, in hours of a day."""
LIKE = np.array([4.0, 1.0, 1.0, 1.0])
"""Prior counts, in hours, of what an hour resembles: that hour of such days, of any day, the
adjacent hours, or none of these (a mode of its own)."""
ADJACENT = 0.5
"""The weight of adjacent hours."""
ROUNDS = 15
_OWN = 3
_SUCH_DAYS = slice(WORKING_DAYS), slice(WORKING_DAYS, None)


def likely_modes(told: Reals) -> Reals:
    """Return how likely each hour of the week is in each mode, (7, 24, modes).

    Args:
        told: (7, 24, modes), Monday first: log-likelihood of what was seen in those hours.
    """
    likelihood = np.exp(told - told.max(-1, keepdims=True))
    modes, often = PRIOR, LIKE / LIKE.sum()
    is_like = np.ones((*told.shape[:2], 1))
    found = likelihood
    for _ in range(ROUNDS):
        each = _expected(told * is_like, modes) * (often[:, None, None, None] * likelihood)
        each /= each.sum((0, 3), keepdims=True)
        of_kinds = each.sum(-1)
        is_like = 1 - of_kinds[_OWN][..., None]  # what is of its own says nothing about others
        often = LIKE + of_kinds.sum((1, 2))
        often /= often.sum()
        found = each.sum(0)
        modes = PRIOR_HOURS * PRIOR + found.mean(0).sum(0)
        modes /= modes.sum()
    return np.asarray(found)


def _expected(told: Reals, modes: Reals) -> Reals:
    """Return each hour's distribution of modes by the others, (kinds of `LIKE`, 7, 24, modes)."""
    before = np.log(modes)
    found = np.empty((len(LIKE), *told.shape))
    for days in _SUCH_DAYS:
        of_hour = told[days].sum(0)
        found[0, days] = _scaled(of_hour - told[days] + before)
        beside = np.roll(of_hour, 1, 0) + np.roll(of_hour, -1, 0)
        found[2, days] = _scaled(ADJACENT * beside + before)
    found[1] = _scaled(told.sum(0) - told + before)
    found[_OWN] = modes
    return np.asarray(found)


def _scaled(log_likelihood: Reals) -> Reals:
    found = np.exp(log_likelihood - log_likelihood.max(-1, keepdims=True))
    return np.asarray(found / found.sum(-1, keepdims=True))
