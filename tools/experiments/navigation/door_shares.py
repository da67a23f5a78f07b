"""P(open) of each door as the robot's log teaches it while it drives.

What was seen last decays toward the share of looks in which the door was open; how fast, is learnt
from all doors together, from pairs of looks one after the other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from semmap_log.core.model.doors import DoorId

RATES_S = np.geomspace(1 / (100 * 3600), 1 / 360, 25)
"""The rates of forgetting that are tried, 1/s: of a hundred hours to a tenth of one."""
PRIOR_S = 3600.0
"""Before anything is learnt: as if of two looks so far apart half had differed."""
LEAST, MOST = 0.02, 0.98


ONE_LOOK_S = 90.0
"""Two looks so near to each other that saw the same are one, which lasted."""


class DoorShares:
    """What was seen of the doors, and what follows from it."""

    def __init__(self, doors: Sequence[DoorId]) -> None:
        self._open = dict.fromkeys(doors, 0)
        self._looks = dict.fromkeys(doors, 0)
        self._last: dict[DoorId, tuple[float, bool]] = {}
        self._score = self._of_pair(PRIOR_S, differs=True) + self._of_pair(PRIOR_S, differs=False)
        """Log likelihood of each rate, of all pairs of looks."""
        self.rate_s = float(RATES_S[int(self._score.argmax())])

    def saw(self, at_s: float, door: DoorId, *, is_open: bool) -> None:
        """Take a look in."""
        if door in self._last:
            last_s, was_open = self._last[door]
            if is_open == was_open and at_s - last_s <= ONE_LOOK_S:
                self._last[door] = at_s, is_open
                return
            self._score = self._score + self._of_pair(at_s - last_s, differs=is_open != was_open)
            self.rate_s = float(RATES_S[int(self._score.argmax())])
        self._last[door] = at_s, is_open
        self._looks[door] += 1
        self._open[door] += is_open

    def p_open(self, at_s: float, door: DoorId) -> float:
        """Return how likely the door is open then."""
        share = (self._open[door] + 1) / (self._looks[door] + 2)
        if door in self._last:
            last_s, was_open = self._last[door]
            share += (was_open - share) * math.exp(-self.rate_s * max(0.0, at_s - last_s))
        return min(MOST, max(LEAST, share))

    @staticmethod
    def _of_pair(apart_s: float, *, differs: bool) -> np.ndarray:
        kept = np.exp(-RATES_S * max(apart_s, 1.0))
        found: np.ndarray = np.log((1 - kept) / 2 if differs else (1 + kept) / 2)
        return found
