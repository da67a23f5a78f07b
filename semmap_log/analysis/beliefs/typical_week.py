"""A door's typical week: how likely it is open in each of 168 hours, and which nobody has seen."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.beliefs.belief_query import BeliefQuery, ask
from semmap_log.analysis.beliefs.door_beliefs import LATER
from semmap_log.analysis.beliefs.evidence_summary import EvidenceSummary
from semmap_log.analysis.probabilities.evidence.coverage import WEEK, WeekMask
from semmap_log.analysis.probabilities.forecast import Forecast
from semmap_log.analysis.probabilities.methods.schedule import DoorSchedule
from semmap_log.core.io.progress import Progress
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.model.doors import Door, DoorId
from semmap_log.core.model.keywords import knows_keywords
from semmap_log.log.door_log.door_log import DoorLog, Time

if TYPE_CHECKING:
    from semmap_log.analysis.probabilities.sensors.sensor_doubts import SensorDoubt

WEEK_HOURS = WEEK[0] * WEEK[1]

By = Literal["hour", "weekday", "week"]

Cells = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class WeekPattern:
    """P(open) in cells of time, in any shape; low and high are its 90 % interval."""

    p_open: Cells
    low: Cells
    high: Cells
    is_known: NDArray[np.bool_]
    """False: the door was never seen then, or too little at all; the numbers are carried over."""

    @classmethod
    def of(cls, said: Forecast, is_seen: NDArray[np.bool_]) -> WeekPattern:
        """Return a forecast as cells; those never seen are not known."""
        return cls(said.p_open, said.low, said.high, said.is_known & is_seen)

    def taken(self, cells: Any) -> WeekPattern:
        """Return some of the cells, in the shape of that index."""
        return WeekPattern(
            self.p_open[cells], self.low[cells], self.high[cells], self.is_known[cells]
        )

    def averaged(self, axis: int) -> WeekPattern:
        """Return the means over an axis: of what is known, or of all where nothing is.

        The ends are averaged, too: cells err together, so that a mean is no surer than they are.
        """
        known = np.asarray(self.is_known.any(axis=axis))
        weights = np.where(np.expand_dims(known, axis), self.is_known, True)
        p_open, low, high = (
            np.asarray(np.average(cells, axis=axis, weights=weights))
            for cells in (self.p_open, self.low, self.high)
        )
        return WeekPattern(p_open, low, high, known)


@dataclass(frozen=True, slots=True)
class TypicalWeek:
    """What a week is like at a door, as known at a moment."""

    door: Door
    level_name: str
    known_ns: int
    tz: str
    """Zone of the hours."""
    is_known: bool
    """False: too little was seen of the door at all."""
    hours: WeekPattern
    """(7, 24): Monday first, local hours."""
    evidence: EvidenceSummary

    @property
    def is_seen(self) -> WeekMask:
        """The hours of the week in which it was ever seen."""
        return self.evidence.coverage.is_seen

    def pattern(self, by: By) -> WeekPattern:
        """Return typical hours of the day, days of the week, or hours of the week."""
        if by == "week":
            return self.hours
        return self.by_hour() if by == "hour" else self.by_weekday()

    def by_hour(self) -> WeekPattern:
        """Return the typical hour of the day, (24,): the mean of the days that were seen then."""
        return self.hours.averaged(0)

    def by_weekday(self) -> WeekPattern:
        """Return the typical day of the week, (7,): the mean of the hours that were seen then."""
        return self.hours.averaged(1)


class TypicalWeeks(list[TypicalWeek]):
    """The weeks of some doors, ids ascending."""

    sensor_doubts: Sequence[SensorDoubt] = ()
    """Sensors that are not as accurate as declared: the numbers are off."""


@knows_keywords
def typical_weeks(
    log: DoorLog,
    *,
    at: Time = None,
    known_at: Time = None,
    as_happened: bool = False,
    tz: str | None = None,
    doors: Iterable[DoorId | str] | None = None,
    progress: Progress | None = None,
) -> TypicalWeeks:
    """Return the typical week of each door, ids ascending.

    It rests on the reports about that door alone: whatever else is written since, and however late
    one asks, it stays the same. How likely a door is open in the hours to come is another question:
    see `probabilities`.

    Args:
        log: Whose doors.
        at: The moment asked from, with all that is known today of what had happened by then.
        known_at: Only what had been recorded by then, whole commits; without `at` it is the moment,
            too. Without either that is the log's end.
        as_happened: As if each event had been recorded when it happened, whatever was imported or
            told later: see `belief_query.ask`.
        tz: IANA zone of the building's clocks; None: the log's.
        doors: Only these (id, name, or level/name); None: all that are in the map then.
        progress: Told how far the reading is.

    Raises:
        UnknownDoorError: One of the doors was not in the map then.
        MomentError: The time or the zone cannot be read.
    """
    asked = ask(
        log, at=at, known_at=known_at, as_happened=as_happened, estimator=LATER, tz=tz,
        doors=doors, progress=progress,
    )  # fmt: skip
    found = TypicalWeeks(typical_week(asked, door) for door in asked.doors)
    found.sensor_doubts = asked.sensor_doubts(log)
    return found


def typical_week(asked: BeliefQuery, door: Door) -> TypicalWeek:
    """Return a door's week, by all reports about it up to the moment."""
    evidence = asked.beliefs.evidence.as_last_reported(door.door_id, asked.known_ns)
    expected = DoorSchedule(evidence, asked.clock, with_today=True).week()
    summary = asked.summary(door, evidence)
    hours = WeekPattern.of(expected, summary.coverage.is_seen.ravel())
    return TypicalWeek(
        door=door,
        level_name=asked.door_map.level_name(door.level),
        known_ns=asked.known_ns,
        tz=asked.clock.tz,
        is_known=bool(expected.is_known.any()),
        hours=hours.taken(np.arange(WEEK_HOURS).reshape(WEEK)),
        evidence=summary,
    )
