"""`schedule`: how the door is at that hour of that weekday, as far as the days so far tell.

Learnt anew at each local midnight, it uses nothing of today. It is what every other estimator
tends to as the moment that it foretells moves away.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.common.late_dataclass import dataclass
from semmap_log.domain.doors import DoorId
from semmap_log.probabilities.evidence.day_tables import DayTables
from semmap_log.probabilities.evidence.evidence import DoorEvidence
from semmap_log.probabilities.forecast import PRIOR_P, Forecast, Probabilities
from semmap_log.probabilities.local_clock import DAY_S, DAYS_IN_WEEK, HOUR_S, LocalClock
from semmap_log.probabilities.methods.averaging import lead_of, weights
from semmap_log.probabilities.methods.by_door import LearntByDoor
from semmap_log.probabilities.methods.effective_days import lasting_of, variances
from semmap_log.probabilities.methods.habits import habits, slowest_habit
from semmap_log.probabilities.methods.sensor_noise import noise_of
from semmap_log.probabilities.methods.slots import slots
from semmap_log.probabilities.methods.told_days import ToldDays

Times = NDArray[np.int64]
Table = NDArray[np.float64]

STALE_D = 365
"""A schedule of which nothing was confirmed for so many days is UNKNOWN, too."""
LEAST_H = 3.0
"""Known hours at that time of day, an hour more or less: with fewer the schedule is UNKNOWN.

One whole day makes them; of a robot's rounds, a few at that time (a visit counts for what its
sensor can tell, 0.64 h at an accuracy of 0.9)."""


class Expected(NamedTuple):
    """What a schedule says: the arguments of `Forecast.around`."""

    p_open: Probabilities
    variance: Probabilities
    is_known: NDArray[np.bool_]
    effective_days: Probabilities


class DoorSchedule:
    """What was learnt about one door, as each midnight knew it."""

    def __init__(self, evidence: DoorEvidence, clock: LocalClock) -> None:
        self._clock = clock
        self._days_told = ToldDays(evidence, clock)
        tables = self._days_told.tables
        self._first_day = tables.first_day
        self._seen_h = _seen_h(tables)
        if not len(tables):
            return
        by_table = habits(tables)
        worth = weights(by_table, tables)
        by_habit: Table = np.einsum("rlt,rtwh->rlwh", worth, by_table.p_open)
        own = slots(by_habit, tables)
        self._p_open: Table = by_habit + own.weight * (own.p_open - by_habit)
        """(rows, leads, 7, 24)."""
        self._days: Table = np.einsum("rlt,rtwh->rlwh", worth, by_table.days)
        lasting = lasting_of(slowest_habit(tables), tables, noise_of(evidence, tables, clock))
        by_habit_alone = variances(by_table, tables, worth, lasting)
        of_slot = own.p_open * (1 - own.p_open) / (own.weeks + 1)
        between = own.weight * (1 - own.weight) * (own.p_open - by_habit) ** 2
        self._variance: Table = by_habit_alone + own.weight * (of_slot - by_habit_alone) + between
        # Of the first midnight nothing is known: the same, bit for bit, as where nothing ever is.
        self._p_open[0], self._variance[0], self._days[0] = PRIOR_P, PRIOR_P**2, 0.0

    def p_open(self, times_ns: Times, known_ns: Times) -> Probabilities:
        """Return P(open) alone: see `LearntModel.predict`."""
        if not len(self._seen_h):
            return np.full(len(times_ns), PRIOR_P)
        return self._between_hours(self._p_open, times_ns, known_ns)

    def expect(self, times_ns: Times, known_ns: Times) -> Expected:
        """Return P(open) with what it is based on: see `LearntModel.predict`."""
        if not len(self._seen_h):
            nothing = np.zeros(len(times_ns))
            return Expected(nothing + PRIOR_P, nothing + PRIOR_P**2, nothing > 0, nothing)
        row, _, _, hour = self._places(self._clock.wall_s(times_ns), known_ns)
        age_d = self._clock.hour_of(known_ns) // 24 - (self._first_day + row)
        return Expected(
            self._between_hours(self._p_open, times_ns, known_ns),
            self._between_hours(self._variance, times_ns, known_ns),
            is_known=(self._seen_h[row, hour] >= LEAST_H) & (age_d <= STALE_D),
            effective_days=self._between_hours(self._days, times_ns, known_ns),
        )

    def predict(self, times_ns: Times, known_ns: Times) -> Forecast:
        """Return forecasts: see `LearntModel.predict`."""
        return Forecast.around(*self.expect(times_ns, known_ns))

    def _between_hours(self, table: Table, times_ns: Times, known_ns: Times) -> Table:
        """Return a table's values, from the middle of one hour to that of the next in a line."""
        wall_s = self._clock.wall_s(times_ns)
        from_middle = wall_s % HOUR_S / HOUR_S - 0.5
        beside = wall_s + np.where(from_middle < 0, -HOUR_S, HOUR_S)
        here, there = (table[self._places(at, known_ns)] for at in (wall_s, beside))
        found: Table = here + np.abs(from_middle) * (there - here)
        return found

    def _places(
        self, wall_s: Table, known_ns: Times
    ) -> tuple[NDArray[np.int64], NDArray[np.intp], NDArray[np.int64], NDArray[np.int64]]:
        """Return (row, lead, weekday, hour) of local times, with what the last midnight knew."""
        row = self._days_told.row(known_ns)
        day = (wall_s // DAY_S).astype(np.int64)
        lead = lead_of(np.maximum(day - (self._first_day + row), 0))
        return row, lead, day % DAYS_IN_WEEK, (wall_s % DAY_S // HOUR_S).astype(np.int64)


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
