"""`count`: the share of the known time in which the door was open, whatever the hour.

By time, not by events: openings and closings alternate, so that half of a door's changes are
openings, however rarely it is open. Readings of noisy sensors are corrected by their accuracies
(Rogan and Gladen, Am. J. Epidemiol. 107, 1978), else they pull every door toward one half.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.day_tables import covered_ns
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.forecast import LEAST, MOST, PRIOR_P, Forecast
from semmap_log.analysis.probabilities.methods.by_door import LearntByDoor
from semmap_log.analysis.probabilities.methods.effective_days import EvidenceDays, lasting_of
from semmap_log.analysis.probabilities.methods.habits import PRIOR_DAYS, slowest_habit
from semmap_log.analysis.probabilities.methods.schedule import LEAST_H, noise_of
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.moments import HOUR_NS

Times = NDArray[np.int64]
Reals = NDArray[np.float64]


class DoorCount:
    """What was counted of one door, at any time."""

    def __init__(self, evidence: DoorEvidence, clock: LocalClock) -> None:
        self._evidence = evidence
        self._evidence_days = EvidenceDays(evidence, clock)
        tables = self._evidence_days.tables
        noise = noise_of(evidence, tables, clock)
        self._lasting = lasting_of(slowest_habit(tables), tables, noise)
        first = evidence.is_visit
        self._visits_ns = evidence.seen_ns[first]
        weight, is_open = _of_visits(evidence, clock)
        self._visits_h = np.append(0.0, np.cumsum(weight))
        self._visits_open_h = np.append(0.0, np.cumsum(is_open))

    def predict(self, times_ns: Times, known_ns: Times) -> Forecast:
        """Return forecasts: see `LearntModel.predict`."""
        until_ns = np.minimum(times_ns, known_ns)
        start_ns, end_ns, is_open = (
            self._evidence.start_ns, self._evidence.end_ns, self._evidence.is_open,
        )  # fmt: skip
        visit = np.searchsorted(self._visits_ns, until_ns, "right")
        held_ns = covered_ns(start_ns, end_ns, until_ns)
        open_ns = covered_ns(start_ns[is_open], end_ns[is_open], until_ns)
        known_h = self._visits_h[visit] + held_ns / HOUR_NS
        open_h = self._visits_open_h[visit] + open_ns / HOUR_NS
        days = known_h / 24
        p_open = (open_h / 24 + PRIOR_DAYS * PRIOR_P) / (days + PRIOR_DAYS)
        p_open = np.where(known_h >= LEAST_H, open_h / np.maximum(known_h, LEAST_H), p_open)
        p_open = np.clip(p_open, LEAST, MOST)
        variance = self._lasting.day_variance(p_open, days, self._evidence_days.row(until_ns))
        return Forecast.around(p_open, variance, known_h >= LEAST_H, days)


@dataclass(frozen=True, slots=True)
class Count:
    """The estimator."""

    name: str = "count"

    def learn(
        self, evidence: Mapping[DoorId, DoorEvidence], clock: LocalClock
    ) -> LearntByDoor[DoorCount]:
        """Return what the evidence teaches."""
        return LearntByDoor(evidence, lambda of_door: DoorCount(of_door, clock))


def _of_visits(evidence: DoorEvidence, clock: LocalClock) -> tuple[Reals, Reals]:
    """Return what each visit adds to the hours known, and open: both (visits,).

    The visits of an hour add up, at each of them, to J^2 hours of their mean: see `day_tables`.
    """
    first = evidence.is_visit
    tells = (evidence.accuracy_open + evidence.accuracy_closed - 1)[first]
    safe = np.where(tells > 0, tells, 1.0)
    reading = evidence.reads_open[first] - (1 - evidence.accuracy_closed[first])
    opened = np.where(tells > 0, tells**2 * reading / safe, 0.0)
    _, hour = np.unique(clock.hour_of(evidence.seen_ns[first]), return_inverse=True)
    return _mean_so_far(tells**2, hour), _mean_so_far(opened, hour)


def _mean_so_far(values: Reals, group: NDArray[np.intp]) -> Reals:
    """Return by how much each value moves the mean of its group; groups ascend."""
    place = np.arange(len(values))
    begins = np.append(True, np.diff(group) != 0)[: len(values)]
    start = np.maximum.accumulate(np.where(begins, place, 0))
    total = np.cumsum(values)
    mean = (total - total[start] + values[start]) / (place - start + 1)
    return np.where(begins, mean, mean - np.append(0.0, mean[:-1])[: len(values)])
