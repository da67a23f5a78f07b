"""How likely doors let a robot in during a round, and which of them are worth a try.

The chances come from what was learnt of doors by the moment that a plan starts from. Where the
robot may ask, P(a door lets it in) is learnt from earlier tries: a shut door may open for who asks,
a locked one does not, and P(open) cannot distinguish the two. A stop also shows how often its door
was open when it was looked at, at such hours of such days.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.beliefs.door_beliefs import BeliefQuery, ask, default_estimator
from semmap_log.analysis.probabilities.belief_fold import BeliefProjection, Beliefs
from semmap_log.analysis.probabilities.beta import beta_interval
from semmap_log.analysis.probabilities.estimator import StateModel
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.evidence.samples import KnownTime
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.timeline import REPEATS_NS
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved, DoorPassed, DoorRemoved
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.moments import DAY_NS, HOUR_NS, SECOND_NS, Moment, Time
from semmap_log.log import DoorLog

STEP_S = 300.0
"""Between two times at which P is computed."""
LONGEST_S = 12 * 3600.0
"""Time of a round from which on P stays constant."""


def round_times_s(longest_s: float) -> NDArray[np.float64]:
    """Return the times of a round at which P is computed, from its start on, seconds."""
    count = math.ceil(min(longest_s, LONGEST_S) / STEP_S) + 1
    return np.arange(count, dtype=np.float64) * STEP_S


def learnt_chances(
    beliefs: Beliefs,
    doors: Sequence[DoorId],
    *,
    known_ns: int,
    start_ns: int,
    times_s: NDArray[np.float64],
    others: NDArray[np.float64] | None = None,
) -> DoorChances:
    """Return the chances of doors at times of a round, by what was known at a moment.

    Args:
        beliefs: Of P(open), or P(passes).
        doors: The doors.
        known_ns: Later events do not count.
        start_ns: Of the round.
        times_s: (k,): of the round, `STEP_S` apart.
        others: See `DoorChances.with_stand_ins`.
    """
    times_ns = start_ns + np.round(times_s * SECOND_NS).astype(np.int64)
    known = np.full(len(times_ns), known_ns)
    said = [beliefs.predict(door, times_ns, known) for door in doors]
    looks = [
        looks_at_hour(
            beliefs.evidence.door(door, known_ns), beliefs.clock,
            time_ns=start_ns, known_ns=known_ns,
        )
        for door in doors
    ]  # fmt: skip
    shape = (len(doors), len(times_ns))
    return DoorChances(
        p_passes=np.array([each.p_open for each in said]).reshape(shape),
        low=np.array([each.low for each in said]).reshape(shape),
        high=np.array([each.high for each in said]).reshape(shape),
        is_known=np.array([each.is_known.all() for each in said], np.bool_),
        looks=np.array(looks, np.int64).reshape(-1, 2),
        looks_high=np.array([each.high for each in looks]),
        unseen_s=np.array(unseen_s(beliefs, doors, known_ns=known_ns, start_ns=start_ns)),
        step_s=STEP_S,
    ).with_stand_ins(others)


def unseen_s(
    beliefs: Beliefs, doors: Sequence[DoorId], *, known_ns: int, start_ns: int
) -> list[float]:
    """Return the time since doors were last seen, at the start of a round; inf: never."""
    seen_ns = [beliefs.evidence.counts(door, known_ns).last_seen_ns for door in doors]
    return [math.inf if at is None else (start_ns - at) / SECOND_NS for at in seen_ns]


def beliefs_at(
    log: DoorLog, start: Time, *, estimator: str | None, tz: str | None, progress: Progress | None
) -> tuple[BeliefQuery, int]:
    """Return what is known of all doors, and when the plan starts, ns.

    If it starts before the log's end, later events do not count, since the past is not forecast.

    Args:
        log: The log of the doors.
        start: When the plan starts; None: at the log's end.
        estimator: None: as far ahead as that is from the log's end.
        tz: IANA zone; None: the log's.
        progress: Called with the progress of reading.

    Raises:
        EstimatorError: There is no such estimator.
        MomentError: The time or the zone cannot be read.
    """
    end_ns = log.end_ns()
    start_ns = end_ns if start is None else log.instant(log.moment(start))
    assert start_ns is not None, "only None means no time"
    at = Moment(ns=start_ns) if start_ns < end_ns else None
    chosen = estimator or default_estimator(max(0, start_ns - end_ns))
    return ask(log, at=at, estimator=chosen, tz=tz, doors=None, progress=progress), start_ns


def wait_s(
    query: BeliefQuery,
    door_id: DoorId,
    at_ns: int,
    *,
    most_s: float | None = None,
    is_shut: bool = False,
) -> float | None:
    """Return the expected wait until a door is open; None: unknown.

    Args:
        query: What is known.
        door_id: The door.
        at_ns: From then on.
        most_s: The longest wait.
        is_shut: It is found shut then; otherwise it may be open, without a wait.
    """
    learnt = query.beliefs.learnt(query.known_ns)
    if not isinstance(learnt, StateModel):
        return None
    seconds = learnt.wait_s(
        door_id, at_ns, most_s=most_s, known_ns=query.known_ns, is_other=is_shut
    )
    return seconds if math.isfinite(seconds) else None


class PassingProjection(BeliefProjection):
    """The fold whose beliefs are of P(passes): `log.fold(PassingProjection("filter", tz))`."""

    name = "passing"
    version = 1

    def apply(self, state: Beliefs, batch: EventBatch, /) -> Beliefs:
        """Fold a batch in."""
        return super().apply(state, passings_in(batch))


def passings_in(batch: EventBatch) -> EventBatch:
    """Return a batch's tries as sightings that cannot err: passed is OPEN, gave up is CLOSED.

    The only other events are additions and removals of doors.
    """
    kinds = (DoorAdded, DoorRemoved, DoorPassed)
    places = np.sort(np.concatenate([batch.where(kind) for kind in kinds]))
    when_ns, door_ids = batch.folds_ns[places], batch.door_ids()[places]
    of_kind = {kind: batch.kind[places] == kind.kind for kind in kinds}
    became = np.where(of_kind[DoorPassed], DoorObserved.kind, batch.kind[places])
    made = [
        EventBatch.of(kind, happened_ns=when_ns[of_kind[kind]], door_id=door_ids[of_kind[kind]])
        for kind in (DoorAdded, DoorRemoved)
        if of_kind[kind].any()
    ]
    tried = of_kind[DoorPassed]
    if tried.any():
        passed = batch[DoorPassed]["passed"].astype(np.bool_)
        states = np.where(passed, DoorState.OPEN, DoorState.CLOSED).astype(np.uint8)
        made.append(
            EventBatch.of(
                DoorObserved, happened_ns=when_ns[tried], door_id=door_ids[tried], state=states,
                accuracy_open=1.0, accuracy_closed=1.0,
            )
        )  # fmt: skip
    return EventBatch.mixed(became, *made)


Probabilities = NDArray[np.float64]

UNKNOWN_P = 0.5
"""P of a door without evidence, where there is no door with any."""
MEAN_COUNTS = 2.0
"""The weight, in looks, of the other doors' mean for a door of which too little is known."""
DAY_S = 86_400.0


