"""What an estimator says: P(open) at some times, how sure it is, and whether it knows at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Probabilities = NDArray[np.float64]

PRIOR_P = 0.5
"""P(open) of a door of which nothing is known."""
LEAST, MOST = 0.001, 0.999
"""No forecast is more certain: a log-loss stays finite, and a surprise possible."""
INTERVAL = 0.9
"""How often the true frequency shall lie between `low` and `high`."""

NORMAL_REACH = 1.6449
"""Standard deviations to each end of `INTERVAL` of a normal."""
_CANTELLI = (2 / (1 - INTERVAL) - 1) ** 0.5
"""Of any distribution at most a half of what `INTERVAL` leaves lies farther off on one side."""
_LEAST_VARIANCE = 1e-9
_FEWEST = 1e-6
"""Days that count as none."""


@dataclass(frozen=True, slots=True)
class Forecast:
    """P(open) of one door at n times; the columns are as long as there are times."""

    p_open: Probabilities
    """(n,), between `LEAST` and `MOST`."""
    low: Probabilities
    """(n,), lower end of the credible interval of `INTERVAL`."""
    high: Probabilities
    """(n,), its upper end."""
    is_known: NDArray[np.bool_]
    """(n,), False: the evidence is below the stated amount, and `p_open` is what doors are like
    of which nothing is known."""
    effective_days: Probabilities
    """(n,), days of evidence about that time of day that it rests on, old ones discounted."""

    @classmethod
    def of(
        cls,
        p_open: Probabilities,
        low: Probabilities,
        high: Probabilities,
        is_known: NDArray[np.bool_],
        effective_days: Probabilities | None = None,
    ) -> Forecast:
        """Return a forecast with its bounds kept: LEAST <= low <= p_open <= high <= MOST."""
        p_open = np.clip(p_open, LEAST, MOST)
        low, high = np.clip(low, LEAST, p_open), np.clip(high, p_open, MOST)
        days = np.zeros(len(p_open)) if effective_days is None else effective_days
        return cls(p_open, low, high, is_known, days)

    @classmethod
    def of_nothing(cls, count: int) -> Forecast:
        """Return forecasts for a door of which nothing is known."""
        p_open = np.full(count, PRIOR_P)
        return cls.around(p_open, p_open**2, np.zeros(count, np.bool_))

    @classmethod
    def of_share(
        cls,
        share: Probabilities,
        days: Probabilities,
        is_known: NDArray[np.bool_],
    ) -> Forecast:
        """Return shares of the time in which a door was open, with Wilson's interval.

        Args:
            share: (n,).
            days: (n,), in how many the share was seen: minutes of one day do not prove each other.
            is_known: (n,), False: nothing is known, whatever `share` says.
        """
        p_open = np.where(is_known, share, PRIOR_P)
        low, high = _wilson(p_open, 1.0 / np.maximum(days, _FEWEST))
        nothing = ~is_known
        return cls.of(
            p_open, np.where(nothing, LEAST, low), np.where(nothing, MOST, high), is_known, days
        )

    @classmethod
    def around(
        cls,
        p_open: Probabilities,
        variance: Probabilities,
        is_known: NDArray[np.bool_],
        effective_days: Probabilities | None = None,
    ) -> Forecast:
        """Return a forecast with an interval for P(open) being known with that variance.

        It is Wilson's, of as many observations as give a share of that variance. Where not even
        one gives so much, Cantelli's inequality bounds it: whatever the distribution, no more lies
        beyond so many standard deviations.

        Args:
            p_open: (n,).
            variance: (n,), of P(open) itself; what is impossible for a probability is cut.
            is_known: (n,).
            effective_days: (n,).
        """
        p_open = np.clip(p_open, LEAST, MOST)
        most = p_open * (1.0 - p_open)
        # 1 / n; a share of n observations has the variance p (1 - p) / (n + 1), by Laplace's rule.
        few = variance / np.maximum(most - variance, _LEAST_VARIANCE)
        low, high = _wilson(p_open, few)
        farthest = np.where(few > 1, _CANTELLI * np.sqrt(np.maximum(variance, 0)), 1.0)
        low, high = np.maximum(low, p_open - farthest), np.minimum(high, p_open + farthest)
        return cls.of(p_open, low, high, is_known, effective_days)

    def __len__(self) -> int:
        return len(self.p_open)

    @property
    def p_closed(self) -> Probabilities:
        """(n,), 1 - P(open): a door between both states is no evidence."""
        return 1.0 - self.p_open


def _wilson(share: Probabilities, few: Probabilities) -> tuple[Probabilities, Probabilities]:
    """Return both ends of Wilson's score interval: wide near 0 and 1, too, where little was seen.

    E. B. Wilson, J. Am. Stat. Assoc. 22, 1927.

    Args:
        share: (n,), that was seen.
        few: (n,), 1 / of how many observations.
    """
    middle = share + 0.5 * NORMAL_REACH**2 * few
    reach = NORMAL_REACH * np.sqrt(share * (1.0 - share) * few + (0.5 * NORMAL_REACH * few) ** 2)
    wider = 1.0 + NORMAL_REACH**2 * few
    return (middle - reach) / wider, (middle + reach) / wider
