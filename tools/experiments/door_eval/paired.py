"""How far one estimator is ahead of another on the same forecasts, and how surely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from door_eval.day_losses import DoorLosses

RESAMPLES = 2000
SEED = 0
"""Of the resamples: the same for all pairs, so that the same days are drawn for all."""
INTERVAL = 0.95
LEAST_DAYS = 6
"""Of fewer days even one sign on all is no proof at 5 % (sign test: 2 / 2^5); their resamples are
too much alike to tell."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Difference:
    """A figure of one estimator minus that of another: below 0 the first is ahead."""

    mean: float
    standard_error: float
    """Over the seeds; of one seed: over resamples of the days."""
    low: float
    """Lower end of the `INTERVAL` of resamples of the days."""
    high: float
    days: int
    """On so many days there were forecasts."""
    seeds: int

    @property
    def is_clear(self) -> bool:
        """0 lies outside of the interval: it is not by the days that happened to be tested."""
        return self.days >= LEAST_DAYS and (self.low > 0 or self.high < 0)


def difference(
    ours: Sequence[DoorLosses], theirs: Sequence[DoorLosses], figure: str
) -> Difference | None:
    """Return how two estimators differ on the same forecasts; None: there are none.

    Days are drawn with replacement, all doors of a day together: what happens on a day in a
    building is one case, however many minutes and doors it has (Efron and Tibshirani, An
    Introduction to the Bootstrap, 1993). Other doors are not drawn: it says nothing of buildings
    that are not in the set.

    Args:
        ours: Of each seed; the first of a pair.
        theirs: The second, of the same seeds.
        figure: One of `LOSSES`.
    """
    pairs = [_table(a, b, figure) for a, b in zip(ours, theirs, strict=True)]
    count = pairs[0][1]
    if not count.sum():
        return None
    by_seed = [_mean(lost, count) for lost, _ in pairs]
    lost = np.mean([lost for lost, _ in pairs], axis=0)
    drawn = _resampled(lost, count)
    tail = 100 * (1 - INTERVAL) / 2
    low, high = np.percentile(drawn, [tail, 100 - tail])
    return Difference(
        mean=float(np.mean(by_seed)),
        standard_error=standard_error(by_seed) if len(pairs) > 1 else float(np.std(drawn, ddof=1)),
        low=float(low),
        high=float(high),
        days=len(count),
        seeds=len(pairs),
    )


def standard_error(values: Sequence[float]) -> float:
    """Return that of the mean of several values."""
    return float(np.std(values, ddof=1) / np.sqrt(len(values)))


def _table(ours: DoorLosses, theirs: DoorLosses, figure: str) -> tuple[Floats, Floats]:
    """Return (difference of the sums, count), each (days, doors)."""
    days = np.unique(np.concatenate([ours[door].days for door in ours]))
    lost, count = np.zeros((2, len(days), len(ours)))
    for place, door in enumerate(ours):
        rows = np.searchsorted(days, ours[door].days)
        lost[rows, place] = ours[door].sums[figure] - theirs[door].sums[figure]
        count[rows, place] = ours[door].count
    return lost, count


def _mean(lost: Floats, count: Floats) -> float:
    """Return the mean over the doors, each weighing the same, of the mean over its forecasts."""
    forecasts = count.sum(0)
    has = forecasts > 0
    return float(np.mean(lost.sum(0)[has] / forecasts[has]))


def _resampled(lost: Floats, count: Floats) -> Floats:
    """Return that mean of each resample; a door of which no day was drawn does not count."""
    random = np.random.default_rng(SEED)
    drawn = random.multinomial(len(lost), np.full(len(lost), 1 / len(lost)), RESAMPLES)
    forecasts = drawn @ count
    each = np.where(forecasts > 0, drawn @ lost / np.maximum(forecasts, 1), np.nan)
    return np.asarray(np.nanmean(each, axis=1))
