"""`schedule`: how the door is at that hour of that weekday, as far as the days so far tell.

Learnt anew at each local midnight, it uses nothing of today. It is what every other estimator
tends to as the moment that it foretells moves away.

How much the errors of sensors add to the variance of what was read, as each midnight knew it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.day_tables import DayTables, covered_ns
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.forecast import LEAST, MOST, PRIOR_P, Forecast, Probabilities
from semmap_log.analysis.probabilities.methods.by_door import LearntByDoor
from semmap_log.analysis.probabilities.methods.effective_days import ToldDays, Variances, lasting_of
from semmap_log.analysis.probabilities.methods.habits import (
    LEADS_D,
    Habits,
    WeekCells,
    averaged,
    blocks,
    foretold,
    habits,
    lead_of,
    slowest_habit,
    weights,
)
from semmap_log.analysis.probabilities.methods.slots import SlotRates, Slots
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
sensor can tell, 0.64 h at an accuracy of 0.9)."""


WEEK_LEAD_D = 3
"""A typical week is forecast so many days ahead; from 0 to 28 the forecasts are equally good."""
CELLS_AT_ONCE = 4096
"""So many are looked up together, to bound memory."""


class Expected(NamedTuple):
    """What a schedule says: the arguments of `Forecast.around`."""

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
        self._days_told = ToldDays(evidence, clock, with_today=with_today)
        self._tables = self._days_told.tables
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
            row = self._days_told.row(known_ns)
            hour = (self._clock.wall_s(times_ns) % DAY_S // HOUR_S).astype(np.int64)
            age_d = self._clock.hour_of(known_ns) // 24 - self._days_told.midnights[row]
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
        of_hours = self._at(self._variance_at, PRIOR_P**2, wall_s, self._days_told.row(hour_ns))
        found: Table = of_hours[which]
        return found

    def predict(self, times_ns: Times, known_ns: Times) -> Forecast:
        """Return forecasts: see `LearntModel.predict`."""
        return Forecast.around(*self.expect(times_ns, known_ns))

    def week(self) -> Forecast:
        """Return what a week is like, (168,) hours, Monday first.

        It rests on the evidence alone, and on no moment that it is asked at: each hour is forecast
        `WEEK_LEAD_D` days ahead of the last midnight that something is known of.
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
        """Return the values of an hour's middle and the next one's, in a line from each to each."""
        wall_s, row = self._clock.wall_s(times_ns), self._days_told.row(known_ns)
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
        lead = lead_of(np.maximum(day - self._days_told.midnights[row], 0))
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
    """What a schedule says so far ahead; most leads are never asked for."""

    def __init__(
        self, by_table: Habits, tables: DayTables, slot_rates: SlotRates, lead: int
    ) -> None:
        lead_d = int(LEADS_D[lead])
        self._worth = weights(by_table, tables, lead_d)
        self._by_habit = np.clip(averaged(self._worth, by_table.p_open), LEAST, MOST)
        """(rows, 7, 24): P(open) without slots."""
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
        """Return days of evidence behind it, (n,)."""
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


def _seen_h(tables: DayTables) -> Table:
    """Return (rows, 24): hours known at that time of day by each midnight, an hour more or less."""
    if not len(tables):
        return np.zeros((0, 24))
    beside = sum(np.roll(tables.known_h, shift, axis=1) for shift in (-1, 0, 1))
    return np.concatenate([np.zeros((1, 24)), np.cumsum(beside, axis=0)])


Reals = NDArray[np.float64]


def noise_of(evidence: DoorEvidence, tables: DayTables, clock: LocalClock) -> Reals:
    """Return (rows,): the variance of what a known hour says of the door, by its readings' errors.

    A corrected reading (see `day_tables`) errs by a (1 - a) / J^2, and counts as J^2 of an hour;
    several in an hour err less than one, and still tell no more than that hour.

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
    held_h = covered_ns(evidence.start_ns, evidence.end_ns, edges_ns) / HOUR_NS
    known_h = so_far(tables.known_h.sum(1))
    read_h = np.maximum(known_h - (held_h - held_h[0]), 0.0)
    told_h, visits = by_day((when_open + when_closed - 1) ** 2), by_day(np.ones(len(errs)))
    of_visit = by_day(errs) / np.maximum(visits, 1)
    of_hour = of_visit * np.minimum(1.0, read_h / np.maximum(told_h, 1e-9))
    found: Reals = of_hour * read_h / np.maximum(known_h, 1e-9)
    return found
