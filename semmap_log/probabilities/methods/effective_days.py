"""How many independent days the days behind a table are worth, by how long deviations last.

A door that forgets in minutes shows its habit within hours; one that stays as it is for two days
shows little in two weeks. The variance of a time average is p (1 - p) times the sum of the
residuals' correlations over the lags between what is averaged (Bartlett, J. R. Stat. Soc. 8, 1946).
Correlations are measured on the residuals of the slowest tables, `NEAR_H` and `FAR_H` hours apart,
as each midnight knew them; beyond that they fall off as a chain's do. A sensor's errors come on
top: they do not hang together.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.probabilities.evidence.day_tables import DayTables
from semmap_log.probabilities.forecast import LEAST, MOST
from semmap_log.probabilities.local_clock import DAYS_IN_WEEK
from semmap_log.probabilities.methods.averaging import Weights
from semmap_log.probabilities.methods.habits import (
    HALF_LIVES_D,
    KINDS,
    Habits,
)

Tables = NDArray[np.float64]
Reals = NDArray[np.float64]

NEAR_H, FAR_H = (1, 2), (5, 6, 7, 8)
"""So far apart residuals are held against each other; several lags, for each is noisy."""
HALF_LIFE_D = 56.0
WARM_UP_D = 3.0
"""Residuals of the first days tell of bad forecasts: day d counts d / (d + that)."""
PRIOR_FORGETS_H, PRIOR_WEIGHT = 24.0, 2.4
"""Until residuals tell, deviations are forgotten so slowly; it counts as ten hours of a door
that is as likely open as closed: a door that never changed has not shown how long it stays."""
FAST, LEAST_SIGNAL = 0.2, 0.1
"""Where residuals an hour apart hardly hang together, what is far apart has that share of it."""
FEW_TIMES = 2.0
"""A record of so many times the memory counts half: its length is not known that well."""
_MOST_KEPT = 0.995
_LEAST_SPREAD = 0.02


class Lasting(NamedTuple):
    """How much less an average proves than as many fresh tosses, as each midnight knew it."""

    of_hour: Reals
    """(rows,): the variance of averages of the same hour of different days over p (1 - p), times
    how many days there are; all lags included."""
    of_day: Reals
    """(rows,): the same of averages of whole days."""
    noise: Reals
    """(rows,): variance that sensors' errors add to what a known hour says."""

    def day_variance(self, p_open: Reals, days: Reals, row: NDArray[np.int64]) -> Reals:
        """Return the variance of the share of some days in which a door was open, all (n,)."""
        less = self.of_day[row]
        found: Reals = (p_open * (1 - p_open) * less + self.noise[row] / 24) / (days + less)
        return found


def variances(by_table: Habits, tables: DayTables, worth: Weights, lasting: Lasting) -> Tables:
    """Return (rows, leads, 7, 24): the variance of P(open) by chance, and by tables disagreeing.

    Of two tables the surer one holds what the other does, and more: they err together as far as
    the surer one errs. What the tables differ by more than such errors do is an error, too.

    Args:
        by_table: The tables.
        tables: The days that they are made of.
        worth: (rows, leads, tables), their weights.
        lasting: How long the door's deviations last.
    """
    kinds = [lasting.of_day] + [lasting.of_hour] * (len(KINDS) - 1)
    less = np.tile(np.stack(kinds, axis=1), len(HALF_LIVES_D))[..., None, None]
    errs = np.tile(np.array([1 / 24] + [1.0] * (len(KINDS) - 1)), len(HALF_LIVES_D))
    errs = (lasting.noise[:, None] * errs)[..., None, None]
    p_open, days = by_table.p_open, by_table.days * _more(by_table, tables)[..., None, None]
    chance = (p_open * (1 - p_open) * less + errs) / (days + less)

    joint = _joint(worth, (1 / (days + less)).mean((2, 3)))
    by_chance: Tables = np.einsum("rlt,rtwh->rlwh", joint, chance)
    mean = np.einsum("rlt,rtwh->rlwh", worth, p_open)
    spread = np.einsum("rlt,rtwh->rlwh", worth, p_open**2) - mean**2
    expected = np.einsum("rlt,rtwh->rlwh", worth, chance) - by_chance
    found: Tables = by_chance + np.maximum(spread - expected, 0)
    return found


