"""How forecasts are tested: which part of a log is for training, and what is known when.

It also simulates the visits of a robot with an imperfect sensor to doors whose states are known.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.beliefs.trials import StateIntervals, Trials
from semmap_log.analysis.probabilities.evidence.evidence import Evidence
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved
from semmap_log.core.model.local_clock import DAY_S, LocalClock
from semmap_log.core.model.moments import SECOND_NS
from semmap_log.errors import EstimatorError

Times = NDArray[np.int64]


MOST_S = 100 * 366 * DAY_S
"""The longest time: more nanoseconds do not fit into 64 bits."""


@dataclass(frozen=True, slots=True)
class Protocol:
    """What is known at each forecast. By default, what was known at the split.

    `prequential`: the days that were over, up to the last local midnight. `horizon_ns`: all up to
    so long before the forecast, and only forecasts where the state was known then; together with
    `prequential`, the days that were over then. `patrol`: all up to the forecast itself, but only
    what that patrol read.
    """

    split: float = 0.7
    """The first such share of a door's known time is for training, the rest is forecast."""
    prequential: bool = False
    horizon_ns: int | None = None
    patrol: Patrol | None = None
    step_s: float = 60.0
    """Seconds between two forecasts."""

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            EstimatorError: One of them is invalid.
        """
        _check("split", "a share between 0 and 1", self.split, 0 < self.split < 1)
        _check("step", "1 s to a hundred years", self.step_s, 1 <= self.step_s <= MOST_S)
        if self.horizon_ns is not None:
            seconds = self.horizon_ns / SECOND_NS
            _check("horizon", "0 s to a hundred years", seconds, 0 <= seconds <= MOST_S)
        if self.patrol is not None:
            seconds, accuracy = self.patrol.interval_ns / SECOND_NS, self.patrol.accuracy
            expected = "1 s to a hundred years between two visits"
            _check("patrol", expected, seconds, 1 <= seconds <= MOST_S)
            _check("accuracy", "0.5..1", accuracy, 0.5 <= accuracy <= 1)

    @property
    def needs_known(self) -> bool:
        """Forecasts are made only where the state was known `horizon_ns` before."""
        return bool(self.horizon_ns) and self.patrol is None and not self.prequential

    def known_ns(self, trials: Trials, split_ns: int, clock: LocalClock) -> Times:
        """Return the end of the knowledge of each forecast.

        Args:
            trials: Those after the split.
            split_ns: The end of the training part.
            clock: Whose midnights count.
        """
        is_live = self.patrol is not None or self.horizon_ns is not None
        known_ns = trials.known_ns - (self.horizon_ns or 0)
        if self.prequential:
            days = np.floor(clock.wall_s(known_ns) / DAY_S).astype(np.int64)
            return np.minimum(clock.midnights_ns(days), known_ns)
        is_reading = bool((trials.known_ns < trials.times_ns).any())
        if is_live or is_reading:
            return known_ns
        return np.full(len(trials), split_ns)


def _check(name: str, expected: str, got: float, is_right: bool) -> None:  # noqa: FBT001 - private
    if not is_right:
        raise EstimatorError(f"{name}: expected {expected}, got {got:g}.")


MINUTE_NS = 60 * 10**9


@dataclass(frozen=True, slots=True)
class Patrol:
    """A robot that passes all doors once in each interval, day and night."""

    interval_ns: int = 30 * MINUTE_NS
    accuracy: float = 0.9
    """P(its sensor reads right), 0.5..1."""
    seed: int = 0
    """Of its errors; each door has its own, whichever others there are."""


def visited(truths: Mapping[DoorId, StateIntervals], patrol: Patrol) -> Evidence:
    """Return that robot's sightings as evidence, by the same fold as real ones.

    Args:
        truths: When each door was known to be open or closed; outside of that there is no visit.
        patrol: How often, and how well.
    """
    evidence = Evidence()
    for door_id, stretches in truths.items():
        times_ns, is_open = stretches.sampled(patrol.interval_ns)
        if not len(times_ns):
            continue
        random = np.random.default_rng([patrol.seed, door_id])
        reads_open = is_open ^ (random.random(len(times_ns)) >= patrol.accuracy)
        evidence.apply(EventBatch.of(DoorAdded, happened_ns=times_ns[:1], door_id=door_id))
        evidence.apply(
            EventBatch.of(
                DoorObserved,
                happened_ns=times_ns,
                door_id=door_id,
                state=np.where(reads_open, DoorState.OPEN, DoorState.CLOSED).astype(np.uint8),
                accuracy_open=patrol.accuracy,
                accuracy_closed=patrol.accuracy,
            )
        )
    return evidence
