"""`schedule`: how the door is at that hour of that weekday, as far as past days show.

It learns at each local midnight, and uses nothing of today. Every other estimator tends to it as
the forecast moves further ahead. The errors of sensors add to the variance of what was read, as
each midnight knew it.

Tables that are shrunk toward the hour of any day (`habits`) need months to believe in an hour of
the week that differs from that hour of other days, such as a door that opens on Wednesdays. Here
each cell of the week may have a rate of its own, by itself or with the hour before or after it,
where it forecast that cell better, week after week: spike and slab (Mitchell and Beauchamp, J. Am.
Stat. Assoc. 83, 1988), the spike being the schedule's own forecast. Weights are a fixed share's, as
in `habits`, cell by cell. How much such slots count depends on their worth for the whole door:
where a habit of many hours ends, its slots are dropped within days, not weeks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence import day_tables
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.forecast import LEAST, MOST, PRIOR_P, Forecast, Probabilities
from semmap_log.analysis.probabilities.methods.by_door import LearntByDoor
from semmap_log.analysis.probabilities.methods.effective_days import (
    EvidenceDays,
    Variances,
    lasting_of,
)
from semmap_log.analysis.probabilities.methods.habits import (
    LEADS_D,
    Habits,
    WeekCells,
    averaged,
    blocks,
    discounted,
    foretold,
    habits,
    kept,
    lead_of,
    slowest_habit,
    updated_weights,
    weekly_sums,
    weights,
)
from semmap_log.core.lazily import computed_once
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import DAY_S, DAYS_IN_WEEK, HOUR_S, LocalClock
from semmap_log.core.model.moments import HOUR_NS

Times = NDArray[np.int64]
Table = NDArray[np.float64]

STALE_D = 365
"""A schedule of which nothing was confirmed for so many days is UNKNOWN, too."""
LEAST_H = 3.0
"""Known hours at that time of day, an hour more or less: with fewer the schedule is UNKNOWN.

One whole day makes them; of a robot's rounds, a few at that time (a visit counts for what its
sensor can show, 0.64 h at an accuracy of 0.9)."""


WEEK_LEAD_D = 3
"""A typical week is forecast so many days ahead; from 0 to 28 the forecasts are equally good."""
CELLS_AT_ONCE = 4096
"""So many are looked up together, to bound memory."""


class Expected(NamedTuple):
    """A schedule's forecast: the arguments of `Forecast.around`."""

    p_open: Probabilities
    variance: Probabilities
    is_known: NDArray[np.bool_]
    effective_days: Probabilities


