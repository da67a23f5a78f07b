"""How many independent days the days of a table are worth, by how long deviations last.

A door that forgets in minutes shows its habit within hours; one that stays as it is for two days
shows little in two weeks. The variance of a time average is p (1 - p) times the sum of the
residuals' correlations over the lags between what is averaged (Bartlett, J. R. Stat. Soc. 8, 1946).
Correlations are measured on the residuals of the slowest tables, `NEAR_H` and `FAR_H` hours apart,
as each midnight knew them; beyond that they fall off as a chain's do. A sensor's errors are added:
they are independent.

`EvidenceDays` are the days that a door's habits are learnt from, and what each midnight knew of
them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.day_tables import HALF_LIFE_D, DayTables, day_tables
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.methods.habits import (
    HALF_LIVES_D,
    KINDS,
    Habits,
    WeekCells,
    discounted,
)
from semmap_log.core.model.local_clock import DAYS_IN_WEEK, LocalClock

Tables = NDArray[np.float64]
Reals = NDArray[np.float64]

NEAR_H, FAR_H = (1, 2), (5, 6, 7, 8)
"""So far apart residuals are correlated; several lags, since each is noisy."""
WARM_UP_D = 3.0
"""Residuals of the first days come from bad forecasts: day d counts d / (d + that)."""
PRIOR_FORGETS_H, PRIOR_WEIGHT = 24.0, 2.4
"""The prior of how slowly deviations are forgotten; it counts as ten hours of a door
that is as likely open as closed: a door that never changed has not shown how long it stays."""
FAST, LEAST_SIGNAL = 0.2, 0.1
"""If residuals an hour apart are hardly correlated, far ones have that share of it."""
FEW_TIMES = 2.0
"""A record of so many times the memory counts half: its length is not known that well."""
_MOST_KEPT = 0.995
_LEAST_SPREAD = 0.02
_MOST_NEAR = 1.2
"""Residuals of tables that are still wrong are more correlated than any door's."""


class Lasting(NamedTuple):
    """How much less an average proves than independent samples, as each midnight knew it."""

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


class Variances:
    """The variance of P(open) by chance, and by tables disagreeing.

    Of two tables the surer one holds what the other does, and more: they err together as far as
    the surer one errs. What the tables differ by more than such errors do is an error, too.
    """

    def __init__(self, by_table: Habits, tables: DayTables, lasting: Lasting) -> None:
        """Take a schedule.

        Args:
            by_table: The tables.
            tables: The days that they are made of.
            lasting: How long the door's deviations last.
        """
        self._by_table = by_table
        self._more = _more(tables)
        kinds = [lasting.of_day] + [lasting.of_hour] * (len(KINDS) - 1)
        self._less = np.tile(np.stack(kinds, axis=1), len(HALF_LIVES_D))
        """(rows, tables)."""
        errs = np.tile(np.array([1 / 24] + [1.0] * (len(KINDS) - 1)), len(HALF_LIVES_D))
        self._errs = lasting.noise[:, None] * errs
        """(rows, tables)."""

    def at(self, cells: WeekCells, worth: Reals) -> Reals:
        """Return them at some cells, (n,), where the tables have such weights, (n, tables)."""
        less = self._less[cells.row]
        p_open = self._by_table.p_open.at(cells)
        days = self._by_table.days.at(cells) * self._more[cells.row]
        chance = (p_open * (1 - p_open) * less + self._errs[cells.row]) / (days + less)
        by_chance = (_joint(worth, 1 / (days + less)) * chance).sum(1)
        mean = (worth * p_open).sum(1)
        spread = (worth * p_open**2).sum(1) - mean**2
        expected = (worth * chance).sum(1) - by_chance
        found: Reals = by_chance + np.maximum(spread - expected, 0)
        return found


