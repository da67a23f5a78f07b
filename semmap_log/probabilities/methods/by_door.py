"""What most methods do: learn about one door at a time, when it is first asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Generic, Protocol, TypeVar

from semmap_log.domain.doors import DoorId
from semmap_log.probabilities.estimator import Times
from semmap_log.probabilities.evidence.evidence import DoorEvidence
from semmap_log.probabilities.forecast import Forecast

MOST_DOORS = 8
"""So many doors' tables are kept: those asked for last. Three years of one are some 30 MB."""


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
        self._doors: dict[DoorId, D] = {}

    def predict(self, door_id: DoorId, times_ns: Times, known_ns: Times) -> Forecast:
        """Return how likely the door is open: see `LearntModel`."""
        if door_id not in self.evidence:
            return Forecast.of_nothing(len(times_ns))
        return self.door(door_id).predict(times_ns, known_ns)

    def door(self, door_id: DoorId) -> D:
        """Return what was learnt about a door that there is evidence of."""
        learnt = self._doors.pop(door_id, None) or self._learn(self.evidence[door_id])
        self._doors[door_id] = learnt
        if len(self._doors) > MOST_DOORS:
            del self._doors[next(iter(self._doors))]
        return learnt
