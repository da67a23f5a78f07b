"""Which of a door's habits to believe: Bayesian averaging by how well each foretold the past.

The weights are those of Herbster and Warmuth's fixed share (Machine Learning 32, 1998) over
tempered likelihoods: a table that was right gains, and none is ever lost, for habits drift. What
foretells tomorrow best need not foretell next month: weights are kept for several leads, each
scored by tables as old as its forecasts are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.day_rows import DayRows
from semmap_log.analysis.probabilities.evidence.day_tables import DayTables
from semmap_log.analysis.probabilities.methods.habits import Habits, KindTables, blocks
from semmap_log.core.model.local_clock import DAYS_IN_WEEK

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
    return weights_of_days(scores, tables.rows, *_handed_out(habits, lead_d))


def foretold(
    habits: Habits, tables: DayTables, worth: Weights, mean: Weights, lead_d: int
) -> Weights:
    """Return (days, 24): what the tables said of each day, on average, so many days before it.

    Args:
        habits: As of `weights`; so are `tables` and `lead_d`.
        tables: The days.
        worth: (rows, tables), their weights.
        mean: (rows, 7, 24), what `averaged` makes of them.
        lead_d: How many days.
    """
    lag, weekday = tables.rows.before(lead_d), tables.days % DAYS_IN_WEEK
    found = mean[np.maximum(lag.row, 0), weekday]
    idle = np.flatnonzero(lag.idle_d)
    for part in blocks(0, len(idle)):
        place = idle[part]
        row, idle_d = lag.row[place], lag.idle_d[place]
        then = shared_idly(worth[row], *_handed_out(habits, lead_d), idle_d[:, None])
        found[place] = (then[:, None] @ habits.of_days(row, idle_d, weekday[place]))[:, 0]
    return found


def _handed_out(habits: Habits, lead_d: int) -> tuple[Weights, float]:
    """Return what weights are like where nothing is known, and how much a day is handed out so."""
    start = 1 / (1 + lead_d / habits.half_lives_d)
    return start / start.sum(), SHARE / (1 + lead_d)


def weights_of_days(gain: Weights, days: DayRows, start: Weights, share: float) -> Weights:
    """Return the weights of experts at each midnight, (rows + 1, …): see `shared_anew`.

    Args:
        gain: (rows, …), of each day.
        days: Which they are.
        start: Of the first midnight, too.
        share: A day.
    """
    found = np.empty((len(gain) + 1, *gain.shape[1:]))
    found[0] = start
    rows = zip(gain, days.is_gap.tolist(), days.lasts_d.tolist(), strict=True)
    for row, (of_day, is_gap, lasts_d) in enumerate(rows):
        if is_gap:
            found[row + 1] = shared_idly(found[row], start, share, lasts_d)
        else:
            found[row + 1] = shared_anew(found[row], of_day, start, share)
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


def shared_idly(
    before: Weights, start: Weights, share: float, days: int | NDArray[np.int64]
) -> Weights:
    """Return the weights of experts after so many days on which none foretold anything."""
    found: Weights = start + (1 - share) ** days * (before - start)
    return found


def averaged(worth: Weights, tables: KindTables) -> NDArray[np.float64]:
    """Return (rows, 7, 24): the mean of the tables, weighed as by `weights`."""
    found = np.empty((len(worth), DAYS_IN_WEEK, 24))
    for rows in blocks(0, len(worth)):
        of_weeks = tables.of_weeks(rows)
        means = worth[rows, None] @ of_weeks.reshape(*of_weeks.shape[:2], -1)
        found[rows] = means.reshape(found[rows].shape)
    return found


def lead_of(days_ahead: NDArray[np.int64]) -> NDArray[np.intp]:
    """Return which of `LEADS_D` speaks for so many days ahead: the greatest up to that."""
    return np.searchsorted(LEADS_D, days_ahead, "right") - 1


def _scores(habits: Habits, tables: DayTables, lead: int) -> Weights:
    """Return (days, tables): log-likelihood of each day by the tables of `lead` days before it."""
    lag = tables.rows.before(lead)
    found = np.zeros((len(tables), len(habits.half_lives_d)))
    scored = np.flatnonzero(lag.row >= 0)
    for part in blocks(0, len(scored)):
        days = scored[part]
        weekday = tables.days[days] % DAYS_IN_WEEK
        p_open = habits.of_days(lag.row[days], lag.idle_d[days], weekday)
        opened, closed = tables.open_h[days], tables.known_h[days] - tables.open_h[days]
        found[days] = np.einsum("dh,dth->dt", opened, np.log(p_open))
        found[days] += np.einsum("dh,dth->dt", closed, np.log1p(-p_open))
    return found