def lasting_of(slowest: Tables, tables: DayTables, noise: Reals) -> Lasting:
    """Return how long deviations last.

    Args:
        slowest: (rows, 7, 24), whose residuals are looked at: `slowest_habit`.
        tables: The days.
        noise: (rows,): variance that sensors' errors add to what a known hour says.
    """
    said = slowest[np.arange(len(tables)), tables.days % DAYS_IN_WEEK]
    known, lasts_d = tables.known_h, tables.rows.lasts_d
    residual = tables.open_h - said * known
    by_chance = np.sqrt(said * (1 - said)) * known
    square = np.where(known > 0, residual**2 / np.maximum(known, 1e-9) - noise[1:, None], 0.0)
    one = said * (1 - said) * known
    lags = (*NEAR_H, *FAR_H)
    products = [_products(of, lag) for of in (residual, by_chance) for lag in lags]
    of_days = np.stack([known, *products, square, one], axis=1).sum(2)
    days = tables.days - tables.rows.midnights[0]
    of_days[:, 1:] *= (days / (days + WARM_UP_D))[:, None]
    half_lives = np.array([np.inf, *[HALF_LIFE_D] * (of_days.shape[1] - 1)])
    known_h, *sums, squares, ones = discounted(of_days, lasts_d, half_lives).T
    together, most = np.array(sums[: len(lags)]), np.array(sums[len(lags) :])

    def kept_over(hours: tuple[int, ...]) -> Reals:
        """Return (rows,): the mean remaining share of a deviation so many hours later."""
        chosen = np.isin(lags, hours)
        prior_sum = PRIOR_WEIGHT * np.exp(-np.array(hours) / PRIOR_FORGETS_H).sum()
        found: Reals = (together[chosen].sum(0) + prior_sum) / (
            most[chosen].sum(0) + PRIOR_WEIGHT * len(hours)
        )
        return found

    near, far = np.maximum(kept_over(NEAR_H), 0), kept_over(FAR_H)
    signal = LEAST_SIGNAL**2 + 1.0 / (1.0 + known_h)
    kept = (near * far + signal * FAST) / (near**2 + signal)
    per_h = -np.log(np.clip(kept, 1e-4, _MOST_KEPT)) / (np.mean(FAR_H) - np.mean(NEAR_H))
    times = 1 + per_h * known_h
    per_h *= times / (times + FEW_TIMES)
    alone = np.maximum((squares + PRIOR_WEIGHT) / (ones + PRIOR_WEIGHT), _LEAST_SPREAD)
    first = np.minimum(near * np.exp(per_h * np.mean(NEAR_H)), _MOST_NEAR)
    of_day = (alone + 2 * first / np.expm1(per_h)) / 24
    of_hour = alone + 2 * first / np.expm1(24 * per_h)
    of_hour[0] = of_day[0] = 1.0  # nothing is known yet
    return Lasting(of_hour, of_day, noise)


def _products(of_hours: Tables, lag_h: int) -> Tables:
    """Return (days, 24): each hour's value times that of so many hours before."""
    found = np.zeros(of_hours.size)
    found[lag_h:] = of_hours.ravel()[lag_h:] * of_hours.ravel()[: of_hours.size - lag_h]
    return found.reshape(of_hours.shape)


def _joint(worth: Reals, variance: Reals) -> Reals:
    """Return weights with which the tables' variances add up to that of their weighted mean.

    With cov(i, j) = min(var i, var j) it is the sum over i of var_i w_i (w_i + 2 w_j of all j that
    are less sure).

    Args:
        worth: (n, tables).
        variance: (n, tables), by which they are ordered.
    """
    order = np.argsort(variance, axis=1, kind="stable")
    by_order = np.take_along_axis(worth, order, 1)
    behind = np.cumsum(by_order[:, ::-1], -1)[:, ::-1] - by_order
    found = np.empty_like(worth)
    np.put_along_axis(found, order, by_order * (by_order + 2 * behind), 1)
    return found


def _more(tables: DayTables) -> Reals:
    """Return (rows, tables): how many even days a day of such discounts is worth, 1 to 2."""
    known = np.repeat(tables.known_h.sum(1)[:, None] / 24, len(HALF_LIVES_D), axis=1)
    lasts_d = tables.rows.lasts_d
    once, twice = (discounted(known, lasts_d, HALF_LIVES_D / power) for power in (1, 2))
    found = np.where(once > 0, once / np.maximum(twice, 1e-9), 1.0)
    return np.repeat(found, len(KINDS), axis=1)


Times = NDArray[np.int64]


class EvidenceDays:
    """Whole days up to the last with evidence; a row for each midnight between them."""

    def __init__(
        self, evidence: DoorEvidence, clock: LocalClock, *, with_today: bool = False
    ) -> None:
        """Take the evidence about a door; `with_today`: the day that has not ended counts, too."""
        self._clock = clock
        until_ns = np.array([evidence.until_ns], np.int64)
        today = int(clock.hour_of(until_ns)[0]) // 24
        tables = day_tables(evidence, clock).before(today + with_today)
        tells = np.flatnonzero(tables.known_h.any(1)) + 1
        self.tables = tables.before(int(tables.rows.midnights[tells.max(initial=0)]))
        self.midnights = self.tables.rows.midnights
        """(rows,): the day that begins then."""
        self._told = np.zeros(len(self.midnights), np.int64)
        """(rows,): the row of the last day with evidence; during a gap nothing is learnt, and what
        is known grows old."""
        self._told[tells] = tells
        np.maximum.accumulate(self._told, out=self._told)

    def row(self, known_ns: Times) -> NDArray[np.int64]:
        """Return (n,): the row of what the last midnight before each time knew."""
        known_day = self._clock.hour_of(known_ns) // 24
        return self._told[np.maximum(np.searchsorted(self.midnights, known_day, "right") - 1, 0)]
