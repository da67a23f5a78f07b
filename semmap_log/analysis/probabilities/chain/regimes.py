"""Ways in which a door behaves: it follows its hours, or is left closed, or open; at several paces.

Each regime is a hidden Markov chain of two states, with a long-run share and a pace of its own. All
of them see the same looks; their likelihoods decide how far each is believed: multiple models
(Magill, IEEE Trans. Autom. Control 10, 1965), with the fixed share of `habits`, since a door that
was left closed is used again. Nothing is fitted: the constants here hold for all doors.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.forecast import LEAST, MOST
from semmap_log.core.model.moments import HOUR_NS

Reals = NDArray[np.float64]
Times = NDArray[np.int64]

PACES_H = np.array([0.25, 1.0, 2.0, 4.0, 16.0, 64.0])
"""Time constants of forgetting where the long run is the schedule."""
USUAL_H, SPREAD = 4.0, 2.0
"""The prior of the paces: the likeliest one, and a spread in doublings."""
LEFT_PACE_H = 4.0
"""The time constant where the door is left as it is."""
LEFT_P = 0.97
"""P(open) of a door that is left open, in the long run; of one that is left closed 1 - that."""
LEFT_SHARE = 0.25
"""The prior of being left, closed or open."""
LEFT_LASTS_H = 48.0
"""It is used again after so long, on average, since it was last seen."""

PACE_H = np.append(PACES_H, [LEFT_PACE_H, LEFT_PACE_H])
"""(regimes,): first those that follow the schedule, then left closed, then left open."""
IS_LEFT = np.arange(len(PACE_H)) >= len(PACES_H)
"""(regimes,)."""
_LEFT_AT = np.append(0 * PACES_H, [1 - LEFT_P, LEFT_P])


def likely_paces(paces_h: Reals) -> Reals:
    """Return the prior of some paces, (n,), which sums to 1."""
    usual = np.exp(-0.5 * (np.log2(paces_h / USUAL_H) / SPREAD) ** 2)
    return np.asarray(usual / usual.sum())


PRIOR = np.append(likely_paces(PACES_H) * (1 - LEFT_SHARE), [LEFT_SHARE / 2] * 2)
"""(regimes,): the prior of each."""


def long_run(schedule: Reals) -> Reals:
    """Return (n, regimes): P(open) that each tends to, where the schedule says (n,)."""
    return np.where(IS_LEFT, _LEFT_AT, schedule[:, None])


def kept(gap_ns: Times) -> Reals:
    """Return (n, regimes): the remaining share of a deviation after such times."""
    found: Reals = np.exp(-np.maximum(gap_ns, 0)[:, None] / (PACE_H * HOUR_NS))
    return found


def still_left(age_ns: Times) -> Reals:
    """Return (n,): the probability that a left door is still left, so long after it was seen."""
    found: Reals = np.exp(-np.maximum(age_ns, 0) / (LEFT_LASTS_H * HOUR_NS))
    return found


def stays(gap_ns: Times, age_ns: Times) -> Reals:
    """Return (n, regimes): how far a forecast is not yet the schedule's.

    Args:
        gap_ns: (n,), since the last belief.
        age_ns: (n,), since the door was really seen.
    """
    return np.where(IS_LEFT, still_left(age_ns)[:, None], kept(gap_ns))


def ahead(p_open: Reals, told: Reals, then: Reals, gap_ns: Times, age_ns: Times) -> Reals:
    """Return (n, regimes): P(open) some time later.

    Args:
        p_open: (n, regimes), what was believed.
        told: (n,), what the schedule says of that time.
        then: (n,), and of the later one.
        gap_ns: (n,), between the two.
        age_ns: (n,), since the door was really seen.
    """
    moved = kept(gap_ns) * (p_open - long_run(told))
    left = still_left(age_ns)[:, None] * (long_run(then) + moved - then[:, None])
    return np.clip(then[:, None] + np.where(IS_LEFT, left, moved), LEAST, MOST)
