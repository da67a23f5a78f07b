"""Hours of the week that are not like that hour of other days: a door that opens on Wednesdays.

Tables that are shrunk toward the hour of any day (`habits`) need months to believe in such a slot.
Here each cell of the week may have a rate of its own, by itself or with the hour before or behind
it, where it foretold that cell better, week after week: spike and slab (Mitchell and Beauchamp,
J. Am. Stat. Assoc. 83, 1988), the spike being what the schedule says anyway. Weights are a fixed
share's, as in `averaging`, cell by cell. How far slots are heard, their worth for the whole door
decides: where a habit of many hours ends, its slots are dropped within days, not weeks.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.probabilities.evidence.day_tables import DayTables
from semmap_log.probabilities.forecast import LEAST, MOST
from semmap_log.probabilities.local_clock import DAYS_IN_WEEK
from semmap_log.probabilities.methods.averaging import LEADS_D, shared_anew
from semmap_log.probabilities.methods.habits import discounted, weekly_sums

Tables = NDArray[np.float64]
Places = NDArray[np.int64]

BLOCKS = ((0,), (0, 1), (0, -1))
"""Hours that share a rate, counted from a cell's own: each block is an expert."""
RATES = (1.5, 0.9, 0.9)
"""How much a known hour of a block counts: those of a cell lie a week apart, and prove much."""
PRIOR = 0.015
"""P(a cell is a slot) before anything is known, all blocks together. It buys no hearing: only what
a slot has earned beyond it does."""
SLAB_P, SLAB_WEEKS = 0.2, 1.0
"""A slot's rate begins at that, or at the schedule's if it is higher, as after so many weeks."""
HALF_LIFE_D = 56.0
SHARE = 0.01
"""So much of a cell's weights is handed out anew each week."""
MOST_GAIN = 3.0
"""No week proves more, nats: a slot is what comes again."""
HEARD, HEARD_SHARE = 0.8, 0.005
"""How far slots are heard at first; and so much of it is handed out anew each day."""
_MOST_NATS = 20.0


class Slots(NamedTuple):
    """What slots say beside a schedule, as each midnight knew it."""

    weight: Tables
    """(rows, leads, 7, 24): how far that is heard."""
    p_open: Tables
    """(rows, leads, 7, 24)."""
    weeks: Tables
    """(rows, 1, 7, 24): of how many weeks."""


def slots(schedule: Tables, tables: DayTables) -> Slots:
    """Return the slots of a door.

    Args:
        schedule: (rows, leads, 7, 24): P(open) without them; a row for each midnight.
        tables: The days that it is made of.
    """
    schedule = np.clip(schedule, LEAST, MOST)
    rates = _Rates(tables)
    trials = _Trials.of(tables)
    said = schedule[trials.row, trials.lead, trials.weekday]
    own = rates.of(said, trials.row, trials.weekday)
    gain = trials.gain(own, said[..., None])
    weights = _weights(_pooled(gain), trials)
    earned = np.clip((weights.sum(-1) - PRIOR) / (1 - PRIOR), 0, 1)
    shares = weights / weights.sum(-1, keepdims=True)

    week = trials.weeks_before(trials.row, trials.weekday)
    mixed = (shares[week, trials.lead, trials.weekday] * own).sum(-1)
    mixed = said + earned[week, trials.lead, trials.weekday] * (mixed - said)
    heard = _heard(trials.gain(mixed[..., None], said[..., None])[..., 0].sum(-1))

    row, weekday = np.arange(len(schedule))[:, None, None], np.arange(DAYS_IN_WEEK)
    lead = np.arange(len(LEADS_D))[:, None]
    week = trials.weeks_before(row, weekday)
    p_open = (shares[week, lead, weekday] * rates.of(schedule, row, weekday)).sum(-1)
    weight = earned[week, lead, weekday] * heard[:, :, None, None]
    return Slots(weight, p_open, rates.known[:, None, ..., 0])


class _Rates:
    """P(open) of blocks by what was seen of them alone."""

    def __init__(self, tables: DayTables) -> None:
        opened, known = discounted(weekly_sums(tables), HALF_LIFE_D).swapaxes(0, 1)
        self.opened, self.known = _blocks(opened), _blocks(known)
        """(rows, 7, 24, blocks), in weeks."""

    def of(self, schedule: Tables, row: Places, weekday: Places) -> Tables:
        """Return it at rows and weekdays, (..., 24, blocks), where the schedule says (..., 24)."""
        slab = SLAB_WEEKS * np.maximum(schedule, SLAB_P)[..., None]
        found = (self.opened[row, weekday] + slab) / (self.known[row, weekday] + SLAB_WEEKS)
        return np.asarray(np.clip(found, LEAST, MOST), np.float64)


