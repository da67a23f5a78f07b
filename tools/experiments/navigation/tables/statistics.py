"""Means, shares and ratios over seeds, with the intervals that hold them 95 times in 100."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

LEVEL = 0.95
_CELLS = 200_000
_DRAWS = 4_000
FEW = 10
"""So few cases tell more of their number by chance than the seeds that they came from."""
_ONE_SIDED = 1.645


@dataclass(frozen=True)
class Interval:
    """A value, and how far the truth may be from it to both sides; NaN: one seed tells nothing."""

    value: float
    half: float

    @property
    def low(self) -> float:
        """Its lower end."""
        return self.value - self.half

    @property
    def high(self) -> float:
        """Its upper end."""
        return self.value + self.half

    @property
    def is_clear(self) -> bool:
        """Whether it leaves out 0."""
        return self.low > 0 or self.high < 0


@dataclass(frozen=True)
class Ratio:
    """How many times one share is another; infinite where the other is 0."""

    value: float
    low: float
    high: float


@cache
def t_quantile(freedom: int) -> float:
    """Return what Student's t of so many degrees of freedom stays within, both ways, at `LEVEL`.

    Written as a tangent, t has the density cos(angle) ** (freedom - 1): a sum over even cells.
    """
    angle = (np.arange(_CELLS) + 0.5) / _CELLS * np.pi - np.pi / 2
    below = np.cumsum(np.cos(angle) ** (freedom - 1))
    edges = np.arange(_CELLS + 1) / _CELLS * np.pi - np.pi / 2
    found = np.interp((1 + LEVEL) / 2, np.append(0, below) / below[-1], edges)
    return math.sqrt(freedom) * math.tan(found)


def mean_of(values: Sequence[float]) -> Interval:
    """Return the mean over seeds; NaN of none."""
    known = np.array([value for value in values if not math.isnan(value)])
    if len(known) < 2:
        return Interval(float(known[0]) if len(known) else math.nan, math.nan)
    error = known.std(ddof=1) / math.sqrt(len(known))
    return Interval(float(known.mean()), float(t_quantile(len(known) - 1) * error))


def share_of(parts: Sequence[int], wholes: Sequence[int]) -> Interval:
    """Return the share of all parts in all wholes, each pair of one seed.

    The interval is that of a ratio over seeds, not over goals: goals of one run are not
    independent, since a robot that is locked in is refused hundreds of them. Of no part at all
    it is the rule of three, which takes them as independent.
    """
    part, whole = np.array(parts, float), np.array(wholes, float)
    if not whole.sum():
        return Interval(math.nan, math.nan)
    share, seeds = float(part.sum() / whole.sum()), len(part)
    if seeds < 2:
        return Interval(share, math.nan)
    if not part.any():
        return Interval(share, most_behind(0) / float(whole.sum()))
    spread = ((part - share * whole) ** 2).sum() * seeds / (seeds - 1)
    return Interval(share, float(t_quantile(seeds - 1) * math.sqrt(spread) / whole.sum()))


def most_behind(count: int) -> float:
    """Return what a count may stand for: in 95 of 100 cases no more (Poisson; Wilson-Hilferty).

    Of 0 it is 3, the rule of three.
    """
    more = count + 1
    return float(more * (1 - 1 / (9 * more) + _ONE_SIDED / (3 * math.sqrt(more))) ** 3)


def ratio_of(
    one: Sequence[tuple[int, int]], other: Sequence[tuple[int, int]], *, paired: bool
) -> Ratio:
    """Return how many times the share of one is that of the other, by drawing seeds anew.

    Where the other has few cases, the lower end takes it that they stand for more.

    Args:
        one: (part, whole) of each seed.
        other: The same; in the same order of seeds, if they are paired.
        paired: Seeds are shared: the same are drawn for both.
    """
    first, second = np.array(one, float), np.array(other, float)
    rng = np.random.default_rng(1)
    rows = rng.integers(0, len(first), (_DRAWS, len(first)))
    others = rows if paired else rng.integers(0, len(second), (_DRAWS, len(second)))
    with np.errstate(divide="ignore", invalid="ignore"):
        drawn = _shares(first[rows]) / _shares(second[others])
        value = float(_shares(first[None])[0] / _shares(second[None])[0])
    if len(first) < 2 or len(second) < 2 or not (first[:, 0].any() or second[:, 0].any()):
        return Ratio(value, math.nan, math.nan)
    drawn = np.sort(drawn[~np.isnan(drawn)])  # 0 of both says nothing of their ratio
    low, high = (
        float(drawn[round(end * (len(drawn) - 1))]) for end in ((1 - LEVEL) / 2, (1 + LEVEL) / 2)
    )
    cases = int(second[:, 0].sum())
    if cases < FEW:
        least = float(np.quantile(_shares(first[rows]), (1 - LEVEL) / 2))
        low = min(low, least / (most_behind(cases) / float(second[:, 1].sum())))
    return Ratio(value, low, high)


def _shares(pairs: np.ndarray) -> np.ndarray:
    """Return part / whole of sums over seeds, one of each draw."""
    sums = pairs.sum(axis=1)
    return np.asarray(sums[:, 0] / sums[:, 1])
