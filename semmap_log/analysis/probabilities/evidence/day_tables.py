"""A door's evidence by day and hour: how long its state was known, and how long it was open.

A table has a row for each local day, but few rows for a long gap. What is known of a door may lie
years apart: the robot's clock showed 1970 before it was set, or the robot was stored. A gap of more
than `LONGEST_GAP_D` days has a few rows, one of which stands for all others. Nothing is known of
those days, so that their effect on a value has a closed form. So a table costs what is known, not
the time that it spans.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.core.model.local_clock import DAYS_IN_WEEK, Hours, LocalClock
from semmap_log.core.model.moments import HOUR_NS

Table = NDArray[np.float64]

HALF_LIFE_D = 56.0
"""Days after which a day counts half, where one half-life has to do."""


@dataclass(frozen=True, slots=True)
class DayTables:
    """Hours known and hours open of a door, in each hour of each local day.

    A stretch counts by its duration, a visit as a sample of its hour: see `day_tables`.
    """

    rows: DayRows
    """Which day each row is of."""
    known_h: Table
    """(days, 24): at most what the hour lasts, 2 h in one that comes twice, 0 in one that is
    skipped."""
    open_h: Table
    """(days, 24): of these hours open. Visits of noisy sensors are corrected and not clipped: one
    cell may have less than 0, or more than `known_h`, so that sums of many are right."""

    def __len__(self) -> int:
        return len(self.known_h)

    @property
    def days(self) -> NDArray[np.int64]:
        """(days,): the days of the rows."""
        return self.rows.days

    def before(self, day: int) -> DayTables:
        """Return the rows of the days before one."""
        count = int(np.searchsorted(self.days, day))
        return DayTables(self.rows.first(count), self.known_h[:count], self.open_h[:count])


def day_tables(evidence: DoorEvidence, clock: LocalClock) -> DayTables:
    """Return the tables of a door, from the day of its first evidence to that of `until_ns`.

    The last row is of a day that has not ended (at a local midnight: has just begun): it holds
    what was known by then. Rows of days that had ended are the same whatever came later (but for
    St John's, where until 2011 a date began, and the clocks were put back to the one before).

    A visit outside of the stretches says something about its hour: a reading r of a sensor with
    accuracies a and b stands for P(open) = (r - (1 - b)) / J, with J = a + b - 1 (the correction
    of misclassified rates by Rogan and Gladen, Am. J. Epidemiol. 107, 1978), and counts as J^2 of
    an hour: its information as a share of that of a certain reading. The mean of a visit's
    sightings in an hour is one reading. Several visits in an hour count no more than that hour, and
    fill at most what the stretches leave of it.

    Of a long gap in what is known there are only the ends: see `DayRows`.

    Args:
        evidence: Of a door.
        clock: Whose days and hours.
    """
    if evidence.is_empty:
        return DayTables(DayRows.since(0, 0), np.zeros((0, 24)), np.zeros((0, 24)))
    rows = _rows(evidence, clock)
    hours = rows.hours(clock)
    place, count = rows.place(hours.hour), 24 * len(rows)

    def total(of_pieces_ns: NDArray[np.int64]) -> Table:
        return np.bincount(place, of_pieces_ns / HOUR_NS, count).astype(np.float64)

    held = total(_covered_ns(evidence.start_ns, evidence.end_ns, hours))
    held_open = total(
        _covered_ns(evidence.start_ns[evidence.is_open], evidence.end_ns[evidence.is_open], hours)
    )
    seen = _readings(evidence, rows.place(clock.hour_of(evidence.seen_ns)), count)
    free = np.maximum(total(hours.end_ns - hours.start_ns) - held, 0.0)
    seen_known = np.minimum(seen.weight, free)
    known, is_open = held + seen_known, held_open + seen_known * seen.p_open
    return DayTables(rows, known.reshape(-1, 24), is_open.reshape(-1, 24))


def _rows(evidence: DoorEvidence, clock: LocalClock) -> DayRows:
    """Return the rows of all days of which something is known, and of the last one."""
    at_once = evidence.seen_ns, np.array([evidence.until_ns])
    first, last = (
        clock.hour_of(np.concatenate([times_ns, *at_once])) // 24
        for times_ns in (evidence.start_ns, evidence.end_ns)
    )
    return DayRows.of(first, last, weekly=True)


def _covered_ns(start_ns: Times, end_ns: Times, hours: Hours) -> Times:
    """Return how much of each piece of time lies in stretches."""
    ends, starts = (covered_ns(start_ns, end_ns, ns) for ns in (hours.end_ns, hours.start_ns))
    return ends - starts


class _Readings(NamedTuple):
    """What the visits say about each hour."""

    weight: Table
    """In hours."""
    p_open: Table
    """Corrected and not clipped; 0 without an informative visit."""


def _readings(evidence: DoorEvidence, place: NDArray[np.int64], places: int) -> _Readings:
    """Return it for so many hours; (k,) are the places of those that the sightings lie in."""
    # A visit that goes on in the next hour is a visit of that one, too: a day's row, once the day
    # has ended, stays as it is.
    _, one, of_visit = np.unique(
        evidence.visit * places + place, return_index=True, return_inverse=True
    )
    tells = evidence.accuracy_open + evidence.accuracy_closed - 1.0
    excess = evidence.reads_open - (1.0 - evidence.accuracy_closed)
    count = np.maximum(np.bincount(of_visit), 1)

    def mean(of_sightings: Table) -> Table:
        return np.asarray(np.bincount(of_visit, of_sightings) / count)

    # Of each visit, and then of each hour: readings weigh by what they show, so that of sensors of
    # one kind the plain mean is corrected.
    tell, said = mean(tells**2), mean(tells * excess)
    weight_of_hour, square, excess_of_hour = (
        np.bincount(place[one], of_visits, places) for of_visits in (tell, tell**2, said)
    )
    safe = np.where(weight_of_hour > 0, weight_of_hour, 1.0)
    return _Readings(square / safe, excess_of_hour / safe)


Days = NDArray[np.int64]

LONGEST_GAP_D = 84
"""Gaps of up to so many days have a row for each day."""


class Lag(NamedTuple):
    """Midnights before those of some rows."""

    row: NDArray[np.intp]
    """(rows,): the last one that is not later; -1: there is none."""
    idle_d: Days
    """(rows,): how many days of a gap lie between the two; mostly 0."""


@dataclass(frozen=True, slots=True)
class DayRows:
    """Which days the rows are of."""

    midnights: Days
    """(rows + 1,), ascending: the day of each row, counted as in `LocalClock.midnights_ns`, and the
    day after the last."""
    is_gap: NDArray[np.bool_]
    """(rows,): the row stands for all days before the next one's; nothing is known of them."""

    @classmethod
    def since(cls, first_day: int, count: int) -> DayRows:
        """Return the rows of so many days, one after another."""
        return cls(first_day + np.arange(count + 1, dtype=np.int64), np.zeros(count, np.bool_))

    @classmethod
    def of(cls, first: Days, last: Days, *, after: int = 0, weekly: bool = False) -> DayRows:
        """Return the rows of times of which something is known, and of what lies between them.

        Args:
            first: (n,), the first day of each time, in any order; at least one.
            last: (n,), the last day of each.
            after: So many of a long gap's first days have rows.
            weekly: Only whole weeks are left out, so that each row is of the weekday that follows
                on that of the row before.
        """
        order = np.argsort(first, kind="stable")
        starts, ends = first[order], np.maximum.accumulate(last[order])
        is_long = starts[1:] - ends[:-1] - 1 > LONGEST_GAP_D
        gap = ends[:-1][is_long] + 1 + after
        begin = starts[1:][is_long]
        if weekly:
            begin = begin - (begin - gap - 1) % DAYS_IN_WEEK
        runs = zip([starts[0], *begin], [*gap, ends[-1]], strict=True)
        days = np.concatenate([np.arange(a, b + 1, dtype=np.int64) for a, b in runs])
        return cls(np.append(days, days[-1] + 1), np.isin(days, gap))

    def __len__(self) -> int:
        return len(self.is_gap)

    @property
    def days(self) -> Days:
        """(rows,): the day of each."""
        return self.midnights[:-1]

    @property
    def lasts_d(self) -> Days:
        """(rows,): how many days each stands for."""
        return np.diff(self.midnights)

    def first(self, count: int) -> DayRows:
        """Return the first rows."""
        return DayRows(self.midnights[: count + 1], self.is_gap[:count])

    def before(self, lead_d: int) -> Lag:
        """Return the midnight so many days before each row's."""
        days = self.days - lead_d
        row = self.row(days)
        return Lag(row, np.where((row >= 0) & self.is_gap[row], days - self.days[row], 0))

    def row(self, days: Days) -> NDArray[np.intp]:
        """Return the row of each day, (n,): -1 before the first, `len(self)` after the last."""
        return np.searchsorted(self.midnights, days, "right") - 1

    def place(self, hours: NDArray[np.int64]) -> NDArray[np.intp]:
        """Return the index of each hour, (n,), in the rows: 24 x row + hour."""
        return 24 * self.row(hours // 24) + hours % 24

    def hours(self, clock: LocalClock) -> Hours:
        """Return all time of the rows but that of gaps."""
        cuts = np.flatnonzero(self.is_gap)
        firsts = self.days[np.append(0, cuts + 1)].tolist()
        ends = self.midnights[np.append(cuts, len(self))].tolist()
        runs = [clock.hours(24 * a, 24 * b) for a, b in zip(firsts, ends, strict=True)]
        return Hours(*(np.concatenate(columns) for columns in zip(*runs, strict=True)))


Times = NDArray[np.int64]


def covered_ns(start_ns: Times, end_ns: Times, times_ns: Times) -> Times:
    """Return how much of the stretches lies before each time, nanoseconds.

    Args:
        start_ns: (m,), ascending.
        end_ns: (m,), <= the next start.
        times_ns: (n,).
    """
    if not len(start_ns):
        return np.zeros(len(times_ns), np.int64)
    before_ns = np.append(0, np.cumsum(end_ns - start_ns))
    last = np.searchsorted(start_ns, times_ns, "right") - 1
    inside_ns = np.minimum(times_ns, end_ns[last]) - start_ns[last]
    return np.where(last < 0, 0, before_ns[last] + inside_ns)
