"""How likely each door is open at a moment, how sure that is, and on what evidence.

Also a door's typical week: how likely it is open in each of 168 hours, and which hours nobody has
seen. Every query begins with a moment, what was learnt by then, and the doors.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.belief_fold import BeliefProjection, Beliefs, by_name
from semmap_log.analysis.probabilities.estimator import Estimator
from semmap_log.analysis.probabilities.evidence.coverage import WEEK, Coverage, WeekMask
from semmap_log.analysis.probabilities.evidence.evidence import Counts, DoorEvidence
from semmap_log.analysis.probabilities.forecast import Forecast
from semmap_log.analysis.probabilities.methods.schedule import DoorSchedule
from semmap_log.analysis.recorded_later import query_moment_ns, recorded_later
from semmap_log.core.folds.door_index import doors_listed
from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.doors import Door, DoorId, DoorMap, ShownAsTable
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.moments import HOUR_NS, Moment, Time
from semmap_log.errors import MomentError, UnknownDoorError
from semmap_log.log import DoorLog, warn_of_clock

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
    """False: the door was never seen then, or too little in all; the numbers are carried over."""

    @classmethod
    def of(cls, said: Forecast, is_seen: NDArray[np.bool_]) -> WeekPattern:
        """Return a forecast as cells; those never seen are unknown."""
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
    """A door's typical week, as known at a moment."""

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

    It rests on the reports about that door alone: it stays the same whatever else is written since,
    and however late the query is. For how likely a door is open in the hours to come, see
    `probabilities`.

    Args:
        log: The log of the doors.
        at: The moment of the query, with all that is known today of what had happened by then.
        known_at: Only what had been recorded by then, whole commits; without `at` it is the moment,
            too. Without either that is the log's end.
        as_happened: As if each event had been recorded when it happened, even if it was imported or
            recorded later: see `ask`.
        tz: IANA zone of the building's clocks; None: the log's.
        doors: Only these (id, name, or level/name); None: all that are in the map then.
        progress: Called with the progress of reading.

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


NEAR_NS = 24 * HOUR_NS
"""So far ahead the last sightings still matter; beyond, only habits do."""

NOW, LATER = "filter", "schedule"


def default_estimator(horizon_ns: int = 0) -> str:
    """Return the name of the default estimator for a time so far ahead."""
    return NOW if horizon_ns <= NEAR_NS else LATER


@dataclass(frozen=True, slots=True, repr=False)
class DoorBelief(ShownAsTable):
    """How likely a door is open at a moment."""

    door: Door
    """As it was known then."""
    level_name: str
    known_ns: int
    """Up to when evidence counts."""
    time_ns: int
    """The moment that the probability is of: `known_ns` and the horizon."""
    estimator: str
    p_open: float
    low: float
    """Of the 90 % interval of P(open)."""
    high: float
    is_known: bool
    """False: the evidence is insufficient, and the numbers are those of a door of which nothing is
    known."""
    evidence: EvidenceSummary

    def __repr__(self) -> str:
        said = f"P(open) {self.p_open:.2f}, {self.low:.2f} to {self.high:.2f}"
        return f"<DoorBelief of {self.door.label!r}: {said if self.is_known else 'not known'}>"

    @property
    def p_closed(self) -> float:
        """1 - P(open)."""
        return 1.0 - self.p_open


class DoorBeliefs(list[DoorBelief], ShownAsTable):
    """Beliefs of one moment, ids ascending."""

    def __init__(
        self, beliefs: Iterable[DoorBelief], *, tz: str, sensor_doubts: Sequence[SensorDoubt] = ()
    ) -> None:
        """Take beliefs.

        Args:
            beliefs: One a door.
            tz: IANA zone of the building's clocks.
            sensor_doubts: Sensors that are not as accurate as declared: the beliefs are off.
        """
        super().__init__(beliefs)
        self.tz = tz
        self.sensor_doubts = sensor_doubts


