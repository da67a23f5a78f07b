"""P(a door lets a robot in) where the robot may ask: learnt from who went through, or gave up.

A door that is shut may open for who asks, and one that is locked does not. P(open) cannot tell the
two apart; what became of earlier tries can.
"""

from __future__ import annotations

import numpy as np

from semmap_log.analysis.probabilities.belief_fold import BeliefProjection, Beliefs
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved, DoorPassed, DoorRemoved


class PassingProjection(BeliefProjection):
    """The fold whose beliefs are of P(passes): `log.fold(PassingProjection("filter", tz))`."""

    name = "passing"
    version = 1

    def apply(self, state: Beliefs, batch: EventBatch, /) -> Beliefs:
        """Fold a batch in."""
        return super().apply(state, passings_in(batch))


def passings_in(batch: EventBatch) -> EventBatch:
    """Return a batch's tries as sightings that cannot err: passed is OPEN, gave up is CLOSED.

    Beside these there is only when doors came and went.
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
