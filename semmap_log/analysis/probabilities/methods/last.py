"""`last`: the door is as it was last seen. What a map without probabilities believes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.forecast import LEAST, MOST, PRIOR_P, Forecast, Probabilities
from semmap_log.analysis.probabilities.methods.by_door import LearntByDoor
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import LocalClock

Times = NDArray[np.int64]


class DoorLast:
    """The last reports about one door."""

    def __init__(self, evidence: DoorEvidence) -> None:
        self._reported_ns, self._said = _said(evidence)

    def predict(self, times_ns: Times, known_ns: Times) -> Forecast:
        """Return the last state, however old, as sure as its sensor: see `LearntModel`."""
        place = np.searchsorted(self._reported_ns, np.minimum(times_ns, known_ns), "right")
        p_open = np.append(PRIOR_P, self._said)[place]
        is_known = place > 0
        low, high = np.where(is_known, p_open, LEAST), np.where(is_known, p_open, MOST)
        return Forecast.of(p_open, low, high, is_known)


@dataclass(frozen=True, slots=True)
class Last:
    """The estimator."""

    name: str = "last"

    def learn(
        self,
        evidence: Mapping[DoorId, DoorEvidence],
        clock: LocalClock,  # noqa: ARG002 - as all do
    ) -> LearntByDoor[DoorLast]:
        """Return what the evidence teaches."""
        return LearntByDoor(evidence, DoorLast)


def _said(evidence: DoorEvidence) -> tuple[Times, Probabilities]:
    """Return when the door was reported open or closed, ascending, and P(open) by that alone."""
    seen = np.where(
        evidence.reads_open,
        evidence.accuracy_open / (evidence.accuracy_open + 1 - evidence.accuracy_closed),
        (1 - evidence.accuracy_open) / (1 - evidence.accuracy_open + evidence.accuracy_closed),
    )
    times_ns = np.concatenate([evidence.seen_ns, evidence.start_ns])
    p_open = np.concatenate([seen, evidence.is_open.astype(np.float64)])
    order = np.argsort(times_ns, kind="stable")
    return times_ns[order], p_open[order]