def probabilities(
    log: DoorLog,
    *,
    at: Time = None,
    known_at: Time = None,
    as_happened: bool = False,
    horizon_ns: int = 0,
    estimator: str | None = None,
    tz: str | None = None,
    doors: Iterable[DoorId | str] | None = None,
    progress: Progress | None = None,
) -> DoorBeliefs:
    """Return how likely each door is open, ids ascending.

    Args:
        log: The log of the doors.
        at: The moment of the query, with all that is known today of what had happened by then.
        known_at: Only what had been recorded by then, whole commits; without `at` it is the moment,
            too. Without either that is the log's end.
        as_happened: As if each event had been recorded when it happened, even if it was imported or
            recorded later: see `ask`.
        horizon_ns: How long after it.
        estimator: None: `filter` up to a day ahead, `schedule` beyond.
        tz: IANA zone of the building's clocks; None: the log's.
        doors: Only these (id, name, or level/name); None: all that are in the map then.
        progress: Called with the progress of reading.

    Raises:
        UnknownDoorError: One of the doors was not in the map then.
        EstimatorError: There is no such estimator.
        MomentError: The time or the zone cannot be read, or the horizon leads beyond 2262.
    """
    chosen = estimator or default_estimator(horizon_ns)
    asked = ask(
        log, at=at, known_at=known_at, as_happened=as_happened, estimator=chosen, tz=tz,
        doors=doors, progress=progress,
    )  # fmt: skip
    if not 0 <= asked.known_ns + horizon_ns <= MAX_TIME_NS:
        days = horizon_ns / (24 * HOUR_NS)
        raise MomentError(f"horizon: expected one that ends before 2262, got {days:g} days.")
    told = (belief(asked, door, horizon_ns) for door in asked.doors)
    return DoorBeliefs(told, tz=tz or log.info.timezone, sensor_doubts=asked.sensor_doubts(log))


def belief(asked: BeliefQuery, door: Door, horizon_ns: int = 0) -> DoorBelief:
    """Return the belief about one door, `horizon_ns` after the queried moment."""
    time_ns = asked.known_ns + horizon_ns
    said = asked.predict(door, np.array([time_ns]))
    return DoorBelief(
        door=door,
        level_name=asked.door_map.level_name(door.level),
        known_ns=asked.known_ns,
        time_ns=time_ns,
        estimator=asked.estimator,
        p_open=float(said.p_open[0]),
        low=float(said.low[0]),
        high=float(said.high[0]),
        is_known=bool(said.is_known[0]),
        evidence=asked.evidence(door),
    )


FEWEST_WORDS = 30
"""Fewer cannot show how often a sensor errs; the code that would judge it is not even loaded."""
AS_HAPPENED = (
    "for what would have been believed had each event been recorded when it happened, ask "
    '--at "{then}" --as-happened (in Python: as_happened=True)'
)
"""The advice for a query about a time whose events were recorded later."""


@dataclass(frozen=True, slots=True)
class BeliefQuery:
    """What is known at a moment, and the queried doors."""

    beliefs: Beliefs
    estimator: str
    clock: LocalClock
    known_ns: int
    """The moment: nothing that happened later counts."""
    door_map: DoorMap
    """The doors as they were known then."""
    doors: list[Door]
    """The queried doors, ids ascending."""

    def by(self, estimator: str) -> BeliefQuery:
        """Return the query with another estimator and the same evidence.

        Raises:
            EstimatorError: There is no such estimator.
        """
        learnt = Beliefs(by_name(estimator), self.clock, self.beliefs.evidence)
        return replace(self, beliefs=learnt, estimator=estimator)

    def as_of(self, known_ns: int) -> BeliefQuery:
        """Return the query as of another moment, but with the same knowledge of doors' names."""
        return replace(self, known_ns=known_ns)

    def evidence(self, door: Door) -> EvidenceSummary:
        """Return what is known of a door up to the moment."""
        return self.summary(door, self.beliefs.evidence.door(door.door_id, self.known_ns))

    def summary(self, door: Door, evidence: DoorEvidence) -> EvidenceSummary:
        """Return evidence about a door in numbers."""
        counts = self.beliefs.evidence.counts(door.door_id, self.known_ns)
        return EvidenceSummary.of(evidence, counts, self.clock)

    def sensor_doubts(self, log: DoorLog) -> list[SensorDoubt]:
        """Return the sensors that are not as accurate as declared, and warn of each."""
        if len(self.beliefs.evidence) < FEWEST_WORDS:
            return []
        from semmap_log.analysis.beliefs.sensor_calibration import warn_of_sensors

        asked = [door.door_id for door in self.doors]
        return warn_of_sensors(log, self.beliefs.evidence, asked, self.known_ns)

    def predict(self, door: Door, times_ns: NDArray[np.int64]) -> Forecast:
        """Return the forecast of a door at some times, as known at the moment."""
        known_ns = np.full(len(times_ns), self.known_ns)
        return self.beliefs.predict(door.door_id, times_ns, known_ns)


