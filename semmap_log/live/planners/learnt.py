"""How likely doors are open, by all that is known up to now: learnt once, and gone on from."""

from __future__ import annotations

import threading

import numpy as np

from semmap_log.analysis.beliefs.door_beliefs import LATER, NOW, default_estimator
from semmap_log.analysis.probabilities.belief_fold import BeliefProjection, Beliefs
from semmap_log.analysis.probabilities.estimators import by_name
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import Retracted
from semmap_log.core.model.moments import Moment
from semmap_log.log.door_log.door_log import DoorLog


class LearntDoors:
    """What `probabilities` says, of a log that goes on: new events are taken in, not all again."""

    def __init__(self) -> None:
        self._learning = threading.Lock()
        self._event = -1
        """The last event that is taken in."""
        self._by_estimator: dict[str, Beliefs] = {}

    def p_open(
        self, log: DoorLog, event: int, door: DoorId, *, now_ns: int, time_ns: int
    ) -> tuple[float, bool]:
        """Return P(open) of a door, and whether enough was seen of it to tell.

        Args:
            log: With all that was written.
            event: Up to which.
            door: Which.
            now_ns: What had happened by then counts.
            time_ns: Of the forecast; before now, only what had happened by then counts.
        """
        known_ns = min(now_ns, time_ns)
        with self._learning:
            self._take_in(log, event)
            beliefs = self._by_estimator[default_estimator(time_ns - known_ns)]
            said = beliefs.predict(door, np.array([time_ns]), np.array([known_ns]))
        return float(said.p_open[0]), bool(said.is_known[0])

    def forget(self) -> None:
        """Begin anew with the next question: the log lost its end."""
        with self._learning:
            self._by_estimator = {}

    def _take_in(self, log: DoorLog, event: int) -> None:
        """Learn what came since, up to an event; a retraction begins anew.

        Another thread may have learnt of later ones already.
        """
        if self._by_estimator and event > self._event:
            since, until = Moment(event=self._event + 1), Moment(event=event + 1)
            batches = list(log.batches(since, until))
            if any(Retracted in batch for batch in batches):
                self._by_estimator = {}
            else:
                for batch in batches:
                    self._by_estimator[NOW].evidence.apply(batch)
                self._event = event
        if not self._by_estimator:
            projection = BeliefProjection(NOW, log.info.timezone)
            near = log.fold(projection, event=event) if event >= 0 else projection.initial()
            far = Beliefs(by_name(LATER), near.clock, near.evidence)
            self._by_estimator = {NOW: near, LATER: far}
            self._event = event
