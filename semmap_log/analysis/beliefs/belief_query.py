"""What every question about beliefs begins with: a moment, what was learnt by then, doors.

On what a belief about a door rests, in numbers.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.belief_fold import BeliefProjection, Beliefs, by_name
from semmap_log.analysis.probabilities.estimator import Estimator
from semmap_log.analysis.probabilities.evidence.coverage import Coverage
from semmap_log.analysis.probabilities.evidence.evidence import Counts, DoorEvidence
from semmap_log.analysis.probabilities.forecast import Forecast
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.doors import Door, DoorId, DoorMap
from semmap_log.core.model.keywords import knows_keywords
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.moments import Moment
from semmap_log.errors import UnknownDoorError
from semmap_log.log.door_log.asked_doors import doors_listed
from semmap_log.log.door_log.clock_warnings import warn_of_clock
from semmap_log.log.door_log.door_log import DoorLog, Time
from semmap_log.log.door_log.known_later import known_later, moment_asked_ns

if TYPE_CHECKING:
    from semmap_log.analysis.probabilities.sensors.sensor_doubts import SensorDoubt


FEWEST_WORDS = 30
"""Of so few nobody can tell how often a sensor errs: what would judge it is not even loaded."""
AS_HAPPENED = (
    "for what would have been believed had each event been recorded when it happened, ask "
    '--at "{then}" --as-happened (in Python: as_happened=True)'
)
"""What to do where beliefs are asked for, and what the log tells of that time came later."""


@dataclass(frozen=True, slots=True)
class BeliefQuery:
    """What is known at a moment, and the doors that are asked about."""

    beliefs: Beliefs
    estimator: str
    clock: LocalClock
    known_ns: int
    """The moment: nothing that happened later counts."""
    door_map: DoorMap
    """The doors as they were known then."""
    doors: list[Door]
    """Those asked about, ids ascending."""

    def by(self, estimator: str) -> BeliefQuery:
        """Return the same by another estimator, from the same evidence.

        Raises:
            EstimatorError: There is no such estimator.
        """
        learnt = Beliefs(by_name(estimator), self.clock, self.beliefs.evidence)
        return replace(self, beliefs=learnt, estimator=estimator)

    def as_of(self, known_ns: int) -> BeliefQuery:
        """Return the same as known at another moment, later knowledge of the doors' names kept."""
        return replace(self, known_ns=known_ns)

    def evidence(self, door: Door) -> EvidenceSummary:
        """Return what is known of a door up to the moment."""
        return self.summary(door, self.beliefs.evidence.door(door.door_id, self.known_ns))

    def summary(self, door: Door, evidence: DoorEvidence) -> EvidenceSummary:
        """Return evidence about a door in numbers."""
        counts = self.beliefs.evidence.counts(door.door_id, self.known_ns)
        return EvidenceSummary.of(evidence, counts, self.clock)

    def sensor_doubts(self, log: DoorLog) -> list[SensorDoubt]:
        """Return the sensors that are not as accurate as declared, having warned of each."""
        if len(self.beliefs.evidence) < FEWEST_WORDS:
            return []
        from semmap_log.analysis.beliefs.sensor_calibration import warn_of_sensors

        asked = [door.door_id for door in self.doors]
        return warn_of_sensors(log, self.beliefs.evidence, asked, self.known_ns)

    def predict(self, door: Door, times_ns: NDArray[np.int64]) -> Forecast:
        """Return what is expected of a door at some times, as known at the moment."""
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
        log: Whose doors.
        at: The moment, with all that is known today of what had happened by then.
        known_at: Only what had been recorded by then, whole commits. Without `at` it is the moment,
            too; without either that is the log's end.
        as_happened: As if each event had been recorded when it happened: what was told later, as
            by an import, counts from then on, names and annotations, too. What is retracted today
            was never there.
        estimator: Its name.
        tz: IANA zone of the building's clocks; None: the log's.
        doors: Only these; None: all that are in the map then.
        progress: Told how far the reading is.

    Raises:
        EstimatorError: There is no such estimator.
        UnknownDoorError: One of the doors was not in the map then.
        MomentError: The time or the zone cannot be read.
    """
    warn_of_clock(log)
    happened, known = log.moment(at), log.known_moment(known_at)
    moment_ns = moment_asked_ns(log, happened, known)
    if as_happened:
        happened, known = _when_all_is_told_at_once(log, happened, known), Moment()
    door_map = log.replay(at=happened, known_at=known)
    chosen = (
        door_map.doors
        if doors is None
        else {_door_then(log, door, door_map, happened, known) for door in doors_listed(doors)}
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


def _when_all_is_told_at_once(log: DoorLog, at: Moment, known_at: Moment) -> Moment:
    """Return up to when what happened counts, were it known at once: both moments bound it."""
    bounds = [ns for ns in (log.instant(at), log.instant(known_at)) if ns is not None]
    return Moment(ns=min(bounds)) if bounds else Moment()


def _door_then(
    log: DoorLog, door: DoorId | str, door_map: DoorMap, at: Moment, known_at: Moment
) -> DoorId:
    """Return the door that is meant, among those that were known then.

    Raises:
        UnknownDoorError: There was none; it says so if one was told of later.
    """
    try:
        return log.resolve_in(door, log.scope(at, known_at), door_map)
    except UnknownDoorError as error:
        try:
            ever = log.resolve_ever(door)
        except UnknownDoorError:
            raise error from None
        later = known_later(log, at, known_at, door=ever, remedy=AS_HAPPENED)
        raise UnknownDoorError(f"{error} {later}".strip()) from None


@knows_keywords
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
    """Return what a log's doors are believed to be.

    Args:
        log: The log.
        at: Only what had happened by then, with all that is known today.
        known_at: Only what had been recorded by then, whole commits.
        estimator: A method, or its name: see `semmap_log.analysis.probabilities.belief_fold`.
        tz: IANA zone of hours and weekdays; None: the log's.
        doors: Learn of these alone, which an index makes quick; no door teaches of another.
        progress: Told how far the reading is.

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
    """On which hours of the week the evidence lies."""
    known_ns: int
    """For how long its state was known without a look, since it had been set."""
    counts: Counts
    """Words about its state, sightings among them, visits, and when it was last seen."""

    @classmethod
    def of(cls, evidence: DoorEvidence, counts: Counts, clock: LocalClock) -> EvidenceSummary:
        """Return the evidence about a door in numbers."""
        known_ns = int(np.sum(evidence.end_ns - evidence.start_ns))
        return cls(Coverage.of(evidence, clock), known_ns, counts)

    @property
    def is_empty(self) -> bool:
        """True for a door of which nobody ever said whether it is open."""
        return self.counts.last_seen_ns is None
