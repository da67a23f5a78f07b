"""An estimator as a fold over a log's events: evidence goes in, beliefs come out.

The command line selects estimators by their names here.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.estimator import Estimator, LearntModel
from semmap_log.analysis.probabilities.evidence.evidence import Evidence
from semmap_log.analysis.probabilities.forecast import Forecast
from semmap_log.analysis.probabilities.methods.baselines import CONSTANT, HOUR_OF_DAY, HOUR_OF_WEEK
from semmap_log.analysis.probabilities.methods.count import Count
from semmap_log.analysis.probabilities.methods.filter import Filter
from semmap_log.analysis.probabilities.methods.fremen import PERIODS_S, Fremen
from semmap_log.analysis.probabilities.methods.last import Last
from semmap_log.analysis.probabilities.methods.schedule import Schedule
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.errors import EstimatorError


class Beliefs:
    """The beliefs of an estimator from the evidence so far.

    It learns on the first request, and again if there is new evidence since.
    """

    def __init__(
        self, estimator: Estimator, clock: LocalClock, evidence: Evidence | None = None
    ) -> None:
        self.estimator = estimator
        self.clock = clock
        self.evidence = evidence or Evidence()
        self._learnt: tuple[LearntModel, int, int] | None = None
        """What was learnt, from how many reports, and up to when."""

    def __getstate__(self) -> dict[str, Any]:
        """Return what another process needs; it learns again itself."""
        return self.__dict__ | {"_learnt": None}

    @property
    def door_ids(self) -> list[DoorId]:
        """Doors with any report, removed ones included, ascending."""
        return self.evidence.door_ids

    def predict(
        self,
        door_id: DoorId,
        times_ns: NDArray[np.int64],
        known_ns: NDArray[np.int64] | None = None,
    ) -> Forecast:
        """Return how likely a door is open.

        Args:
            door_id: Any; of a door without evidence nothing is known.
            times_ns: (n,), of each forecast.
            known_ns: (n,), of each: only what had happened by then counts. Default: all that is
                known, but nothing later than the forecast.
        """
        times_ns = np.atleast_1d(np.asarray(times_ns, np.int64))
        if known_ns is None:
            known_ns = np.minimum(times_ns, self.evidence.latest_ns)
        known_ns = np.broadcast_to(np.asarray(known_ns, np.int64), times_ns.shape)
        until_ns = int(known_ns.max(initial=self.evidence.latest_ns))
        return self.learnt(until_ns).predict(door_id, times_ns, known_ns)

    def learnt(self, until_ns: int | None = None) -> LearntModel:
        """Return what the evidence teaches; it answers for any moment up to `until_ns`.

        Args:
            until_ns: Default: the latest event's time.
        """
        wanted_ns = self.evidence.latest_ns if until_ns is None else until_ns
        if self._learnt is not None:
            learnt, words, learnt_until_ns = self._learnt
            if words == len(self.evidence) and wanted_ns <= learnt_until_ns:
                return learnt
        learnt = self.estimator.learn(self.evidence.up_to(wanted_ns), self.clock)
        self._learnt = learnt, len(self.evidence), wanted_ns
        return learnt


class BeliefProjection:
    """The fold: `log.fold(BeliefProjection("filter", log.info.timezone))`, also live.

    A checkpoint keeps the evidence, so that one serves all estimators. A retraction of folded
    events folds the log again (see `semmap_log.log.replay`), and what had been learnt is dropped
    with the state that it was learnt from.
    """

    name = "evidence"
    version = 1

    def __init__(self, estimator: Estimator | str, tz: str) -> None:
        """Take a method, or its name.

        Raises:
            EstimatorError: There is no estimator of that name.
            MomentError: There is no such zone.
        """
        self._estimator = by_name(estimator) if isinstance(estimator, str) else estimator
        self._clock = LocalClock(tz)

    def initial(self) -> Beliefs:
        """Return beliefs without evidence."""
        return Beliefs(self._estimator, self._clock)

    def apply(self, state: Beliefs, batch: EventBatch, /) -> Beliefs:
        """Fold a batch in."""
        state.evidence.apply(batch)
        return state

    def merge(self, earlier: Beliefs, later: Beliefs, /) -> Beliefs:
        """Return the beliefs of both parts of a log."""
        earlier.evidence.add(later.evidence)
        return earlier

    def dump(self, state: Beliefs, /) -> bytes:
        """Return the evidence as bytes."""
        return state.evidence.dump()

    def load(self, data: bytes, /) -> Beliefs:
        """Return beliefs from the evidence in the bytes of `dump`."""
        return Beliefs(self._estimator, self._clock, Evidence.load(data))


ESTIMATORS: dict[str, Estimator] = {
    one.name: one
    for one in (
        Filter(),
        Schedule(),
        Count(),
        Last(),
        Fremen(),
        CONSTANT,
        HOUR_OF_DAY,
        HOUR_OF_WEEK,
    )
}
"""Name -> estimator, with the settings that it has by default."""


def by_name(name: str) -> Estimator:
    """Return the estimator of that name; FreMEn of any order: fremen1..fremen84.

    Raises:
        EstimatorError: There is no such estimator.
    """
    if name in ESTIMATORS:
        return ESTIMATORS[name]
    fremen = re.fullmatch(r"fremen(\d{1,2})", name, re.ASCII)
    if fremen and 1 <= int(fremen[1]) <= len(PERIODS_S):
        return Fremen(int(fremen[1]))
    known = ", ".join(ESTIMATORS)
    raise EstimatorError(
        f"estimator {name!r}: expected one of {known}, fremen1..fremen{len(PERIODS_S)}."
    )