@dataclass(frozen=True, slots=True, eq=False)
class DoorChances:
    """P that n doors let the robot in, at k times of a round, `step_s` apart from its start on."""

    p_passes: Probabilities
    """(n, k)."""
    low: Probabilities
    """(n, k): of the 90 % interval."""
    high: Probabilities
    is_known: NDArray[np.bool_]
    """(n,), False: too little was seen of the door to say anything, and its numbers are stand-ins:
    see `with_stand_ins`."""
    looks: NDArray[np.int64]
    """(n, 2): looks at such hours of such days, and how many of them found it open: see
    `looks_at_hour`."""
    looks_high: NDArray[np.float64]
    """(n,): the upper end of the 90 % interval of the share that is open."""
    unseen_s: NDArray[np.float64]
    """(n,): time since it was last seen, at the start of the round; inf: never."""
    step_s: float

    def with_stand_ins(self, others: Probabilities | None = None) -> DoorChances:
        """Return chances in which a door of which too little is known counts as the others do.

        It is their mean, and its own looks at such hours where there are any; its interval is
        0..1.

        Args:
            others: (k,), their mean; None: of the doors here.
        """
        unknown = ~self.is_known
        mean = self.mean() if others is None else others
        p_passes, low, high = self.p_passes.copy(), self.low.copy(), self.high.copy()
        looks, found_open = self.looks[unknown].T[:, :, None]
        p_passes[unknown] = (found_open + MEAN_COUNTS * mean) / (looks + MEAN_COUNTS)
        low[unknown], high[unknown] = 0.0, 1.0
        return replace(self, p_passes=p_passes, low=low, high=high)

    def mean(self) -> Probabilities:
        """Return (k,): the mean P of the doors of which enough is known."""
        if not self.is_known.any():
            return np.full(self.p_passes.shape[1], UNKNOWN_P)
        found: Probabilities = self.p_passes[self.is_known].mean(axis=0)
        return found

    def with_row(self, row: int, of_door: DoorChances) -> DoorChances:
        """Return chances updated by what was learnt of one door since, but not when it was seen."""
        changed = {}
        for name in ("p_passes", "low", "high", "is_known", "looks", "looks_high"):
            changed[name] = getattr(self, name).copy()
            changed[name][row] = getattr(of_door, name)[0]
        return replace(self, **changed)

    def interval_at(self, row: int, time_s: float) -> tuple[float, float]:
        """Return the interval of a door's P at a time of the round."""
        times_s = np.arange(self.low.shape[1]) * self.step_s
        return (
            float(np.interp(time_s, times_s, self.low[row])),
            float(np.interp(time_s, times_s, self.high[row])),
        )

    def or_else(self, p_open: DoorChances) -> DoorChances:
        """Return P(passes) where it is known, else P(open), since an open door lets the robot in.

        Whether a shut one would open for who asks is unknown then: P may be up to 1.
        """
        stands_in = ~self.is_known & p_open.is_known
        p_passes, low, high = self.p_passes.copy(), self.low.copy(), self.high.copy()
        p_passes[stands_in] = p_open.p_passes[stands_in]
        low[stands_in], high[stands_in] = p_open.low[stands_in], 1.0
        known = self.is_known | stands_in
        return replace(self, p_passes=p_passes, low=low, high=high, is_known=known)


