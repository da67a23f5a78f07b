"""What forecasts lost on each day: sums that a bootstrap can draw days from."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.beliefs.trials import Trials
from semmap_log.analysis.probabilities.scores import Probabilities, squared_errors, surprises
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.local_clock import LocalClock

LOSSES: Mapping[str, Callable[[Probabilities, Probabilities], Probabilities]] = {
    "brier": squared_errors,
    "log_loss": surprises,
}
"""Figures that are means over forecasts -> what each forecast adds. The others are none."""


@dataclass(frozen=True, slots=True)
class DayLosses:
    """What the forecasts of one door lost, by the day that they are of."""

    days: NDArray[np.int64]
    """(n,), ascending: local days on which there were forecasts."""
    count: NDArray[np.float64]
    """(n,), how many."""
    sums: Mapping[str, NDArray[np.float64]]
    """Figure -> (n,), what they lost together."""

    @classmethod
    def of(cls, trials: Trials, p: Probabilities, clock: LocalClock) -> DayLosses:
        """Return the losses of forecasts.

        Args:
            trials: What was asked.
            p: (n,), P(outcome 1) of each.
            clock: Whose midnights part the days.
        """
        days, place = np.unique(clock.hour_of(trials.times_ns) // 24, return_inverse=True)
        sums = {
            figure: np.bincount(place, loss(p, trials.outcome), len(days))
            for figure, loss in LOSSES.items()
        }
        return cls(days, np.bincount(place, minlength=len(days)).astype(np.float64), sums)


DoorLosses = Mapping[DoorId, DayLosses]


@dataclass
class LossBook:
    """Reads forecasts as they are made (`evaluate_all`), and keeps what each day lost."""

    clock: LocalClock
    losses: dict[tuple[str, str], dict[DoorId, DayLosses]] = field(
        default_factory=lambda: defaultdict(dict)
    )
    """(protocol, estimator) -> door -> its losses."""

    def __call__(self, protocol: str, estimator: str, trials: Trials, p: Probabilities) -> None:
        self.losses[protocol, estimator][trials.door_id] = DayLosses.of(trials, p, self.clock)
