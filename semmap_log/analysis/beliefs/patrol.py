"""Visits that a robot would have made to doors whose states are known, with a sensor that errs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from semmap_log.analysis.beliefs.trials import StateIntervals
from semmap_log.analysis.probabilities.evidence.evidence import Evidence
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved
from semmap_log.core.model.keywords import knows_its_keywords

MINUTE_NS = 60 * 10**9


@knows_its_keywords
@dataclass(frozen=True, slots=True)
class Patrol:
    """A robot that passes all doors each time an interval is over, day and night."""

    interval_ns: int = 30 * MINUTE_NS
    accuracy: float = 0.9
    """P(its sensor reads right), 0.5..1."""
    seed: int = 0
    """Of its errors; each door has its own, whichever others there are."""


def visited(truths: Mapping[DoorId, StateIntervals], patrol: Patrol) -> Evidence:
    """Return what that robot's sightings are as evidence, by the fold that real ones go through.

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
