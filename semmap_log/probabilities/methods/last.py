"""`last`: the door is as it was last seen. What a map without probabilities believes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.doors import DoorId
from semmap_log.probabilities.evidence.evidence import DoorEvidence
from semmap_log.probabilities.forecast import LEAST, MOST, Forecast, Probabilities
from semmap_log.probabilities.local_clock import LocalClock
from semmap_log.probabilities.methods.habits import PRIOR_P
from semmap_log.probabilities.methods.schedule import nothing_known

Times = NDArray[np.int64]


class LearntLast:
    """The last words about all doors."""

    def __init__(self, evidence: Mapping[DoorId, DoorEvidence]) -> None:
        self._evidence = evidence

    def predict(self, door_id: DoorId, times_ns: Times, known_ns: Times) -> Forecast:
        """Return the last state: see `Learnt`; as sure as its sensor, however long ago it was."""
        if door_id not in self._evidence:
            return nothing_known(len(times_ns))
        said_ns, said = _said(self._evidence[door_id])
        place = np.searchsorted(said_ns, np.minimum(times_ns, known_ns), "right")
        p_open = np.append(PRIOR_P, said)[place]
        is_known = place > 0
        low, high = np.where(is_known, p_open, LEAST), np.where(is_known, p_open, MOST)
        return Forecast.of(p_open, low, high, is_known)


@dataclass(frozen=True, slots=True)
class Last:
    """The estimator."""

    name: str = "last"

    def learn(self, evidence: Mapping[DoorId, DoorEvidence], clock: LocalClock) -> LearntLast:  # noqa: ARG002 - as all
        """Return what the evidence teaches."""
        return LearntLast(evidence)


def _said(evidence: DoorEvidence) -> tuple[Times, Probabilities]:
    """Return when the door was said to be open or closed, ascending, and P(open) by that alone."""
    seen = np.where(
        evidence.reads_open,
        evidence.accuracy_open / (evidence.accuracy_open + 1 - evidence.accuracy_closed),
        (1 - evidence.accuracy_open) / (1 - evidence.accuracy_open + evidence.accuracy_closed),
    )
    times_ns = np.concatenate([evidence.seen_ns, evidence.start_ns])
    p_open = np.concatenate([seen, evidence.is_open.astype(np.float64)])
    order = np.argsort(times_ns, kind="stable")
    return times_ns[order], p_open[order]