def lasting_of(by_table: Habits, tables: DayTables, noise: Reals) -> Lasting:
    """Return how long deviations last.

    Args:
        by_table: Whose residuals are looked at: those of its slowest, finest table.
        tables: The days.
        noise: (rows,): variance that sensors' errors add to what a known hour says.
    """
    days = np.arange(len(tables))
    said = np.clip(by_table.p_open[days, -1, tables.days % DAYS_IN_WEEK], LEAST, MOST)
    known = tables.known_h
    residual = (tables.open_h - said * known).ravel()
    by_chance = (np.sqrt(said * (1 - said)) * known).ravel()
    counts = (days / (days + WARM_UP_D))[:, None]

    def product(of: Reals, lag_h: int) -> Reals:
        """Return (rows,): the discounted sum of products so far apart."""
        found = np.zeros(len(of))
        found[lag_h:] = of[lag_h:] * of[: len(of) - lag_h]
        return _so_far((found.reshape(-1, 24) * counts).sum(1))

    share = np.maximum(known, 1e-9)
    square = np.where(known > 0, residual.reshape(-1, 24) ** 2 / share - noise[1:, None], 0.0)
    one = np.where(known > 0, said * (1 - said) * known, 0.0)
    near, far = (
        (sum(product(residual, lag) for lag in lags) + PRIOR_WEIGHT * _forgot(lags))
        / (sum(product(by_chance, lag) for lag in lags) + PRIOR_WEIGHT * len(lags))
        for lags in (NEAR_H, FAR_H)
    )
    near = np.maximum(near, 0)
    signal = LEAST_SIGNAL**2 + 1.0 / (1.0 + np.append(0.0, np.cumsum(known.sum(1))))
    kept = (near * far + signal * FAST) / (near**2 + signal)
    per_h = -np.log(np.clip(kept, 1e-4, _MOST_KEPT)) / (np.mean(FAR_H) - np.mean(NEAR_H))
    times = 1 + per_h * np.append(0.0, np.cumsum(known.sum(1)))
    per_h *= times / (times + FEW_TIMES)
    alone = (_so_far((square * counts).sum(1)) + PRIOR_WEIGHT) / (
        _so_far((one * counts).sum(1)) + PRIOR_WEIGHT
    )
    alone = np.maximum(alone, _LEAST_SPREAD)
    first = np.minimum(near * np.exp(per_h * np.mean(NEAR_H)), 1.2)
    of_days = first / np.expm1(24 * per_h)
    of_day = (alone + 2 * first / np.expm1(per_h)) / 24
    of_hour = alone + 2 * of_days
    of_hour[0] = of_day[0] = 1.0  # nothing is known yet
    return Lasting(of_hour, of_day, noise)


def _forgot(lags_h: tuple[int, ...]) -> float:
    """Return the sum of what is kept over such lags, until residuals tell."""
    return float(np.exp(-np.array(lags_h) / PRIOR_FORGETS_H).sum())


def _joint(worth: Weights, variance: Reals) -> Weights:
    """Return weights with which the tables' variances add up to that of their weighted mean.

    With cov(i, j) = min(var i, var j) it is the sum over i of var_i w_i (w_i + 2 w_j of all j that
    are less sure).

    Args:
        worth: (rows, leads, tables).
        variance: (rows, tables), by which they are ordered.
    """
    order = np.argsort(variance, axis=1, kind="stable")[:, None]
    sorted_worth = np.take_along_axis(worth, np.broadcast_to(order, worth.shape), 2)
    behind = np.cumsum(sorted_worth[..., ::-1], -1)[..., ::-1] - sorted_worth
    found = np.empty_like(worth)
    np.put_along_axis(
        found, np.broadcast_to(order, worth.shape), sorted_worth * (sorted_worth + 2 * behind), 2
    )
    return found


def _more(by_table: Habits, tables: DayTables) -> Reals:
    """Return (rows, tables): how many even days a day of such discounts is worth, 1 to 2."""
    known = tables.known_h.sum(1) / 24
    found = np.ones((len(by_table), len(HALF_LIVES_D)))
    for place, half_life_d in enumerate(HALF_LIVES_D):
        once, twice = (_so_far(known, half_life_d / power) for power in (1, 2))
        found[:, place] = np.where(once > 0, once / np.maximum(twice, 1e-9), 1.0)
    return np.repeat(found, len(KINDS), axis=1)


def _so_far(of_days: Reals, half_life_d: float = HALF_LIFE_D) -> Reals:
    """Return (rows,): the sum over the days before each midnight, old ones discounted."""
    keep, total, found = 0.5 ** (1 / half_life_d), 0.0, [0.0]
    for new in of_days.tolist():
        total = keep * total + new
        found.append(total)
    return np.array(found)
