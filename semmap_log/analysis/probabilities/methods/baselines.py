"""What better methods are compared with: the constant, and plain tables by hour of day or week.

They take readings for true, know of no sensor's errors, and count all days the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.evidence.samples import KnownTime
from semmap_log.analysis.probabilities.forecast import PRIOR_P, Forecast
from semmap_log.analysis.probabilities.methods.by_door import LearntByDoor
from semmap_log.core.batches.event_batch import distinct, numbers_of
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import DAY_S, HOUR_S, WEEK_S, LocalClock

Times = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class HourTable:
    """Share of the known time that the door was open, by the hour of a period.

    An hour that was never seen gets the share of all hours.
    """

    name: str
    period_s: int
    """The table has an entry for each hour of it."""

    def learn(
        self, evidence: Mapping[DoorId, DoorEvidence], clock: LocalClock
    ) -> LearntByDoor[DoorHours]:
        """Return the tables of all doors, each computed on request."""
        return LearntByDoor(evidence, lambda door: DoorHours(door, clock, self.period_s))


@dataclass(frozen=True, slots=True)
class Constant:
    """Share of all the known time that the door was open."""

    name: str = "constant"

    def learn(
        self, evidence: Mapping[DoorId, DoorEvidence], clock: LocalClock
    ) -> LearntByDoor[DoorHours]:
        """Return the shares of all doors."""
        return LearntByDoor(evidence, lambda door: DoorHours(door, clock, None))


CONSTANT = Constant()
HOUR_OF_DAY = HourTable("hour_of_day", DAY_S)
HOUR_OF_WEEK = HourTable("hour_of_week", WEEK_S)


class DoorHours:
    """A table by hour, as of any time: it contains what was known by then."""

    def __init__(self, evidence: DoorEvidence, clock: LocalClock, period_s: int | None) -> None:
        """Take a door.

        Args:
            evidence: Of the door.
            clock: Whose hours.
            period_s: None: only the share of all hours.
        """
        self._period_s = period_s
        self._table = _Table(KnownTime.of(evidence), clock, period_s)

    def predict(self, times_ns: Times, known_ns: Times) -> Forecast:
        """Return the share of the known time up to `known_ns` that the door was open."""
        open_s, all_s = self._table.time.until(known_ns)
        is_known = all_s > 0
        p, counted_s = _share(open_s, all_s), all_s
        if self._period_s is not None:
            open_s, all_s = self._table.in_hour(times_ns, known_ns)
            p, counted_s = np.where(all_s > 0, _share(open_s, all_s), p), all_s
        days = counted_s / (HOUR_S if self._period_s else DAY_S)
        return Forecast.of_share(p, days, is_known)


class _Table:
    """Seconds known, and open, of a door by day and hour, summed up over the days."""

    def __init__(self, time: KnownTime, clock: LocalClock, period_s: int | None) -> None:
        self.time = time
        self._clock = clock
        self._period_s = period_s or DAY_S
        if period_s is not None:
            self._sum_up()

    def _sum_up(self) -> None:
        """Sum up what is in each hour of the period, period by period of those that were seen."""
        time = self.time
        ends = np.sort([self._period(ns) for ns in (time.start_ns, time.end_ns)], axis=0)
        held = numbers_of(ends[0], ends[1] - ends[0] + 1)
        self._periods = distinct(np.concatenate([held, self._period(time.seen_ns)]))
        hours = self._period_s // HOUR_S
        edges_s = self._periods[:, None] * self._period_s + np.arange(hours + 1) * HOUR_S
        edges_ns = self._clock.instants_ns(edges_s.ravel().astype(np.float64))
        sums = np.stack(self.time.until(edges_ns)).reshape(2, *edges_s.shape)
        cells = np.diff(sums, axis=2)
        self._before = np.concatenate([np.zeros((2, 1, hours)), np.cumsum(cells, axis=1)], axis=1)

    def _period(self, times_ns: Times) -> Times:
        return (self._clock.wall_s(times_ns) // self._period_s).astype(np.int64)

    def in_hour(
        self, times_ns: Times, known_ns: Times
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return (seconds open, seconds known) in the hours of `times_ns` before `known_ns`."""
        hour = (self._clock.wall_s(times_ns) % self._period_s // HOUR_S).astype(np.int64)
        period = self._period(known_ns)
        begin_s = (period * self._period_s + hour * HOUR_S).astype(np.float64)
        begin_ns = np.minimum(self._clock.instants_ns(begin_s), known_ns)
        end_ns = np.minimum(self._clock.instants_ns(begin_s + HOUR_S), known_ns)
        open_now, all_now = (
            end - begin
            for end, begin in zip(self.time.until(end_ns), self.time.until(begin_ns), strict=True)
        )
        open_s, all_s = self._before[:, np.searchsorted(self._periods, period), hour]
        return open_s + open_now, all_s + all_now


def _share(open_s: NDArray[np.float64], all_s: NDArray[np.float64]) -> NDArray[np.float64]:
    share = np.full(len(all_s), PRIOR_P)
    np.divide(open_s, all_s, out=share, where=all_s > 0)
    return share
