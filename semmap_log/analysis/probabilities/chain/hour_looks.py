"""How well modes explain what was looked at, hour by hour."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.probabilities.chain import hour_modes
from semmap_log.analysis.probabilities.chain.looks import Looks
from semmap_log.analysis.probabilities.chain.markov_chain import Steps, step_matrices
from semmap_log.analysis.probabilities.chain.matrix_scan import states
from semmap_log.core.model.local_clock import LocalClock
from semmap_log.core.model.moments import HOUR_NS

Reals = NDArray[np.float64]

HOURS_AT_ONCE = 256
"""So many hours' steps are worked out together: more would fill memory."""


class HourLooks:
    """What was looked at in each hour, as what it makes of the state before, in each mode."""

    def __init__(self, looks: Looks, clock: LocalClock) -> None:
        """Go through looks at a door.

        Args:
            looks: One in each half hour at least, be it blind.
            clock: Whose hours.
        """
        gap_ns = looks.gap_ns
        hour = np.maximum.accumulate(clock.hour_of(looks.times_ns - gap_ns // 2))
        begins = np.flatnonzero(np.diff(hour, prepend=hour[:1] - 1))
        self.hour = hour[begins]
        """(hours,): which they are, ascending, counted as in `LocalClock.hour_of`."""
        self._through = _through(gap_ns / HOUR_NS, looks.llr, begins)

    def explained(self, likely: Reals | None) -> Reals:
        """Return the log-likelihood of what was seen in each hour, (hours, modes).

        Args:
            likely: (hours, modes): how likely each is in each mode, so that what was seen before
                and after speaks, too; None: each hour stands alone.
        """
        if likely is None:
            first = np.stack([1 - hour_modes.SHARE, hour_modes.SHARE])[:, None]
            later = np.ones((2, len(self.hour)))
        else:
            mean = (self._through * likely).sum(-1, keepdims=True)
            even = np.full((2, 1), 0.5)
            before = states(mean, even)[..., 0]
            after = states(mean.swapaxes(0, 1)[:, :, ::-1], even)[:, ::-1, 0]
            first = np.concatenate([even, before[:, :-1]], axis=1)[..., None]
            later = np.concatenate([after[:, 1:], even], axis=1)
        reached = self._through[:, 0] * first[0] + self._through[:, 1] * first[1]
        return np.asarray(np.log(reached[0] * later[0, :, None] + reached[1] * later[1, :, None]))


def _through(gap_h: Reals, llr: Reals, begins: NDArray[np.intp]) -> Reals:
    """Return (2, 2, hours, modes): from the weight of a state before an hour to that behind it."""
    lasts = np.diff(np.append(begins, len(llr)))
    found = np.zeros((2, 2, len(begins), len(hour_modes.SHARE)))
    found[0, 0] = found[1, 1] = 1.0
    for start in range(0, len(begins), HOURS_AT_ONCE):
        for number in range(int(lasts[start : start + HOURS_AT_ONCE].max())):
            on = start + np.flatnonzero(lasts[start : start + HOURS_AT_ONCE] > number)
            place = begins[on] + number
            kept = np.exp(-gap_h[place][:, None] * hour_modes.PER_H)
            from_closed = (1 - kept) * hour_modes.SHARE
            step = step_matrices(Steps(from_closed, from_closed + kept), llr[place])
            so_far = found[:, :, on]
            found[:, :, on] = step[:, 0, None] * so_far[0] + step[:, 1, None] * so_far[1]
    return found
