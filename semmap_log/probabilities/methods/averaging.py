"""Which of a door's habits to believe: Bayesian averaging by how well each foretold the past.

The weights are those of Herbster and Warmuth's fixed share (Machine Learning 32, 1998) over
tempered likelihoods: a table that was right gains, and none is ever lost, for habits drift. What
foretells tomorrow best need not foretell next month: weights are kept for several leads, each
scored by tables as old as its forecasts are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.probabilities.evidence.day_tables import DayTables
from semmap_log.probabilities.local_clock import DAYS_IN_WEEK
from semmap_log.probabilities.methods.habits import Habits

Weights = NDArray[np.float64]

LEADS_D = np.array([0, 1, 3, 7, 14, 28, 56])
"""Days from the midnight up to which is known to the day that is foretold."""
RATE = 0.25
"""A known hour counts as a quarter of an independent observation: hours of a day hang together."""
SHARE = 0.02
"""So much of the weight is handed out anew each day."""


def weights(habits: Habits, tables: DayTables, lead_d: int) -> Weights:
    """Return (rows, tables): what each table is worth at each midnight, so many days ahead.

    Args:
        habits: Of a door.
        tables: The days that they are made of, which they are scored by, too.
        lead_d: Of `LEADS_D`.
    """
    # Far ahead neighbouring days are foretold by much the same table: their scores say it twice.
    scores = _scores(habits, tables, lead_d) * (RATE / (1 + lead_d / DAYS_IN_WEEK))
    start = 1 / (1 + lead_d / habits.half_lives_d)
    start /= start.sum()
    found = np.empty((len(habits), len(start)))
    found[0] = start
    for day, of_day in enumerate(scores):
        found[day + 1] = shared_anew(found[day], of_day, start, SHARE / (1 + lead_d))
    return found


def shared_anew(before: Weights, gain: Weights, start: Weights, share: Weights | float) -> Weights:
    """Return the weights of experts after they foretold something; they lie along the last axis.

    Args:
        before: Their weights before, which add up to 1.
        gain: Log-likelihood of what came, by each.
        start: What weights are like where nothing is known.
        share: How much is handed out anew, by that.
    """
    gained = before * np.exp(gain - gain.max(-1, keepdims=True))
    gained /= gained.sum(-1, keepdims=True)
    found: Weights = (1 - share) * gained + share * start
    return found


def averaged(worth: Weights, tables: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (rows, 7, 24): the mean of (rows, tables, 7, 24), weighed as by `weights`."""
    found = worth[:, None] @ tables.reshape(*tables.shape[:2], -1)
    return found.reshape(len(tables), *tables.shape[2:])


def lead_of(days_ahead: NDArray[np.int64]) -> NDArray[np.intp]:
    """Return which of `LEADS_D` speaks for so many days ahead: the greatest up to that."""
    return np.searchsorted(LEADS_D, days_ahead, "right") - 1


def _scores(habits: Habits, tables: DayTables, lead: int) -> Weights:
    """Return (days, tables): log-likelihood of each day by the tables of `lead` days before it."""
    days = np.arange(lead, len(tables))
    p_open = habits.p_open[days - lead, :, tables.days[days] % DAYS_IN_WEEK]
    opened, closed = tables.open_h[days], tables.known_h[days] - tables.open_h[days]
    found = np.zeros((len(tables), p_open.shape[1]))
    found[days] = np.einsum("dh,dth->dt", opened, np.log(p_open))
    found[days] += np.einsum("dh,dth->dt", closed, np.log1p(-p_open))
    return found