class _Trials(NamedTuple):
    """Each day, foretold by the tables of `LEADS_D` days before it: places, (days, leads)."""

    row: Places
    lead: Places
    weekday: Places
    is_known: NDArray[np.bool_]
    """False: the record begins later than that."""
    opened: Tables
    """(days, 1, 24, 1): known hours open."""
    closed: Tables
    """(days, 1, 24, 1)."""
    first_weekday: int

    @classmethod
    def of(cls, tables: DayTables) -> _Trials:
        row = np.arange(len(tables))[:, None] - LEADS_D
        known = tables.known_h[:, None, :, None]
        # A reading that is corrected below zero says that the door was closed, and no more: else
        # the nights would outvote a slot by the errors of their sensor.
        opened = np.maximum(tables.open_h[:, None, :, None], 0.0)
        return cls(
            np.maximum(row, 0),
            np.broadcast_to(np.arange(len(LEADS_D)), row.shape),
            np.broadcast_to((tables.days % DAYS_IN_WEEK)[:, None], row.shape),
            row >= 0,
            opened,
            known - opened,
            int(tables.first_day % DAYS_IN_WEEK),
        )

    def gain(self, p_open: Tables, other: Tables) -> Tables:
        """Return by how much one foretold the days better, nats, (days, leads, 24, ...)."""
        of_open, of_closed = np.log(p_open / other), np.log((1 - p_open) / (1 - other))
        found = self.opened * of_open + self.closed * of_closed
        return np.where(self.is_known[..., None, None], found, 0.0)

    def weeks_before(self, row: Places, weekday: Places) -> Places:
        """Return how often that weekday had ended by the midnights of these rows."""
        ended: Places = (self.first_weekday + row - weekday - 1) // DAYS_IN_WEEK + 1
        return ended


def _blocks(cells: Tables) -> Tables:
    """Return (..., 24, blocks): the mean over each block's hours, at the cell it counts from."""
    means = [np.mean([np.roll(cells, -hour, -1) for hour in block], axis=0) for block in BLOCKS]
    return np.stack(means, axis=-1)


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
    """Return (weeks + 1, leads, 7, 24, blocks): of each cell, after its weekday came so often."""
    place = trials.first_weekday + np.arange(len(gain))
    weeks = -(-(trials.first_weekday + len(gain)) // DAYS_IN_WEEK)
    by_week = np.zeros((weeks * DAYS_IN_WEEK, *gain.shape[1:]))
    by_week[place] = gain
    is_known = np.zeros(weeks * DAYS_IN_WEEK, np.bool_)
    is_known[place] = (trials.opened + trials.closed).any((1, 2, 3))
    leads, hours, blocks = gain.shape[1:]
    by_week = by_week.reshape(weeks, DAYS_IN_WEEK, leads, hours, blocks).swapaxes(1, 2)
    share = SHARE * is_known.reshape(weeks, 1, DAYS_IN_WEEK, 1, 1)
    # The first expert is the schedule, against which the others gain.
    gains = np.concatenate([np.zeros((*by_week.shape[:-1], 1)), by_week], axis=-1)
    start = np.array([1 - PRIOR, *[PRIOR / blocks] * blocks])
    found = np.broadcast_to(start, (weeks + 1, *gains.shape[1:])).copy()
    for week, gained in enumerate(gains):
        found[week + 1] = shared_anew(found[week], gained, start, share[week])
    earned: Tables = found[..., 1:]
    return earned


def _heard(gain: Tables) -> Tables:
    """Return (rows, leads): how far slots are heard, who gained so much on each day."""
    gain = np.clip(gain / (1 + LEADS_D / DAYS_IN_WEEK), -_MOST_NATS, _MOST_NATS)
    share = HEARD_SHARE / (1 + LEADS_D)[:, None]
    start = np.array([1 - HEARD, HEARD])
    found = np.broadcast_to(start, (len(gain) + 1, len(LEADS_D), 2)).copy()
    for day, gained in enumerate(np.stack([np.zeros_like(gain), gain], axis=-1)):
        found[day + 1] = shared_anew(found[day], gained, start, share)
    heard: Tables = found[..., 1]
    return heard
