"""A door's habits: P(open) by hour and weekday, as each local midnight would have had it.

Each table is shrunk toward a coarser one: the hour of a weekday to that of working days or
weekends, that to the hour of any day, that to the adjacent hours, and all to the mean. Weights are
in days: an hour that was open throughout is one observation, however often it was looked at. Old
days count less, by several half-lives at once.

Bayesian averaging decides which table to believe, by how well each forecast the past. The weights
are those of Herbster and Warmuth's fixed share (Machine Learning 32, 1998) over tempered
likelihoods: a table that was right gains, and none is ever lost, since habits drift. What forecasts
tomorrow best need not forecast next month: weights are kept for several leads, each scored by
tables as old as its forecasts are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.day_tables import DayRows, Days, DayTables
from semmap_log.analysis.probabilities.forecast import LEAST, MOST, PRIOR_P
from semmap_log.core.model.local_clock import DAYS_IN_WEEK, WORKING_DAYS

Weights = NDArray[np.float64]

LEADS_D = np.array([0, 1, 3, 7, 14, 28, 56])
"""Days from the midnight at which the evidence ends to the forecast day."""
RATE = 0.25
"""A known hour counts as a quarter of an independent observation: a day's hours are correlated."""
SHARE = 0.02
"""The share of the weight that is redistributed each day."""


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
    """Return (days, 24): the tables' average forecast of each day, made `lead_d` days before it.

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
    """Return the prior weights, and the share of them that is redistributed each day."""
    start = 1 / (1 + lead_d / habits.half_lives_d)
    return start / start.sum(), SHARE / (1 + lead_d)


def weights_of_days(gain: Weights, days: DayRows, start: Weights, share: float) -> Weights:
    """Return the weights of experts at each midnight, (rows + 1, …): see `updated_weights`.

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
            found[row + 1] = updated_weights(found[row], of_day, start, share)
    return found


def updated_weights(
    before: Weights, gain: Weights, start: Weights, share: Weights | float
) -> Weights:
    """Return the weights of experts, along the last axis, after a forecast.

    Args:
        before: Their weights before, which add up to 1.
        gain: Log-likelihood of what came, by each.
        start: The prior weights.
        share: How much is redistributed, by that.
    """
    gained = before * np.exp(gain - gain.max(-1, keepdims=True))
    gained /= gained.sum(-1, keepdims=True)
    found: Weights = (1 - share) * gained + share * start
    return found


def shared_idly(
    before: Weights, start: Weights, share: float, days: int | NDArray[np.int64]
) -> Weights:
    """Return the weights of experts after so many days without a forecast."""
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
    """Return which of `LEADS_D` stands for so many days ahead: the greatest up to that."""
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


Tables = NDArray[np.float64]

HALF_LIVES_D = np.array([1.0, 3.0, 7.0, 14.0, 28.0, 90.0, np.inf])
"""Days after which a day counts half."""
_HALF_LIVES = HALF_LIVES_D[:, None, None, None]
KINDS = ("mean", "hour", "day type and hour", "weekday and hour")
"""How fine a table is, from coarse to fine."""

PRIOR_DAYS = 0.1
"""The weight of `PRIOR_P`, days: it vanishes after the first one."""
HOUR_DAYS, WEEK_DAYS = 2.0, 4.0
"""How many days the coarser table counts, where a finer one has evidence of its own."""
NEIGHBOURS_H = 1.5
"""Other hours count e^(-distance / that)."""
ROWS_AT_ONCE = 128


class WeekCells(NamedTuple):
    """WeekCells of tables by midnight, weekday and hour, all (n,)."""

    row: NDArray[np.int64]
    """The midnight at which the evidence ends."""
    weekday: NDArray[np.int64]
    hour: NDArray[np.int64]


