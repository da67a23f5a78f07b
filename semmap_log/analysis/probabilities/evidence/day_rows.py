"""Local days as the rows of a table, in which a long gap between them takes few rows.

What is known of a door may lie years apart: the robot's clock showed 1970 before it was set, or the
robot was stored. A table has a row for each day; but of a gap of more than `LONGEST_GAP_D` days it
has few, and one that stands for all others. Nothing is known of them, so that what they make of a
value has a closed form. So a table costs what is known, not the time that it spans.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.model.local_clock import DAYS_IN_WEEK, Hours, LocalClock

Days = NDArray[np.int64]

LONGEST_GAP_D = 84
"""So many days of which nothing is known all have rows of their own."""


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
        """Return what stands for the midnight so many days before each row's."""
        days = self.days - lead_d
        row = self.row(days)
        return Lag(row, np.where((row >= 0) & self.is_gap[row], days - self.days[row], 0))

    def row(self, days: Days) -> NDArray[np.intp]:
        """Return the row of each day, (n,): -1 before the first, `len(self)` after the last."""
        return np.searchsorted(self.midnights, days, "right") - 1

    def place(self, hours: NDArray[np.int64]) -> NDArray[np.intp]:
        """Return the place of each hour, (n,), of those that the rows have: 24 x row + hour."""
        return 24 * self.row(hours // 24) + hours % 24

    def hours(self, clock: LocalClock) -> Hours:
        """Return all time of the rows but that of gaps."""
        cuts = np.flatnonzero(self.is_gap)
        firsts = self.days[np.append(0, cuts + 1)].tolist()
        ends = self.midnights[np.append(cuts, len(self))].tolist()
        runs = [clock.hours(24 * a, 24 * b) for a, b in zip(firsts, ends, strict=True)]
        return Hours(*(np.concatenate(columns) for columns in zip(*runs, strict=True)))