class DoorSchedule:
    """What was learnt about one door, as each midnight knew it."""

    def __init__(
        self, evidence: DoorEvidence, clock: LocalClock, *, with_today: bool = False
    ) -> None:
        self._evidence, self._clock = evidence, clock
        self._evidence_days = EvidenceDays(evidence, clock, with_today=with_today)
        self._tables = self._evidence_days.tables
        self._seen_h = _seen_h(self._tables)
        self._by_lead: dict[int, _OfLead] = {}

    @computed_once
    def _habits(self) -> Habits:
        return habits(self._tables)

    @computed_once
    def _slot_rates(self) -> SlotRates:
        return SlotRates(self._tables)

    @computed_once
    def _variances(self) -> Variances:
        noise = noise_of(self._evidence, self._tables, self._clock)
        lasting = lasting_of(slowest_habit(self._tables), self._tables, noise)
        return Variances(self._habits, self._tables, lasting)

    def p_open(self, times_ns: Times, known_ns: Times) -> Probabilities:
        """Return P(open) alone: see `LearntModel.predict`."""
        return self._between_hours(_OfLead.p_open_at, PRIOR_P, times_ns, known_ns)

    def expect(self, times_ns: Times, known_ns: Times) -> Expected:
        """Return P(open) with what it is based on: see `LearntModel.predict`."""
        is_known = np.zeros(len(times_ns), np.bool_)
        if len(self._seen_h):
            row = self._evidence_days.row(known_ns)
            hour = (self._clock.wall_s(times_ns) % DAY_S // HOUR_S).astype(np.int64)
            age_d = self._clock.hour_of(known_ns) // 24 - self._evidence_days.midnights[row]
            is_known = (self._seen_h[row, hour] >= LEAST_H) & (age_d <= STALE_D)
        return Expected(
            self.p_open(times_ns, known_ns),
            self._between_hours(self._variance_at, PRIOR_P**2, times_ns, known_ns),
            is_known,
            self._between_hours(_OfLead.days_at, 0.0, times_ns, known_ns),
        )

    def variance_of_hours(self, times_ns: Times) -> Probabilities:
        """Return that of P(open) through the hours that (n,) ascending times lie in, known then."""
        _, first, which = np.unique(
            self._clock.hour_of(times_ns), return_index=True, return_inverse=True
        )
        hour_ns = times_ns[first]
        wall_s = self._clock.wall_s(hour_ns)
        of_hours = self._at(self._variance_at, PRIOR_P**2, wall_s, self._evidence_days.row(hour_ns))
        found: Table = of_hours[which]
        return found

    def predict(self, times_ns: Times, known_ns: Times) -> Forecast:
        """Return forecasts: see `LearntModel.predict`."""
        return Forecast.around(*self.expect(times_ns, known_ns))

    def week(self) -> Forecast:
        """Return the forecast of a typical week, (168,) hours, Monday first.

        It rests on the evidence alone, not on the moment of the query: each hour is forecast
        `WEEK_LEAD_D` days ahead of the last midnight with evidence.
        """
        hours = np.arange(24 * DAYS_IN_WEEK)
        if not len(self._tables):
            return Forecast.of_nothing(len(hours))
        last = np.full(len(hours), len(self._tables))
        cells = WeekCells(last, hours // 24, hours % 24)
        ahead = self._of_lead(int(lead_of(np.array([WEEK_LEAD_D]))[0]))
        return Forecast.around(
            ahead.p_open_at(cells),
            ahead.variance_at(cells, self._variances),
            self._seen_h[last - 1, cells.hour] >= LEAST_H,  # the last day alone makes no week
            ahead.days_at(cells),
        )

    def _variance_at(self, so_far_ahead: _OfLead, cells: WeekCells) -> Table:
        return so_far_ahead.variance_at(cells, self._variances)

    def _between_hours(
        self, at: LookUp, otherwise: float, times_ns: Times, known_ns: Times
    ) -> Table:
        """Return values interpolated between the middle of an hour and that of the next."""
        wall_s, row = self._clock.wall_s(times_ns), self._evidence_days.row(known_ns)
        from_middle = wall_s % HOUR_S / HOUR_S - 0.5
        beside = wall_s + np.where(from_middle < 0, -HOUR_S, HOUR_S)
        here, there = (self._at(at, otherwise, shown, row) for shown in (wall_s, beside))
        found: Table = here + np.abs(from_middle) * (there - here)
        return found

    def _at(self, at: LookUp, otherwise: float, wall_s: Table, row: NDArray[np.int64]) -> Table:
        """Return what is looked up for local times, with what some midnights knew.

        Of the first midnight nothing is known: it is the same where nothing ever is.
        """
        day, in_day_s = np.divmod(wall_s, DAY_S)
        lead = lead_of(np.maximum(day - self._evidence_days.midnights[row], 0))
        cells = WeekCells(
            row, day.astype(np.int64) % DAYS_IN_WEEK, (in_day_s // HOUR_S).astype(np.int64)
        )
        found = np.full(len(row), otherwise)
        lead[row == 0] = -1
        for one in np.flatnonzero(np.bincount(lead + 1, minlength=1)[1:]).tolist():
            asked = np.flatnonzero(lead == one)
            for part in blocks(0, len(asked), CELLS_AT_ONCE):
                some = asked[part]
                found[some] = at(self._of_lead(one), WeekCells(*(column[some] for column in cells)))
        return found

    def _of_lead(self, lead: int) -> _OfLead:
        if lead not in self._by_lead:
            self._by_lead[lead] = _OfLead(self._habits, self._tables, self._slot_rates, lead)
        return self._by_lead[lead]


class _OfLead:
    """A schedule's forecasts at one lead; most leads are never requested."""

    def __init__(
        self, by_table: Habits, tables: day_tables.DayTables, slot_rates: SlotRates, lead: int
    ) -> None:
        lead_d = int(LEADS_D[lead])
        self._worth = weights(by_table, tables, lead_d)
        self._by_habit = np.clip(averaged(self._worth, by_table.p_open), LEAST, MOST)
        """P(open) without slots, (rows, 7, 24)."""
        self._days = by_table.days
        said = foretold(by_table, tables, self._worth, self._by_habit, lead_d)
        self._slots = Slots(np.clip(said, LEAST, MOST), tables, slot_rates, lead_d)

    @computed_once
    def _p_open(self) -> Table:
        """(rows, 7, 24)."""
        found = np.empty_like(self._by_habit)
        for rows in blocks(0, len(found)):
            by_habit = self._by_habit[rows].ravel()
            row, weekday, hour = np.indices(found[rows].shape).reshape(3, -1)
            own = self._slots.at(WeekCells(rows.start + row, weekday, hour), by_habit)
            here = by_habit + own.weight * (own.p_open - by_habit)
            found[rows] = here.reshape(found[rows].shape)
        return found

    def p_open_at(self, cells: WeekCells) -> Table:
        """Return P(open) there, (n,)."""
        return self._p_open[cells]

    def variance_at(self, cells: WeekCells, of_tables: Variances) -> Table:
        """Return the variance of that, (n,)."""
        by_habit = self._by_habit[cells]
        alone = of_tables.at(cells, self._worth[cells.row])
        own = self._slots.at(cells, by_habit)
        of_slot = own.p_open * (1 - own.p_open) / (own.weeks + 1)
        between = own.weight * (1 - own.weight) * (own.p_open - by_habit) ** 2
        found: Table = alone + own.weight * (of_slot - alone) + between
        return found

    def days_at(self, cells: WeekCells) -> Table:
        """Return the days of evidence that it rests on, (n,)."""
        found: Table = (self._worth[cells.row] * self._days.at(cells)).sum(1)
        return found


LookUp = Callable[[_OfLead, WeekCells], Table]


@dataclass(frozen=True, slots=True)
class Schedule:
    """The estimator."""

    name: str = "schedule"

    def learn(
        self, evidence: Mapping[DoorId, DoorEvidence], clock: LocalClock
    ) -> LearntByDoor[DoorSchedule]:
        """Return what the evidence teaches."""
        return LearntByDoor(evidence, lambda of_door: DoorSchedule(of_door, clock))


def _seen_h(tables: day_tables.DayTables) -> Table:
    """Return (rows, 24): hours known at that time of day by each midnight, an hour more or less."""
    if not len(tables):
        return np.zeros((0, 24))
    beside = sum(np.roll(tables.known_h, shift, axis=1) for shift in (-1, 0, 1))
    return np.concatenate([np.zeros((1, 24)), np.cumsum(beside, axis=0)])


Reals = NDArray[np.float64]


def noise_of(evidence: DoorEvidence, tables: day_tables.DayTables, clock: LocalClock) -> Reals:
    """Return (rows,): the variance of what a known hour says of the door, by its readings' errors.

    A corrected reading (see `day_tables`) errs by a (1 - a) / J^2, and counts as J^2 of an hour;
    several in an hour err less than one, but count no more than that hour.

    Args:
        evidence: Of the door.
        tables: Its days.
        clock: Whose days.
    """
    first = evidence.is_visit
    day = tables.rows.row(clock.hour_of(evidence.seen_ns[first]) // 24)
    own = day < len(tables)
    when_open, when_closed = (
        evidence.accuracy_open[first][own],
        evidence.accuracy_closed[first][own],
    )
    errs = (when_open * (1 - when_open) + when_closed * (1 - when_closed)) / 2

    def so_far(of_days: NDArray[Any]) -> Reals:
        return np.append(0.0, np.cumsum(of_days))

    def by_day(of_visits: Reals) -> Reals:
        return so_far(np.bincount(day[own], of_visits, len(tables)))

    edges_ns = clock.midnights_ns(tables.rows.midnights)
    held_h = day_tables.covered_ns(evidence.start_ns, evidence.end_ns, edges_ns) / HOUR_NS
    known_h = so_far(tables.known_h.sum(1))
    read_h = np.maximum(known_h - (held_h - held_h[0]), 0.0)
    evidence_h, visits = by_day((when_open + when_closed - 1) ** 2), by_day(np.ones(len(errs)))
    of_visit = by_day(errs) / np.maximum(visits, 1)
    of_hour = of_visit * np.minimum(1.0, read_h / np.maximum(evidence_h, 1e-9))
    found: Reals = of_hour * read_h / np.maximum(known_h, 1e-9)
    return found


Tables = NDArray[np.float64]
Indices = NDArray[np.int64]

BLOCKS = ((0,), (0, 1), (0, -1))
"""Hours that share a rate, counted from a cell's own: each block is an expert."""
_OFFSETS_H = sorted({hour for block in BLOCKS for hour in block})
RATES = (1.5, 0.9, 0.9)
"""How much a known hour of a block counts: those of a cell lie a week apart, and prove much."""
PRIOR = 0.015
"""The prior of a cell being a slot, all blocks together. A slot counts only by what it has earned
beyond it."""
SLAB_P, SLAB_WEEKS = 0.2, 1.0
"""A slot's rate begins at that, or at the schedule's if it is higher, as after so many weeks."""
SHARE = 0.01
"""The share of a cell's weights that is redistributed each week."""
MOST_GAIN = 3.0
"""No week proves more, nats: a slot is what comes again."""
HEARD, HEARD_SHARE = 0.8, 0.005
"""How much slots count at first, and the share of that which is redistributed each day."""
_MOST_NATS = 20.0


class OfSlots(NamedTuple):
    """The forecasts of slots, in addition to a schedule's; all (n,)."""

    weight: Tables
    """How much they count."""
    p_open: Tables
    weeks: Tables
    """Of how many weeks it is."""


class SlotRates:
    """P(open) of blocks, from their own evidence alone."""

    def __init__(self, tables: day_tables.DayTables) -> None:
        sums = discounted(weekly_sums(tables), tables.rows.lasts_d, day_tables.HALF_LIFE_D)
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
            still = kept(day_tables.HALF_LIFE_D, idle_d[..., None])
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
        at = {beside: self._weeks.take(day + (hour + beside) % 24, 1) for beside in _OFFSETS_H}
        means = [np.mean([at[beside] for beside in block], axis=0) for block in BLOCKS]
        return np.stack(means, axis=-1)


class Slots:
    """The slots of a door for forecasts of one lead, as each midnight knew them."""

    def __init__(
        self, said: Tables, tables: day_tables.DayTables, rates: SlotRates, lead_d: int
    ) -> None:
        """Find them.

        Args:
            said: (days, 24): what the schedule without them forecast for each day, `lead_d` days
                before.
            tables: The days that it is made of.
            rates: Of the same days.
            lead_d: How many days ahead they forecast.
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
        """Return their forecasts at some cells, given the schedule's, (n,)."""
        row, weekday, hour = cells
        cell = self._trials.weeks_before(row, weekday), weekday, hour
        rates = self._rates.of(schedule, cells)
        return OfSlots(
            self._earned[cell] * self._heard[row],
            (self._shares[cell] * rates).sum(-1),
            self._rates.known(cells),
        )


class _Trials(NamedTuple):
    """Each day, forecast by the table of so many days before it: indices, (days,)."""

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
    def of(cls, tables: day_tables.DayTables, lead_d: int) -> _Trials:
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
        """Return how much better one forecast the days, nats, (days, 24, ...)."""
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
        found[week + 1] = updated_weights(found[week], gained, start, share[week])
    earned: Tables = found[..., 1:]
    return earned


def _heard(gain: Tables, rows: day_tables.DayRows, lead_d: int) -> Tables:
    """Return (rows + 1,): how much slots count, given their gains on each day."""
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
