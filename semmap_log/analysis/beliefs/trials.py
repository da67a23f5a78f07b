"""What forecasts are held against: samples of a known truth, or the next reading of a sensor."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence, Evidence
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.timeline import timeline
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import STATE_KINDS
from semmap_log.core.model.moments import DAY_NS, SECOND_NS
from semmap_log.log import DoorLog

LONGEST_NS = 366 * DAY_NS
"""If a state lasts longer, the robot may have been stored, or its clock wrong."""

Times = NDArray[np.int64]
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class StateIntervals:
    """When a door was known to be open or closed, all through."""

    start_ns: Times
    """(m,), ascending."""
    end_ns: Times
    """(m,), half-open; <= the next start."""
    is_open: NDArray[np.bool_]
    """(m,)."""

    def between(self, since_ns: int | None, until_ns: int | None) -> StateIntervals:
        """Return the intervals within a range; None: no bound."""
        start, end = self.start_ns, self.end_ns
        if since_ns is not None:
            start = np.maximum(start, since_ns)
        if until_ns is not None:
            end = np.minimum(end, until_ns)
        inside = start < end
        return StateIntervals(start[inside], end[inside], self.is_open[inside])

    def known_at(self, times_ns: Times) -> NDArray[np.bool_]:
        """Return at which times the state was known."""
        place = np.searchsorted(self.start_ns, times_ns, "right") - 1
        return (place >= 0) & (times_ns < np.append(self.end_ns, 0)[place])

    def count(self, step_ns: int) -> int:
        """Return the number of times that `sampled` returns."""
        return int((-(-self.end_ns // step_ns) + -self.start_ns // step_ns).sum())

    def sampled(self, step_ns: int) -> tuple[Times, NDArray[np.bool_]]:
        """Return (times, whether it was open) at each whole multiple of a step.

        For steps that divide a quarter of an hour these are whole multiples on every wall clock.
        """
        first, end = -(-self.start_ns // step_ns), -(-self.end_ns // step_ns)
        count = end - first
        before = np.cumsum(count) - count
        steps = np.arange(int(count.sum())) - np.repeat(before - first, count)
        return steps * step_ns, np.repeat(self.is_open, count)


@dataclass(frozen=True, slots=True)
class Trials:
    """The forecasts to make for one door, with their outcomes, in order of time."""

    door_id: DoorId
    times_ns: Times
    """(n,)."""
    known_ns: Times
    """(n,), up to when the answer may be known: a reading is not known before it."""
    outcome: Floats
    """(n,), 1 where it was open, or read open."""
    accuracy_open: Floats
    """(n,), P(outcome 1 | open): 1 of a truth."""
    accuracy_closed: Floats
    """(n,), P(outcome 0 | closed)."""

    def __len__(self) -> int:
        return len(self.times_ns)

    def only(self, chosen: slice | NDArray[np.bool_]) -> Trials:
        """Return some of them."""
        return Trials(
            self.door_id,
            self.times_ns[chosen],
            self.known_ns[chosen],
            self.outcome[chosen],
            self.accuracy_open[chosen],
            self.accuracy_closed[chosen],
        )

    def p_outcome(self, p_open: Floats) -> Floats:
        """Return P(outcome 1) where the door is open with P `p_open`."""
        return p_open * self.accuracy_open + (1 - p_open) * (1 - self.accuracy_closed)


def truth_trials(door_id: DoorId, stretches: StateIntervals, step_ns: int) -> Trials:
    """Return a door's true state at each step of its known time."""
    times_ns, is_open = stretches.sampled(step_ns)
    sure = np.broadcast_to(np.float64(1), len(times_ns))
    return Trials(door_id, times_ns, times_ns, is_open.astype(np.float64), sure, sure)


def reading_trials(
    known: DoorEvidence, since_ns: int | None = None, until_ns: int | None = None
) -> Trials:
    """Return the sensor readings at each visit to a door, each to be forecast from those before."""
    chosen = known.is_visit.copy()
    if since_ns is not None:
        chosen &= known.seen_ns >= since_ns
    if until_ns is not None:
        chosen &= known.seen_ns < until_ns
    times_ns = known.seen_ns[chosen]
    return Trials(
        known.door_id,
        times_ns,
        times_ns - 1,
        known.reads_open[chosen].astype(np.float64),
        known.accuracy_open[chosen],
        known.accuracy_closed[chosen],
    )


def holds_truth(evidence: Evidence, door_ids: Sequence[DoorId]) -> bool:
    """Return whether a log has at least as many stretches of known state as visits."""
    known = [evidence.door(door_id) for door_id in door_ids]
    stretches = sum(len(one.start_ns) for one in known)
    return stretches > 0 and stretches >= sum(int(one.is_visit.sum()) for one in known)


def truths(
    log: DoorLog,
    evidence: Evidence,
    door_ids: Sequence[DoorId],
    *,
    progress: Progress | None = None,
) -> Iterator[tuple[DoorId, StateIntervals]]:
    """Yield when doors were known to be open or closed.

    A door that was never seen, only set, is known as in its timeline. For one that was also seen,
    or whose state lasted more than `LONGEST_NS`, only evidence counts: states that were set, not
    contradicted, and not long ago. A reading is not truth.
    """
    plain = [door for door in door_ids if not evidence.counts(door).sightings]
    batches = log.batches(kinds=STATE_KINDS, doors=plain, progress=progress) if plain else ()
    by_door = _parts(batches, plain)
    end_ns = log.end_ns()
    for door_id in door_ids:
        if door_id in by_door:
            found = _of_timeline(by_door[door_id], door_id, end_ns)
            if (found.end_ns - found.start_ns <= LONGEST_NS).all():
                yield door_id, found
                continue
        known = evidence.door(door_id)
        yield door_id, StateIntervals(known.start_ns, known.end_ns, known.is_open)


def _parts(
    batches: Iterable[EventBatch], door_ids: Sequence[DoorId]
) -> Mapping[DoorId, Sequence[EventBatch]]:
    """Return the batches with events of each door."""
    found: dict[DoorId, list[EventBatch]] = {door_id: [] for door_id in door_ids}
    for batch in batches:
        for door_id in np.unique(batch.door_ids()).tolist():
            if door_id in found:
                found[DoorId(door_id)].append(batch)
    return found


def _of_timeline(batches: Sequence[EventBatch], door_id: DoorId, end_ns: int) -> StateIntervals:
    states = timeline(batches, door_id, end_ns=end_ns)
    tells = (states.state == DoorState.OPEN) | (states.state == DoorState.CLOSED)
    tells &= states.end_ns > states.start_ns
    return StateIntervals(
        states.start_ns[tells], states.end_ns[tells], states.state[tells] == DoorState.OPEN
    )


def whole_ns(seconds: float) -> int:
    """Return seconds in nanoseconds."""
    return round(seconds * SECOND_NS)
