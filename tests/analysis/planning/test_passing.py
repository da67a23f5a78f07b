"""P(passes): what became of earlier tries, not how the door was seen."""

from __future__ import annotations

import numpy as np

from semmap_log.analysis.planning.door_chances import PassingProjection, passings_in
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    DoorAdded,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorRequested,
    PatrolStarted,
)
from semmap_log.core.model.moments import DAY_NS, HOUR_NS

DOOR = DoorId(7)
START_NS = 1_772_406_000 * 10**9


def a_week_of(*, passed: bool) -> EventBatch:
    """Return a door seen shut each hour, asked for, and passed or not."""
    events: list = [DoorAdded(happened_ns=START_NS, door_id=DOOR)]
    for hour in range(1, 7 * 24):
        at_ns = START_NS + hour * HOUR_NS
        events += [
            DoorObserved(happened_ns=at_ns, door_id=DOOR, state=DoorState.CLOSED),
            DoorRequested(happened_ns=at_ns + 1, door_id=DOOR, state=DoorState.OPEN),
            DoorPassed(happened_ns=at_ns + 2, door_id=DOOR, passed=passed, waited_s=8.0),
        ]
    return EventBatch.from_events(events)


def test_tries_become_sightings() -> None:
    """In their order, with when doors came and went, and nothing else."""
    batch = EventBatch.from_events([
        PatrolStarted(happened_ns=1, patrol=1),
        DoorAdded(happened_ns=2, door_id=DOOR),
        DoorObserved(happened_ns=3, door_id=DOOR, state=DoorState.CLOSED),
        DoorPassed(happened_ns=4, door_id=DOOR, passed=True, waited_s=0.0),
        DoorPassed(happened_ns=5, door_id=DOOR, passed=False, waited_s=9.0),
        DoorRemoved(happened_ns=6, door_id=DOOR),
    ])  # fmt: skip

    made = passings_in(batch)

    assert made.happened_ns.tolist() == [2, 4, 5, 6]
    assert made[DoorObserved]["state"].tolist() == [DoorState.OPEN, DoorState.CLOSED]
    assert made.kind.tolist() == [
        DoorAdded.kind, DoorObserved.kind, DoorObserved.kind, DoorRemoved.kind
    ]  # fmt: skip


def test_a_shut_door_that_opens_for_who_asks_passes() -> None:
    """It was never seen open, and is likely to let the robot in; one that does not is not."""
    fold = PassingProjection("schedule", "UTC")
    at_ns = np.array([START_NS + 7 * DAY_NS + 10 * HOUR_NS])

    p = []
    for passed in (True, False):
        beliefs = fold.apply(fold.initial(), a_week_of(passed=passed))
        p.append(float(beliefs.predict(DOOR, at_ns, at_ns).p_open[0]))

    assert p[0] > 0.9
    assert p[1] < 0.1