@dataclass(frozen=True, slots=True)
class SkipRule:
    """Decides which doors are left out: those that are almost surely shut, and were looked at.

    What is not tried is not learnt. So a low P is not enough: at such hours of such days the door
    must have been found shut so often that even the upper end of the interval of its open share
    is low. A door that was just seen open is tried even if it mostly is not. A door is looked at
    again after `again_s`, whatever was found. One that nobody has looked at then is never left
    out.
    """

    below: float = 0.4
    """The upper end of the 90 % interval; 0: no door is left out."""
    again_s: float = DAY_S
    p_below: float = 0.12
    """P at each time of the round, by the last look, too."""

    def seem_shut(self, chances: DoorChances) -> NDArray[np.bool_]:
        """Return which doors are almost surely shut."""
        is_unlikely = chances.p_passes.max(axis=1) < self.p_below
        found: NDArray[np.bool_] = (chances.looks_high < self.below) & is_unlikely
        return found

    def is_skipped(self, chances: DoorChances) -> NDArray[np.bool_]:
        """Return which doors are left out of the round."""
        found: NDArray[np.bool_] = self.seem_shut(chances) & (chances.unseen_s < self.again_s)
        return found


REACH_H = 3.0
"""To both sides of the time of day."""
WORKDAYS = 5
BACK_NS = 28 * DAY_NS
"""Older looks do not count."""


class LooksAtHour(NamedTuple):
    """Looks at a door at such hours: visits, and whole hours in which its state was known."""

    looks: int
    found_open: int

    @property
    def high(self) -> float:
        """The upper end of the 90 % interval of the share that is open; 1: there was no look.

        Jeffreys' interval: that of a Beta distribution, half a look more of each kind.
        """
        if not self.looks:
            return 1.0
        return _interval(self.found_open, self.looks)[1]


def looks_at_hour(
    evidence: DoorEvidence, clock: LocalClock, *, time_ns: int, known_ns: int
) -> LooksAtHour:
    """Return the looks at a door at about that time of day, on working days or at weekends.

    Args:
        evidence: What is known of the door.
        clock: The clock of hours and days.
        time_ns: That time.
        known_ns: Later looks do not count.
    """
    known = KnownTime.of(evidence.up_to(known_ns))
    # Of consecutive sightings the last one shows how the visit ended.
    ends = np.append(np.diff(known.seen_ns) >= REPEATS_NS, True)[: len(known.seen_ns)]
    in_stretches, are_open = _hours(known, known_ns)
    times_ns = np.concatenate([known.seen_ns[ends], in_stretches])
    is_open = np.concatenate([known.reads_open[ends], are_open])
    wall_h = clock.wall_s(np.append(times_ns, time_ns)) / 3600
    then_h, wall_h = wall_h[-1], wall_h[:-1]
    apart_h = np.abs((wall_h - then_h + 12) % 24 - 12)
    alike = _is_workday(wall_h) == _is_workday(then_h)
    counts = (apart_h <= REACH_H) & alike & (times_ns > known_ns - BACK_NS)
    return LooksAtHour(int(counts.sum()), int(is_open[counts].sum()))


def _hours(known: KnownTime, known_ns: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return a time for each hour in which the state was known throughout, and that state."""
    times_ns = [np.empty(0, np.int64)]
    states = [np.empty(0, np.bool_)]
    for start, end, state in zip(
        known.start_ns.tolist(), known.end_ns.tolist(), known.is_open.tolist(), strict=True
    ):
        first = max(start, known_ns - BACK_NS)
        hours = np.arange(first + HOUR_NS // 2, end, HOUR_NS, dtype=np.int64)
        times_ns.append(hours)
        states.append(np.full(len(hours), state))
    return np.concatenate(times_ns), np.concatenate(states)


def _is_workday(wall_h: NDArray[np.float64]) -> NDArray[np.bool_]:
    found: NDArray[np.bool_] = wall_h // 24 % 7 < WORKDAYS
    return found


@lru_cache(4096)
def _interval(found_open: int, looks: int) -> tuple[float, float]:
    return beta_interval(found_open + 0.5, looks - found_open + 0.5)
