"""Hours of the week that are not like that hour of other days: a door that opens on Wednesdays.

Tables that are shrunk toward the hour of any day (`habits`) need months to believe in such a slot.
Here each cell of the week may have a rate of its own, by itself or with the hour before or behind
it, where it foretold that cell better, week after week: spike and slab (Mitchell and Beauchamp,
J. Am. Stat. Assoc. 83, 1988), the spike being what the schedule says anyway. Weights are a fixed
share's, as in `averaging`, cell by cell. How far slots are heard, their worth for the whole door
decides: where a habit of many hours ends, its slots are dropped within days, not weeks.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.day_tables import HALF_LIFE_D, DayRows, DayTables
from semmap_log.analysis.probabilities.forecast import LEAST, MOST
from semmap_log.analysis.probabilities.methods.habits import (
    WeekCells,
    discounted,
    kept,
    shared_anew,
    weekly_sums,
)
from semmap_log.core.model.local_clock import DAYS_IN_WEEK

Tables = NDArray[np.float64]
Indices = NDArray[np.int64]

BLOCKS = ((0,), (0, 1), (0, -1))
"""Hours that share a rate, counted from a cell's own: each block is an expert."""
_BESIDE = sorted({hour for block in BLOCKS for hour in block})
RATES = (1.5, 0.9, 0.9)
"""How much a known hour of a block counts: those of a cell lie a week apart, and prove much."""
PRIOR = 0.015
"""P(a cell is a slot) before anything is known, all blocks together. It buys no hearing: only what
a slot has earned beyond it does."""
SLAB_P, SLAB_WEEKS = 0.2, 1.0
"""A slot's rate begins at that, or at the schedule's if it is higher, as after so many weeks."""
SHARE = 0.01
"""So much of a cell's weights is handed out anew each week."""
MOST_GAIN = 3.0
"""No week proves more, nats: a slot is what comes again."""
HEARD, HEARD_SHARE = 0.8, 0.005
"""How far slots are heard at first; and so much of it is handed out anew each day."""
_MOST_NATS = 20.0


class OfSlots(NamedTuple):
    """What slots say beside a schedule, all (n,)."""

    weight: Tables
    """How far that is heard."""
    p_open: Tables
    weeks: Tables
    """Of how many weeks it is."""


class SlotRates:
    """P(open) of blocks by what was seen of them alone."""

    def __init__(self, tables: DayTables) -> None:
        sums = discounted(weekly_sums(tables), tables.rows.lasts_d, HALF_LIFE_D)
        self._weeks = np.ascontiguousarray(sums.swapaxes(0, 1)).reshape(2, -1)
        """(2, cells): how many weeks each was open, and known."""

    def of(self, schedule: Tables, cells: WeekCells, idle_d: Indices | None = None) -> Tables:
        """Return it at some cells, (..., blocks).

        Args:
            schedule: (...), what the schedule says there.
            cells: (...).
            idle_d: (...), days of a gap after each row; None: 0.
        """
        slab = SLAB_WEEKS * np.maximum(schedule, SLAB_P)[..., None]
        opened, known = self._of_blocks(cells)
        if idle_d is not None:
            still = kept(HALF_LIFE_D, idle_d[..., None])
            opened, known = still * opened, still * known
        found = (opened + slab) / (known + SLAB_WEEKS)
        return np.asarray(np.clip(found, LEAST, MOST), np.float64)

    def known(self, cells: WeekCells) -> Tables:
        """Return how many weeks the cells were known, (...)."""
        row, weekday, hour = cells
        return np.asarray(self._weeks[1].take((row * DAYS_IN_WEEK + weekday) * 24 + hour))

    def _of_blocks(self, cells: WeekCells) -> Tables:
        """Return (2, ..., blocks): the mean of each block's hours, at the cells it counts from."""
        row, weekday, hour = cells
        day = (row * DAYS_IN_WEEK + weekday) * 24
        at = {beside: self._weeks.take(day + (hour + beside) % 24, 1) for beside in _BESIDE}
        means = [np.mean([at[beside] for beside in block], axis=0) for block in BLOCKS]
        return np.stack(means, axis=-1)


class Slots:
    """The slots of a door for forecasts of one lead, as each midnight knew them."""

    def __init__(self, said: Tables, tables: DayTables, rates: SlotRates, lead_d: int) -> None:
        """Find them.

        Args:
            said: (days, 24): what the schedule without them said of each day, so many days before.
            tables: The days that it is made of.
            rates: Of the same days.
            lead_d: How many days ahead they foretell.
        """
        self._rates = rates
        self._trials = trials = _Trials.of(tables, lead_d)
        cells = WeekCells(trials.row[:, None], trials.weekday[:, None], np.arange(24)[None])
        own = self._rates.of(said, cells, trials.idle_d[:, None])
        weights = _weights(_pooled(trials.gain(own, said[..., None])), trials)
        self._earned = np.clip((weights.sum(-1) - PRIOR) / (1 - PRIOR), 0, 1)
        """(weeks + 1, 7, 24)."""
        self._shares = weights / weights.sum(-1, keepdims=True)
        """(weeks + 1, 7, 24, blocks)."""
        week = trials.weeks_before(trials.row, trials.weekday)
        mixed = (self._shares[week, trials.weekday] * own).sum(-1)
        mixed = said + self._earned[week, trials.weekday] * (mixed - said)
        gain = trials.gain(mixed[..., None], said[..., None]).sum((1, 2))
        self._heard = _heard(gain, tables.rows, lead_d)
        """(rows,)."""

    def at(self, cells: WeekCells, schedule: Tables) -> OfSlots:
        """Return what they say at some cells, where the schedule says (n,)."""
        row, weekday, hour = cells
        cell = self._trials.weeks_before(row, weekday), weekday, hour
        rates = self._rates.of(schedule, cells)
        return OfSlots(
            self._earned[cell] * self._heard[row],
            (self._shares[cell] * rates).sum(-1),
            self._rates.known(cells),
        )


