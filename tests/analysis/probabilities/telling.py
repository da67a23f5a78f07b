"""Short words for what happens to one door, to test with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence, Evidence
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorUpdated,
    Event,
)
from tests.batches import batch_of

DOOR = DoorId(1)
SECOND_NS = 10**9
HOUR_NS, DAY_NS = 3600 * SECOND_NS, 86_400 * SECOND_NS
BEGIN_NS = 10_000 * DAY_NS  # a Monday, 00:00 UTC
LATER_NS = 2 * 10**18
"""When all is recorded: behind everything that happens."""

Told = tuple[float, Event]
"""Seconds since the beginning, and what happened then."""


def added(state: str = "unknown", *, at_s: float = 0) -> Told:
    return at_s, DoorAdded(door_id=DOOR, state=DoorState.parse(state))


def put(state: str, at_s: float) -> Told:
    changed = Changed.STATE
    return at_s, DoorUpdated(door_id=DOOR, changed=changed, state=DoorState.parse(state))


def seen(state: str, at_s: float, accuracy: float | tuple[float, float] = 0.9) -> Told:
    a, b = accuracy if isinstance(accuracy, tuple) else (accuracy, accuracy)
    said = DoorState.parse(state)
    return at_s, DoorObserved(door_id=DOOR, state=said, accuracy_open=a, accuracy_closed=b)


def passed(at_s: float, *, through: bool = True) -> Told:
    return at_s, DoorPassed(door_id=DOOR, passed=through)


def removed(at_s: float) -> Told:
    return at_s, DoorRemoved(door_id=DOOR)


def as_batch(told: Sequence[Told]) -> EventBatch:
    """Return events as a log has them that learns of them in this order, long after."""
    events = [replace(e, happened_ns=BEGIN_NS + round(s * SECOND_NS)) for s, e in told]
    return batch_of(events, recorded_ns=range(LATER_NS, LATER_NS + len(events)))


def told_of(*told: Told) -> Evidence:
    evidence = Evidence()
    evidence.apply(as_batch(told))
    return evidence


def known(*told: Told, until_s: float | None = None) -> DoorEvidence:
    return told_of(*told).door(DOOR, None if until_s is None else ns_of(until_s))


def ns_of(seconds: float) -> int:
    return BEGIN_NS + round(seconds * SECOND_NS)


def stretches(found: DoorEvidence) -> list[tuple[float, float, str]]:
    """Return (start, end) in seconds since the beginning, and the state."""
    start, end = (((ns - BEGIN_NS) / SECOND_NS).tolist() for ns in (found.start_ns, found.end_ns))
    states = np.where(found.is_open, "open", "closed").tolist()
    return list(zip(start, end, states, strict=True))


def points(found: DoorEvidence) -> list[tuple[float, str]]:
    """Return when sightings were, and what was read."""
    states = np.where(found.reads_open, "open", "closed").tolist()
    times = ((found.seen_ns - BEGIN_NS) / SECOND_NS).tolist()
    return list(zip(times, states, strict=True))
