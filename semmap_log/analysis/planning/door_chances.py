"""How likely doors let a robot in while it is on a round, and which of them are worth a try."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Probabilities = NDArray[np.float64]

UNKNOWN_P = 0.5
"""P of a door without evidence, where there is no door with any."""
MEAN_COUNTS = 2.0
"""As so many looks the mean of the others counts for a door of which too little is known."""
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
    looks: NDArray[np.int64]
    """(n, 2): looks at such hours of such days, and how many of them found it open: see
    `looks_then`."""
    looks_high: NDArray[np.float64]
    """(n,): the upper end of the 90 % interval of the share that is open."""
    unseen_s: NDArray[np.float64]
    """(n,): for how long nobody has looked at it when the round begins; inf: nobody ever did."""
    step_s: float

    def with_stand_ins(self, others: Probabilities | None = None) -> DoorChances:
        """Return the same where a door of which too little is known counts as the others do.

        It is their mean, and its own looks at such hours where there are any; its interval is
        0..1.

        Args:
            others: (k,), their mean; None: of the doors here.
        """
        unknown = ~self.is_known
        mean = self.mean() if others is None else others
        p_passes, low, high = self.p_passes.copy(), self.low.copy(), self.high.copy()
        looks, found_open = self.looks[unknown].T[:, :, None]
        p_passes[unknown] = (found_open + MEAN_COUNTS * mean) / (looks + MEAN_COUNTS)
        low[unknown], high[unknown] = 0.0, 1.0
        return replace(self, p_passes=p_passes, low=low, high=high)

    def mean(self) -> Probabilities:
        """Return (k,): the mean P of the doors of which enough is known."""
        if not self.is_known.any():
            return np.full(self.p_passes.shape[1], UNKNOWN_P)
        found: Probabilities = self.p_passes[self.is_known].mean(axis=0)
        return found

    def with_row(self, row: int, of_door: DoorChances) -> DoorChances:
        """Return the same with what was learnt of one door since; of when it was seen nothing."""
        changed = {}
        for name in ("p_passes", "low", "high", "is_known", "looks", "looks_high"):
            changed[name] = getattr(self, name).copy()
            changed[name][row] = getattr(of_door, name)[0]
        return replace(self, **changed)

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
        return replace(self, p_passes=p_passes, low=low, high=high, is_known=known)


@dataclass(frozen=True, slots=True)
class SkipRule:
    """Which doors are left out: those that are shut for all that is known, and were looked at.

    What is not tried is not learnt. So it takes more than a low P: at such hours of such days it
    was found shut so often that even the upper end of the interval of how often it is open is
    low. And it takes more than that: who has just seen a door open that mostly is not goes there.
    A door is looked at again after `again_s`, whatever was found. One that nobody has looked at
    then is never left out.
    """

    below: float = 0.4
    """The upper end of the 90 % interval; 0: no door is left out."""
    again_s: float = DAY_S
    p_below: float = 0.12
    """P at each time of the round, by the last look, too."""

    def seem_shut(self, chances: DoorChances) -> NDArray[np.bool_]:
        """Return which doors are shut for all that is known."""
        is_unlikely = chances.p_passes.max(axis=1) < self.p_below
        found: NDArray[np.bool_] = (chances.looks_high < self.below) & is_unlikely
        return found

    def is_skipped(self, chances: DoorChances) -> NDArray[np.bool_]:
        """Return which doors are left out of the round."""
        found: NDArray[np.bool_] = self.seem_shut(chances) & (chances.unseen_s < self.again_s)
        return found
