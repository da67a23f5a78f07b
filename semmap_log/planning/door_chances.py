"""How likely doors let a robot in while it is on a round, and which of them are worth a try."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Probabilities = NDArray[np.float64]

UNKNOWN_P = 0.5
"""P of a door without evidence, where there is no door with any."""
DAY_S = 86_400.0


@dataclass(frozen=True, slots=True, eq=False)
class DoorChances:
    """P that n doors let the robot in, at k times of a round, `step_s` apart from its start on."""

    p_passes: Probabilities
    """(n, k)."""
    low: Probabilities
    """(n, k): of the 90 % interval."""
    high: Probabilities
    is_known: NDArray[np.bool_]
    """(n,), False: too little was seen of the door to say anything, and its numbers are stand-ins:
    see `with_stand_ins`."""
    unseen_s: NDArray[np.float64]
    """(n,): for how long nobody has looked at it when the round begins; inf: nobody ever did."""
    step_s: float

    def with_stand_ins(self) -> DoorChances:
        """Return the same where a door of which nothing is known counts as the others on average.

        Its interval is 0..1: it is never left out for being shut.
        """
        known, unknown = self.is_known, ~self.is_known
        mean = self.p_passes[known].mean(axis=0) if known.any() else UNKNOWN_P
        p_passes, low, high = self.p_passes.copy(), self.low.copy(), self.high.copy()
        p_passes[unknown], low[unknown], high[unknown] = mean, 0.0, 1.0
        return DoorChances(p_passes, low, high, known, self.unseen_s, self.step_s)

    def interval_at(self, row: int, time_s: float) -> tuple[float, float]:
        """Return the interval of a door's P at a time of the round."""
        times_s = np.arange(self.low.shape[1]) * self.step_s
        return (
            float(np.interp(time_s, times_s, self.low[row])),
            float(np.interp(time_s, times_s, self.high[row])),
        )

    def or_else(self, p_open: DoorChances) -> DoorChances:
        """Return P(passes) where it is known, else P(open): a door that is open lets one in.

        Whether one that is shut would open for who asks is not known then: P may be up to 1.
        """
        stands_in = ~self.is_known & p_open.is_known
        p_passes, low, high = self.p_passes.copy(), self.low.copy(), self.high.copy()
        p_passes[stands_in] = p_open.p_passes[stands_in]
        low[stands_in], high[stands_in] = p_open.low[stands_in], 1.0
        known = self.is_known | stands_in
        return DoorChances(p_passes, low, high, known, self.unseen_s, self.step_s)


@dataclass(frozen=True, slots=True)
class SkipRule:
    """Which doors are left out: those that are shut for all that is known, and were looked at.

    What is not tried is not learnt. So it takes more than a low P: even the upper end of its
    interval must be low, and the door is looked at again after `again_s`, whatever is believed.
    """

    below: float = 0.25
    """The upper end of the 90 % interval of P; 0: no door is left out."""
    again_s: float = DAY_S

    def is_skipped(self, chances: DoorChances) -> NDArray[np.bool_]:
        """Return which doors are left out all through the round; none that is not known."""
        is_shut = chances.high.max(axis=1) < self.below
        found: NDArray[np.bool_] = is_shut & chances.is_known & (chances.unseen_s < self.again_s)
        return found
