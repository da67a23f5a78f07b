"""The peer scipy: inflation by an exact distance transform, which noetic's brushfire is nearly."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from benchmark import plain_costmap
from semmap_log.analysis.costmap_2d.costs import FREE_SPACE, INSCRIBED, LETHAL, NO_INFORMATION


def inflated(
    costs: NDArray[np.uint8], *, resolution: float, radius: float, scaling: float, inscribed: float
) -> NDArray[np.uint8]:
    """Return a master with costs by the distance to the nearest obstacle.

    Raises:
        ModuleNotFoundError: scipy is not installed.
    """
    from scipy.ndimage import distance_transform_edt  # type: ignore[import-untyped]

    reach = math.ceil(radius / resolution)
    table = np.array([
        plain_costmap.cost_at(
            math.sqrt(square), resolution=resolution, scaling=scaling, inscribed=inscribed
        )
        for square in range(reach**2 + 1)
    ] + [FREE_SPACE], np.uint8)  # fmt: skip
    squares = distance_transform_edt(costs != LETHAL)
    squares *= squares
    np.minimum(squares, reach**2 + 1, out=squares)
    around = table[np.rint(squares).astype(np.uint16)]
    is_known = costs != NO_INFORMATION
    return np.where(is_known | (around >= INSCRIBED), np.maximum(costs * is_known, around), costs)