def ask(
    log: DoorLog,
    *,
    at: Time,
    known_at: Time = None,
    as_happened: bool = False,
    estimator: str,
    tz: str | None,
    doors: Iterable[DoorId | str] | None,
    progress: Progress | None = None,
) -> BeliefQuery:
    """Learn from what had happened by a moment, or was known then.

    Args:
        log: The log of the doors.
        at: The moment, with all that is known today of what had happened by then.
        known_at: Only what had been recorded by then, whole commits. Without `at` it is the moment,
            too; without either that is the log's end.
        as_happened: As if each event had been recorded when it happened: events recorded later, as
            by an import, count from then on, including names and annotations. Events that are
            retracted today do not count.
        estimator: Its name.
        tz: IANA zone of the building's clocks; None: the log's.
        doors: Only these; None: all that are in the map then.
        progress: Called with the progress of reading.

    Raises:
        EstimatorError: There is no such estimator.
        UnknownDoorError: One of the doors was not in the map then.
        MomentError: The time or the zone cannot be read.
    """
    warn_of_clock(log)
    happened, known = log.moment(at), log.known_moment(known_at)
    moment_ns = query_moment_ns(log, happened, known)
    if as_happened:
        happened, known = _if_known_at_once(log, happened, known), Moment()
    door_map = log.replay(at=happened, known_at=known)
    chosen = (
        door_map.doors
        if doors is None
        else {_door_as_of(log, door, door_map, happened, known) for door in doors_listed(doors)}
    )
    clock = LocalClock(log.info.timezone if tz is None else tz)
    return BeliefQuery(
        beliefs=learn(
            log,
            at=happened,
            known_at=known,
            estimator=estimator,
            tz=clock.tz,
            doors=None if doors is None else chosen,
            progress=progress,
        ),
        estimator=estimator,
        clock=clock,
        known_ns=moment_ns,
        door_map=door_map,
        doors=[door_map[door_id] for door_id in sorted(chosen)],
    )


def _if_known_at_once(log: DoorLog, at: Moment, known_at: Moment) -> Moment:
    """Return up to when what happened counts, were it known at once: both moments bound it."""
    bounds = [ns for ns in (log.instant(at), log.instant(known_at)) if ns is not None]
    return Moment(ns=min(bounds)) if bounds else Moment()


def _door_as_of(
    log: DoorLog, door: DoorId | str, door_map: DoorMap, at: Moment, known_at: Moment
) -> DoorId:
    """Return a door, among those that were known then.

    Raises:
        UnknownDoorError: There was none; the message mentions one that was recorded later.
    """
    try:
        return log.resolve_in(door, log.scope(at, known_at), door_map)
    except UnknownDoorError as error:
        try:
            ever = log.resolve_any_door(door)
        except UnknownDoorError:
            raise error from None
        later = recorded_later(log, at, known_at, door=ever, remedy=AS_HAPPENED)
        raise UnknownDoorError(f"{error} {later}".strip()) from None


def learn(
    log: DoorLog,
    *,
    at: Time = None,
    known_at: Time = None,
    estimator: Estimator | str = "filter",
    tz: str | None = None,
    doors: Collection[DoorId] | None = None,
    progress: Progress | None = None,
) -> Beliefs:
    """Return the beliefs about a log's doors.

    Args:
        log: The log.
        at: Only what had happened by then, with all that is known today.
        known_at: Only what had been recorded by then, whole commits.
        estimator: A method, or its name: see `semmap_log.analysis.probabilities.belief_fold`.
        tz: IANA zone of hours and weekdays; None: the log's.
        doors: Learn of these alone, which an index makes quick; doors are independent.
        progress: Called with the progress of reading.

    Raises:
        EstimatorError: There is no such estimator.
        MomentError: No such time, or no such zone.
    """
    projection = BeliefProjection(estimator, log.info.timezone if tz is None else tz)
    if doors is None:
        return log.fold(projection, at, known_at, progress=progress)
    beliefs = projection.initial()
    scope = log.scope(at, known_at)
    for batch in log.visible_batches(scope, doors=doors, progress=progress):
        beliefs = projection.apply(beliefs, batch)
    return beliefs


@dataclass(frozen=True, slots=True)
class EvidenceSummary:
    """What a belief rests on."""

    coverage: Coverage
    """The hours of the week in which the evidence lies."""
    known_ns: int
    """For how long its state was known without a look, since it had been set."""
    counts: Counts
    """Reports of its state, sightings among them, visits, and when it was last seen."""

    @classmethod
    def of(cls, evidence: DoorEvidence, counts: Counts, clock: LocalClock) -> EvidenceSummary:
        """Return the evidence about a door in numbers."""
        known_ns = int(np.sum(evidence.end_ns - evidence.start_ns))
        return cls(Coverage.of(evidence, clock), known_ns, counts)

    @property
    def is_empty(self) -> bool:
        """True for a door that was never reported open or closed."""
        return self.counts.last_seen_ns is None
