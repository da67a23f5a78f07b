"""Credible intervals of a Beta distribution, by numpy alone."""

from __future__ import annotations

import numpy as np

from semmap_log.analysis.probabilities.forecast import INTERVAL

_CELLS = 20_000
"""Of the angle that the density is summed over: quantiles are right to some 1e-6."""


def beta_interval(alpha: float, beta: float) -> tuple[float, float]:
    """Return the equal-tailed interval of a share, of probability `INTERVAL`.

    With the share as sin^2(angle), the density is finite at both ends for parameters from 1/2 on,
    and equal cells of the angle resolve it where it is steep.

    Args:
        alpha: At least 0.5.
        beta: At least 0.5.
    """
    angle = (np.arange(_CELLS) + 0.5) / _CELLS * np.pi / 2
    log_density = (2 * alpha - 1) * np.log(np.sin(angle)) + (2 * beta - 1) * np.log(np.cos(angle))
    below = np.cumsum(np.exp(log_density - log_density.max()))
    edges = np.arange(_CELLS + 1) / _CELLS * np.pi / 2
    tail = (1 - INTERVAL) / 2
    found = np.interp([tail, 1 - tail], np.append(0, below) / below[-1], edges)
    low, high = (np.sin(found) ** 2).tolist()
    return low, high
