"""What every question about beliefs begins with: a moment, what was learnt by then, doors."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from semmap_log.backdating import early_events, remedy
from semmap_log.beliefs.evidence_summary import EvidenceSummary
from semmap_log.beliefs.learning import learn
from semmap_log.commands import resolve_door
from semmap_log.door_log import DoorLog, Time
from semmap_log.doors import Door, DoorId, DoorMap
from semmap_log.errors import UnknownDoorError
from semmap_log.log.reading.passage import Progress
from semmap_log.log.reading.window import Window
from semmap_log.moments import Moment, format_local
from semmap_log.probabilities.belief_fold import Beliefs
from semmap_log.probabilities.estimators import by_name
from semmap_log.probabilities.forecast import Forecast
from semmap_log.probabilities.local_clock import LocalClock


@dataclass(frozen=True, slots=True)
class Asked:
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

    def by(self, estimator: str) -> Asked:
        """Return the same by another estimator, from the same evidence.

        Raises:
            EstimatorError: There is no such estimator.
        """
        learnt = Beliefs(by_name(estimator), self.clock, self.beliefs.evidence)
        return replace(self, beliefs=learnt, estimator=estimator)

    def as_of(self, known_ns: int) -> Asked:
        """Return the same as known at another moment, later knowledge of the doors' names kept."""
        return replace(self, known_ns=known_ns)

    def evidence(self, door: Door) -> EvidenceSummary:
        """Return what is known of a door up to the moment."""
        everything, until_ns = self.beliefs.evidence, self.known_ns
        return EvidenceSummary.of(
            everything.door(door.door_id, until_ns),
            everything.counts(door.door_id, until_ns),
            self.clock,
        )

    def prepare(self) -> None:
        """Work out for all the doors at once what their forecasts need."""
        self.beliefs.prepare([door.door_id for door in self.doors], self.known_ns)

    def predict(self, door: Door, times_ns: NDArray[np.int64]) -> Forecast:
        """Return what is expected of a door at some times, as known at the moment."""
        known_ns = np.full(len(times_ns), self.known_ns)
        return self.beliefs.predict(door.door_id, times_ns, known_ns)


def ask(
    log: DoorLog,
    *,
    at: Time,
    known_at: Time = None,
    estimator: str,
    tz: str | None,
    doors: Iterable[DoorId | str] | None,
    progress: Progress | None = None,
) -> Asked:
    """Learn from what had happened by a moment, or was known then.

    Args:
        log: Whose doors.
        at: The moment, with all that is known today of what had happened by then.
        known_at: Only what had been recorded by then, whole commits. Without `at` it is the moment,
            too; without either that is the log's end.
        estimator: Its name.
        tz: IANA zone of the building's clocks; None: the log's.
        doors: Only these; None: all that are in the map then.
        progress: Told how far the reading is.

    Raises:
        EstimatorError: There is no such estimator.
        UnknownDoorError: One of the doors was not in the map then.
        MomentError: The time or the zone cannot be read.
    """
    happened, known = log.moment(at), log.moment(known_at)
    door_map = log.replay(at=happened, known_at=known)
    moment_ns = _moment_ns(log, happened, known)
    try:
        chosen = door_map.doors if doors is None else {resolve_door(d, door_map) for d in doors}
    except UnknownDoorError as error:
        later = known_later(log, at, known_at)
        if later:
            raise UnknownDoorError(f"{error} {later}") from None
        raise
    clock = LocalClock(log.info.timezone if tz is None else tz)
    return Asked(
        beliefs=learn(
            log, at=happened, known_at=known, estimator=estimator, tz=clock.tz, progress=progress
        ),
        estimator=estimator,
        clock=clock,
        known_ns=moment_ns,
        door_map=door_map,
        doors=[door_map[door_id] for door_id in sorted(chosen)],
    )


def known_later(log: DoorLog, at: Time, known_at: Time) -> str:
    """Return why the log knows so little of the time that is asked about, and what to do.

    What it tells of that time was recorded later, or is of doors that were added later; "" where
    it is neither.

    Args:
        log: Whose doors.
        at: As it was asked.
        known_at: As it was asked; None: then all is known.
    """
    happened, known = log.moment(at), log.moment(known_at)
    if known.ns is None:
        return _told_of_early(log, _moment_ns(log, happened, known))
    moment_ns = _moment_ns(log, happened, known)
    window = Window(happened_before_ns=moment_ns + 1, recorded_from_ns=known.ns + 1)
    first = next((batch for batch in log.reader.batches(window) if len(batch)), None)
    if first is None:
        return ""
    recorded = format_local(int(first.recorded_ns[0]), log.info.timezone)
    then = format_local(moment_ns, log.info.timezone)
    return (
        f"What the log tells of that time was recorded later, from {recorded} on, as by an import; "
        f'with all that is known today, ask --at "{then}" without --known-at.'
    )


def _told_of_early(log: DoorLog, moment_ns: int) -> str:
    early = early_events(log.reader)
    if not early.counts or min(early.first_ns.values()) > moment_ns:
        return ""
    since = format_local(min(early.first_ns.values()), log.info.timezone)
    return f"{early.in_words(log.door_labels(), since)}; {remedy(log.path)}"


def _moment_ns(log: DoorLog, at: Moment, known_at: Moment) -> int:
    """Return the moment that is asked about."""
    if at != Moment():
        at_ns = log.instant(at)
        assert at_ns is not None
        return at_ns
    if known_at.event is not None:
        return log.event(known_at.event).recorded_ns
    return log.end_ns() if known_at.ns is None else known_at.ns
