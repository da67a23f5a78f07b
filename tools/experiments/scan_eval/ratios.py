"""Shares over patrols, with standard errors: patrols are independent, what is in one is not."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

Estimate = tuple[float, float]
"""A share and its standard error; NaN: not known."""


def ratio(parts: Sequence[float], wholes: Sequence[float]) -> Estimate:
    """Return the sum of parts over that of wholes, one of each a patrol."""
    part, whole = np.array(parts, float), np.array(wholes, float)
    if not whole.sum():
        return math.nan, math.nan
    share, n = part.sum() / whole.sum(), len(whole)
    if n < 2:
        return float(share), math.nan
    spread = float(((part - share * whole) ** 2).sum())
    return float(share), math.sqrt(spread * n / (n - 1)) / float(whole.sum())
