"""What most methods do: learn about one door at a time, on its first request."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Generic, Protocol, TypeVar

from semmap_log.analysis.probabilities.estimator import Times
from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.forecast import Forecast
from semmap_log.core.batches.event_batch import distinct
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.moments import DAY_NS

MOST_DOORS, MOST_DAYS = 8, 1_100
"""The tables of so many doors, of so many days in all, are kept: those requested last. A thousand
days are some 40 MB."""


class LearntOfDoor(Protocol):
    """What was learnt about one door."""

    def predict(self, times_ns: Times, known_ns: Times) -> Forecast:
        """Return forecasts: see `LearntModel.predict`."""


D = TypeVar("D", bound=LearntOfDoor)


class LearntByDoor(Generic[D]):
    """What was learnt about all doors; each by itself."""

    def __init__(
        self, evidence: Mapping[DoorId, DoorEvidence], learn: Callable[[DoorEvidence], D]
    ) -> None:
        """Take the evidence; nothing is learnt yet.

        Args:
            evidence: Of all doors.
            learn: Returns what the evidence of one door teaches.
        """
        self.evidence = evidence
        self._learn = learn
        self._doors: dict[DoorId, tuple[D, int]] = {}
        """What was learnt, and from how many days; ordered by the last request."""

    def predict(self, door_id: DoorId, times_ns: Times, known_ns: Times) -> Forecast:
        """Return how likely the door is open: see `LearntModel`."""
        if door_id not in self.evidence:
            return Forecast.of_nothing(len(times_ns))
        return self.door(door_id).predict(times_ns, known_ns)

    def door(self, door_id: DoorId) -> D:
        """Return what was learnt about a door that there is evidence of."""
        kept = self._doors.pop(door_id, None)
        if kept is None:
            evidence = self.evidence[door_id]
            kept = self._learn(evidence), _days(evidence)
        self._doors[door_id] = kept
        while len(self._doors) > MOST_DOORS or (
            len(self._doors) > 1 and sum(days for _, days in self._doors.values()) > MOST_DAYS
        ):
            del self._doors[next(iter(self._doors))]
        return kept[0]


def _days(evidence: DoorEvidence) -> int:
    """Return on how many days something was known, more or less."""
    held_ns = int((evidence.end_ns - evidence.start_ns).sum())
    return held_ns // DAY_NS + len(distinct(evidence.seen_ns // DAY_NS))