class KindTables(NamedTuple):
    """Tables of a week of all half-lives and kinds: table i x kinds + k is of half-life i, kind k.

    Values that are equal for several hours are stored once: (rows, half-lives), then hours of a
    day, and before them day types or weekdays, if the kind distinguishes these.
    """

    kinds: Sequence[Tables]
    """Of each kind, from coarse to fine."""

    @classmethod
    def joined(cls, parts: Sequence[KindTables]) -> KindTables:
        """Return those of rows that follow on each other."""
        return cls([np.concatenate(kind) for kind in zip(*(p.kinds for p in parts), strict=True)])

    def at(self, cells: WeekCells) -> Tables:
        """Return their P(open) at some cells, (n, tables)."""
        row, weekday, hour = cells
        parts = (
            part[row] if part.ndim == 2
            else part[row, :, hour] if part.ndim == 3
            else part[row, :, _day(part, weekday), hour]
            for part in self.kinds
        )  # fmt: skip
        return np.stack([*parts], axis=-1).reshape(len(row), -1)

    def of_days(self, row: NDArray[np.int64], weekday: NDArray[np.int64]) -> Tables:
        """Return the P(open) of some rows for a weekday each, (n, tables, 24)."""
        parts = (
            part[row, ..., None] if part.ndim == 2
            else part[row] if part.ndim == 3
            else part[row, :, _day(part, weekday)]
            for part in self.kinds
        )  # fmt: skip
        found = np.stack(np.broadcast_arrays(*parts, np.empty(24))[:-1], axis=2)
        return found.reshape(len(row), -1, 24)

    def of_weeks(self, rows: slice) -> Tables:
        """Return the P(open) of some rows, (rows, tables, 7, 24)."""
        whole = [np.empty((*self.kinds[0][rows].shape, DAYS_IN_WEEK, 24)) for _ in self.kinds]
        for found, part in zip(whole, self.kinds, strict=True):
            told = part[rows].reshape(
                *part[rows].shape[:2], *(1,) * (4 - part.ndim), *part.shape[2:]
            )
            found[:] = _each_weekday(told) if told.shape[2] == 2 else told
        return np.stack(whole, axis=2).reshape(len(whole[0]), -1, DAYS_IN_WEEK, 24)

    def clipped(self) -> KindTables:
        """Return the same, having kept its numbers within what a forecast may say."""
        for part in self.kinds:
            np.clip(part, LEAST, MOST, out=part)
        return self


class GapSums(NamedTuple):
    """What the tables of some rows are made of: of those that stand for gaps."""

    rows: NDArray[np.intp]
    """(gaps,), ascending."""
    sums: Tables
    """(gaps, half-lives, 2, 7, 24): as `discounted` returns them."""
    undiscounted: Tables
    """(gaps,): P(open) at any time."""

    def p_open(self, row: NDArray[np.intp], idle_d: Days) -> KindTables:
        """Return P(open) so many days later, (n,), than some rows."""
        place = np.searchsorted(self.rows, row)
        part = kept(_HALF_LIVES, idle_d.reshape(-1, 1, 1, 1, 1))
        p_open, _ = _shrunk(part * self.sums[place], self.undiscounted[place, None])
        return p_open.clipped()


@dataclass(frozen=True, slots=True)
class Habits:
    """The tables of a door, a row for each midnight of the days: row i holds those before it."""

    p_open: KindTables
    """P(open) of each hour of the week, Monday first."""
    days: KindTables
    """How many days of evidence each is based on."""
    half_lives_d: Tables
    """(tables,)."""
    gaps: GapSums

    def of_days(self, row: NDArray[np.intp], idle_d: Days, weekday: NDArray[np.int64]) -> Tables:
        """Return P(open) as some rows say of a weekday each, (n, tables, 24).

        Args:
            row: (n,).
            idle_d: (n,), days of a gap after the row; what was learnt before them has grown old.
            weekday: (n,).
        """
        found = self.p_open.of_days(row, weekday)
        idle = np.flatnonzero(idle_d)
        if len(idle):
            then = self.gaps.p_open(row[idle], idle_d[idle])
            found[idle] = then.of_days(np.arange(len(idle)), weekday[idle])
        return found


def habits(tables: DayTables) -> Habits:
    """Return the habits of a door, from the first day on to the end of the last one.

    They are made some rows at a time: sums of all half-lives would fill memory.

    Args:
        tables: Of whole days.
    """
    sums = weekly_sums(tables)
    lasts_d = tables.rows.lasts_d
    undiscounted = _mean(discounted(sums, lasts_d, np.inf), np.full(len(sums) + 1, PRIOR_P))
    first = np.zeros((len(HALF_LIVES_D), *sums.shape[1:]))
    made: list[tuple[KindTables, KindTables]] = []
    gaps = [np.zeros((0, *first.shape))]
    for rows in blocks(0, len(sums) or 1):
        each = np.broadcast_to(sums[rows, None], (len(sums[rows]), *first.shape))
        by_half_life = discounted(each, lasts_d[rows], _HALF_LIVES, first)
        first = by_half_life[-1]
        # What the last of them leaves is the first of the next ones.
        here = by_half_life if rows.stop >= len(sums) else by_half_life[:-1]
        made.append(_shrunk(here, undiscounted[rows.start : rows.start + len(here), None]))
        gaps.append(here[: len(each)][tables.rows.is_gap[rows]])
    p_open, days = (KindTables.joined(of) for of in zip(*made, strict=True))
    is_gap = np.flatnonzero(tables.rows.is_gap)
    return Habits(
        p_open.clipped(),
        days,
        np.repeat(HALF_LIVES_D, len(KINDS)),
        GapSums(is_gap, np.concatenate(gaps), undiscounted[is_gap]),
    )


def slowest_habit(tables: DayTables) -> Tables:
    """Return (rows, 7, 24): the finest table that forgets nothing, the last of `habits`."""
    sums = discounted(weekly_sums(tables), tables.rows.lasts_d, np.inf)
    p_open, _ = _shrunk(sums, _mean(sums, np.full(len(sums), PRIOR_P)))
    return np.clip(p_open.kinds[-1], LEAST, MOST)


