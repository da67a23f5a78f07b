"""What a log would hold of a simulated door: its changes, or what a patrol read."""

from __future__ import annotations

import numpy as np

from semmap_log.analysis.beliefs.protocol import Patrol, visited
from semmap_log.analysis.beliefs.trials import StateIntervals
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence, Evidence
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import Changed, DoorAdded, DoorUpdated

DOOR = DoorId(1)


def evidence_of(life: StateIntervals, until_ns: int, patrol: Patrol | None) -> DoorEvidence:
    """Return what is known of a door up to a time.

    Args:
        life: How it really stood.
        until_ns: Up to then.
        patrol: What passed by; None: each change was told.
    """
    if patrol is not None:
        return visited({DOOR: life}, patrol).door(DOOR, until_ns)
    told = Evidence()
    told.apply(EventBatch.of(DoorAdded, happened_ns=life.start_ns[:1], door_id=DOOR))
    states = np.where(life.is_open, DoorState.OPEN, DoorState.CLOSED).astype(np.uint8)
    told.apply(
        EventBatch.of(
            DoorUpdated, happened_ns=life.start_ns, door_id=DOOR, changed=Changed.STATE.value,
            state=states,
        )
    )  # fmt: skip
    told.latest_ns = max(told.latest_ns, until_ns)
    return told.door(DOOR, until_ns)
