"""Where beams of a laser end, cast by hand on walls: for tests."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Wall = tuple[float, float, float, float]
"""Its ends: x, y, x, y."""


def ranges_of(
    origins: ArrayLike, directions: NDArray[np.float64], walls: Iterable[Wall]
) -> NDArray[np.float64]:
    """Return how far each beam, from its own origin, goes to the first wall; inf: to none."""
    segments = np.array(list(walls), float)
    start, along = segments[:, :2], segments[:, 2:] - segments[:, :2]
    away, u = start - np.asarray(origins)[..., None, :], directions[:, None]
    cross = u[..., 0] * along[:, 1] - u[..., 1] * along[:, 0]
    with np.errstate(all="ignore"):
        far = (away[..., 0] * along[:, 1] - away[..., 1] * along[:, 0]) / cross
        share = (away[..., 0] * u[..., 1] - away[..., 1] * u[..., 0]) / cross
    ends: NDArray[np.float64] = np.where((far > 0) & (share >= 0) & (share <= 1), far, np.inf)
    return ends.min(1)


def ranges_at(
    place: ArrayLike, bearings: NDArray[np.float64], walls: Iterable[Wall]
) -> NDArray[np.float64]:
    """Return how far beams go that all begin at one place."""
    return ranges_of(place, np.stack([np.cos(bearings), np.sin(bearings)], axis=1), walls)