def weekly_sums(tables: DayTables) -> Tables:
    """Return (days, 2, 7, 24): hours open and known of each day, at its weekday."""
    rows = np.arange(len(tables))
    sums = np.zeros((len(tables), 2, DAYS_IN_WEEK, 24))
    sums[rows, 0, tables.days % DAYS_IN_WEEK] = tables.open_h
    sums[rows, 1, tables.days % DAYS_IN_WEEK] = tables.known_h
    return sums


def discounted(
    sums: Tables, lasts_d: Days, half_life_d: float | Tables, first: float | Tables = 0.0
) -> Tables:
    """Return (rows + 1, …): at each midnight, the days before it, old ones discounted.

    Args:
        sums: (rows, …), of each day.
        lasts_d: (rows,), how many days each row stands for.
        half_life_d: One, or one for each column.
        first: What is there before all of them.
    """
    keep = kept(half_life_d, 1)
    found = np.empty((len(sums) + 1, *sums.shape[1:]))
    found[0] = first
    for row, (new, days) in enumerate(zip(sums, lasts_d.tolist(), strict=True)):
        np.multiply(found[row], keep if days == 1 else kept(half_life_d, days), out=found[row + 1])
        found[row + 1] += new
    return found


def kept(half_life_d: float | Tables, days: int | Days) -> Any:
    """Return the remaining weight of a day so many days later."""
    return 0.5 ** (days / half_life_d)


def blocks(first: int, end: int, most: int = ROWS_AT_ONCE) -> Iterator[slice]:
    """Yield a range of rows, some at a time: all would fill memory."""
    for start in range(first, end, most):
        yield slice(start, min(start + most, end))


def _mean(sums: Tables, prior: Tables) -> Tables:
    """Return (…): P(open) at any time, of discounted sums, (…, 2, 7, 24)."""
    of_all = sums.sum((-2, -1)) / 24
    found: Tables = (of_all[..., 0] + PRIOR_DAYS * prior) / (of_all[..., 1] + PRIOR_DAYS)
    return found


def _shrunk(sums: Tables, prior: Tables) -> tuple[KindTables, KindTables]:
    """Return P(open) and days of evidence of discounted sums.

    Args:
        sums: (…, 2, 7, 24).
        prior: (…), P(open) where all that was seen is long ago.
    """
    opened, known = sums[..., 0, :, :], sums[..., 1, :, :]
    of_day = opened.sum(-2), known.sum(-2)
    known_days = of_day[1].sum(-1) / 24
    mean = _mean(sums, prior)[..., None]

    hour = _level(*of_day, mean, HOUR_DAYS)
    of_type = _by_day_type(opened), _by_day_type(known)
    day_type = _level(*of_type, hour[0][..., None, :], WEEK_DAYS)
    weekday = _toward(opened, known, _each_weekday(day_type[0]), WEEK_DAYS)

    p_open = mean[..., 0], hour[0], day_type[0], weekday
    days = known_days, hour[1], day_type[1], day_type[1]
    return KindTables(p_open), KindTables(days)


def _level(
    opened: Tables, known: Tables, coarser: Tables, weight_days: float
) -> tuple[Tables, Tables]:
    """Return a table shrunk toward adjacent hours, these toward a coarser table, and its days.

    Where an hour was never seen, its neighbours speak for it, and far from all of them the day.
    """
    beside = opened @ _NEIGHBOURS, known @ _NEIGHBOURS
    near = _toward(*beside, coarser, weight_days)
    days = known + weight_days * beside[1] / (beside[1] + weight_days)
    return _toward(opened, known, near, weight_days), days


def _toward(opened: Tables, known: Tables, coarser: Tables, weight_days: float) -> Tables:
    return (opened + weight_days * coarser) / (known + weight_days)


def _by_day_type(table: Tables) -> Tables:
    """Return (…, 2, 24) of (…, 7, 24): working days, weekends."""
    parts = table[..., :WORKING_DAYS, :].sum(-2), table[..., WORKING_DAYS:, :].sum(-2)
    return np.stack(parts, axis=-2)


def _day(table: Tables, weekday: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the index of weekdays in a table: their day types, or the weekdays themselves."""
    return weekday if table.shape[2] == DAYS_IN_WEEK else weekday // WORKING_DAYS


def _each_weekday(table: Tables) -> Tables:
    """Return (…, 7, 24) of (…, 2, 24)."""
    return np.repeat(table, [WORKING_DAYS, DAYS_IN_WEEK - WORKING_DAYS], axis=-2)


def _neighbours() -> Tables:
    """Return (24, 24): how much each hour counts for each other; midnight is next to 23:00."""
    apart = np.abs(np.arange(24)[:, None] - np.arange(24))
    weights: Tables = np.exp(-np.minimum(apart, 24 - apart) / NEIGHBOURS_H)
    return weights


_NEIGHBOURS = _neighbours()
