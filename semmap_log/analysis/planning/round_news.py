"""What is told of doors while a robot is on its round, and what that makes of their chances."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.beliefs.belief_query import BeliefQuery
from semmap_log.analysis.planning.door_chances import DoorChances
from semmap_log.analysis.planning.learnt_chances import learnt_chances
from semmap_log.analysis.planning.passing import PassingProjection, passings_in
from semmap_log.analysis.probabilities.belief_fold import BeliefProjection, Beliefs
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.moments import SECOND_NS
from semmap_log.log.door_log.door_log import DoorLog


@dataclass(slots=True)
class RoundNews:
    """What was known at a round's start, and what was told since."""

    query: BeliefQuery
    passing: Beliefs | None
    """Of P(passes); None: the robot does not ask."""
    start_ns: int
    times_s: NDArray[np.float64]
    """(k,), of the round: at these P is asked for."""
    mean: NDArray[np.float64]
    """(k,), P of the doors on average, for one of which too little is known."""

    def take_in(self, batch: EventBatch) -> None:
        """Take in what is told of doors."""
        self.query.beliefs.evidence.apply(batch)
        if self.passing is not None:
            self.passing.evidence.apply(passings_in(batch))

    def learn_anew(self, log: DoorLog, event: int) -> None:
        """Learn from a log anew, up to an event, which took some of it back."""
        estimator, tz = self.query.estimator, self.query.clock.tz
        beliefs = log.fold(BeliefProjection(estimator, tz), event=event)
        self.query = replace(self.query, beliefs=beliefs)
        if self.passing is not None:
            self.passing = log.fold(PassingProjection(estimator, tz), event=event)

    def chances(self, door_id: DoorId, known_ns: int) -> DoorChances:
        """Return those of one door as known at a moment; at earlier times of the round, as then."""
        by_state = self._learnt(self.query.beliefs, door_id, known_ns)
        if self.passing is None:
            return by_state
        return self._learnt(self.passing, door_id, known_ns).or_else(by_state)

    def _learnt(self, beliefs: Beliefs, door_id: DoorId, known_ns: int) -> DoorChances:
        since_s = (known_ns - self.start_ns) / SECOND_NS
        return learnt_chances(
            beliefs, [door_id], known_ns=known_ns, start_ns=self.start_ns,
            times_s=np.maximum(self.times_s, since_s), others=self.mean,
        )  # fmt: skip