class _Trials(NamedTuple):
    """Each day, foretold by the table of so many days before it: places, (days,)."""

    row: Indices
    idle_d: Indices
    """(days,): days of a gap after that row."""
    weekday: Indices
    is_known: NDArray[np.bool_]
    """(days,), False: the record begins later than that."""
    opened: Tables
    """(days, 24, 1): known hours open."""
    closed: Tables
    """(days, 24, 1)."""
    first_weekday: int

    @classmethod
    def of(cls, tables: DayTables, lead_d: int) -> _Trials:
        lag = tables.rows.before(lead_d)
        known = tables.known_h[..., None]
        # A reading that is corrected below zero says that the door was closed, and no more: else
        # the nights would outvote a slot by the errors of their sensor.
        opened = np.maximum(tables.open_h[..., None], 0.0)
        return cls(
            np.maximum(lag.row, 0),
            lag.idle_d,
            tables.days % DAYS_IN_WEEK,
            lag.row >= 0,
            opened,
            known - opened,
            int(tables.rows.midnights[0] % DAYS_IN_WEEK),
        )

    def gain(self, p_open: Tables, other: Tables) -> Tables:
        """Return by how much one foretold the days better, nats, (days, 24, ...)."""
        of_open, of_closed = np.log(p_open / other), np.log((1 - p_open) / (1 - other))
        found = self.opened * of_open + self.closed * of_closed
        return np.where(self.is_known[:, None, None], found, 0.0)

    def weeks_before(self, row: Indices, weekday: Indices) -> Indices:
        """Return how often that weekday had ended by the midnights of these rows."""
        ended: Indices = (self.first_weekday + row - weekday - 1) // DAYS_IN_WEEK + 1
        return ended


def _pooled(gain: Tables) -> Tables:
    """Return what each block of (..., 24, blocks) gained over its hours, bounded."""
    found = np.stack(
        [
            rate * np.sum([np.roll(gain[..., i], -hour, -1) for hour in block], axis=0)
            for i, (block, rate) in enumerate(zip(BLOCKS, RATES, strict=True))
        ],
        axis=-1,
    )
    return np.asarray(np.clip(found, -_MOST_NATS, MOST_GAIN), np.float64)


def _weights(gain: Tables, trials: _Trials) -> Tables:
    """Return (weeks + 1, 7, 24, blocks): of each cell, after its weekday came so often."""
    place = trials.first_weekday + np.arange(len(gain))
    weeks = -(-(trials.first_weekday + len(gain)) // DAYS_IN_WEEK)
    # The first expert is the schedule, against which the others gain.
    gains = np.zeros((weeks * DAYS_IN_WEEK, *gain.shape[1:-1], gain.shape[-1] + 1))
    gains[place, :, 1:] = gain
    of_days = np.zeros(weeks * DAYS_IN_WEEK)
    of_days[place] = SHARE * (trials.opened + trials.closed).any((1, 2))
    gains = gains.reshape(weeks, DAYS_IN_WEEK, *gains.shape[1:])
    share = of_days.reshape(weeks, DAYS_IN_WEEK, 1, 1)
    start = np.array([1 - PRIOR, *[PRIOR / len(BLOCKS)] * len(BLOCKS)])
    found = np.empty((weeks + 1, *gains.shape[1:]))
    found[0] = start
    for week, gained in enumerate(gains):
        found[week + 1] = shared_anew(found[week], gained, start, share[week])
    earned: Tables = found[..., 1:]
    return earned


def _heard(gain: Tables, rows: DayRows, lead_d: int) -> Tables:
    """Return (rows + 1,): how far slots are heard, who gained so much on each day."""
    share = HEARD_SHARE / (1 + lead_d)
    found = [HEARD]
    nats = np.clip(gain / (1 + lead_d / DAYS_IN_WEEK), -_MOST_NATS, _MOST_NATS)
    days = zip(nats.tolist(), rows.is_gap.tolist(), rows.lasts_d.tolist(), strict=True)
    for of_day, is_gap, lasts_d in days:
        if is_gap:
            found.append(HEARD + (1 - share) ** lasts_d * (found[-1] - HEARD))
            continue
        odds = found[-1] / (1 - found[-1]) * math.exp(of_day)
        found.append((1 - share) * odds / (1 + odds) + share * HEARD)
    return np.array(found)
