"""What an estimator is: it learns from evidence, and makes forecasts of any time.

Every forecast has two times: the one it is of, and the one up to which evidence counts. So one
object answers what was known at any time, an evaluation requests a million pairs at once, and later
recordings change none of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.evidence.evidence import DoorEvidence
from semmap_log.analysis.probabilities.forecast import Forecast
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import LocalClock

Times = NDArray[np.int64]


class LearntModel(Protocol):
    """What was learnt from the evidence about the doors of a log."""

    def predict(self, door_id: DoorId, times_ns: Times, known_ns: Times) -> Forecast:
        """Return how likely the door is open.

        Args:
            door_id: Any; of a door without evidence nothing is known.
            times_ns: (n,), of each forecast.
            known_ns: (n,), of each: only what had happened by then counts.
        """


@runtime_checkable
class StateModel(Protocol):
    """A learnt model that follows a door's state over time."""

    def wait_s(
        self,
        door_id: DoorId,
        at_ns: int,
        *,
        until_open: bool = True,
        most_s: float | None = None,
        known_ns: int | None = None,
        is_other: bool = False,
    ) -> float:
        """Return the expected wait until a door is open, or closed, in seconds; NaN: not known.

        A wait ends after `most_s`; None: no limit. It rests on what was known at `known_ns`, by
        default at `at_ns`. With `is_other` the door is surely in the other state then.
        """

    def wait_interval_s(
        self, door_id: DoorId, at_ns: int, *, until_open: bool = True
    ) -> tuple[float, float]:
        """Return the ends of the 90 % interval of that expected wait; 0: it may be any pace."""


class Estimator(Protocol):
    """A method; its settings are its fields, and the same evidence gives the same forecasts."""

    @property
    def name(self) -> str:
        """Its name on the command line."""

    def learn(self, evidence: Mapping[DoorId, DoorEvidence], clock: LocalClock) -> LearntModel:
        """Return what the evidence teaches; the work may wait until the first request."""
