"""How good forecasts were, once it is known what came: Brier score, log-loss, calibration, bias."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Probabilities = NDArray[np.float64]

CLIP = 1e-3
"""No forecast counts as more certain in the log-loss, or one surprise would decide it."""
BINS = 10
"""Of equal width, for the reliability diagram and the ECE."""


@dataclass(frozen=True, slots=True)
class Scores:
    """How good some forecasts were; of none, all figures are None."""

    count: int
    """How many forecasts."""
    brier: float | None
    """Mean of (p - outcome)^2: 0 is perfect, 0.25 what always saying 0.5 gets (Brier, 1950)."""
    log_loss: float | None
    """Mean of -log P(what came), nats; P clipped to [`CLIP`, 1 - `CLIP`]."""
    ece: float | None
    """Expected calibration error: mean over the forecasts of |mean p - frequency| of their bin
    (Naeini et al., AAAI 2015)."""
    bias: float | None
    """Mean p - mean outcome; above 0: open was forecast too often."""


@dataclass(frozen=True, slots=True)
class Reliability:
    """Outcomes by forecast probability: the rows of a reliability diagram, one a bin.

    Sums, so that those of several doors add up to one diagram.
    """

    count: Probabilities
    """(BINS,), how many forecasts lie in each bin; bin i holds i / BINS <= p < (i + 1) / BINS, the
    last one p = 1 too."""
    said: Probabilities
    """(BINS,), the sum of their p."""
    came: Probabilities
    """(BINS,), the sum of their outcomes."""

    @classmethod
    def of(cls, p: Probabilities, outcome: Probabilities) -> Reliability:
        """Return the diagram of some forecasts.

        Args:
            p: (n,), the forecasts.
            outcome: (n,), the outcomes: 0 or 1.
        """
        bins = np.minimum((p * BINS).astype(np.int64), BINS - 1)
        one = np.ones(len(p))
        return cls(_sums(bins, one), _sums(bins, p), _sums(bins, outcome))

    def __add__(self, other: Reliability) -> Reliability:
        """Return the diagram of both."""
        return Reliability(self.count + other.count, self.said + other.said, self.came + other.came)

    @property
    def ece(self) -> float | None:
        """Expected calibration error; None where there is no forecast."""
        total = float(self.count.sum())
        return float(np.abs(self.said - self.came).sum() / total) if total else None

    def rows(self) -> list[tuple[float, float, int]]:
        """Return (mean p, frequency of the outcome, count) of each bin that is not empty."""
        found = zip(self.said.tolist(), self.came.tolist(), self.count.tolist(), strict=True)
        return [(said / count, came / count, int(count)) for said, came, count in found if count]


def scores(p: Probabilities, outcome: Probabilities) -> Scores:
    """Return how good forecasts were.

    Args:
        p: (n,), the forecasts.
        outcome: (n,), the outcomes: 0 or 1.
    """
    if not len(p):
        return Scores(0, None, None, None, None)
    came = np.asarray(outcome, np.float64)
    return Scores(
        len(p),
        brier=float(np.mean(squared_errors(p, came))),
        log_loss=float(np.mean(surprises(p, came))),
        ece=Reliability.of(p, came).ece,
        bias=float(np.mean(p) - np.mean(came)),
    )


def squared_errors(p: Probabilities, outcome: Probabilities) -> Probabilities:
    """Return what each forecast adds to the Brier score."""
    return np.asarray((p - outcome) ** 2)


def surprises(p: Probabilities, outcome: Probabilities) -> Probabilities:
    """Return what each forecast adds to the log-loss: -log P(what came), nats."""
    sure = np.clip(p, CLIP, 1 - CLIP)
    return np.asarray(-np.log(np.where(outcome > 0.5, sure, 1 - sure)))


def mean_scores(each: Sequence[Scores]) -> Scores:
    """Return the mean over doors, each weighing the same; those without forecasts do not count."""
    told = [one for one in each if one.count]
    if not told:
        return Scores(0, None, None, None, None)

    def mean(name: str) -> float:
        return float(sum(getattr(one, name) for one in told) / len(told))

    return Scores(
        sum(one.count for one in told),
        brier=mean("brier"),
        log_loss=mean("log_loss"),
        ece=mean("ece"),
        bias=mean("bias"),
    )


def _sums(bins: NDArray[np.int64], weights: Probabilities) -> Probabilities:
    return np.bincount(bins, weights, BINS).astype(np.float64)
