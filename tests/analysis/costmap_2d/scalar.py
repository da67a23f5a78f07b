"""noetic's inflation as a plain loop over cells: what the vectorised one is compared with."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import INSCRIBED, LETHAL, NO_INFORMATION


def inflated(
    master: NDArray[np.uint8],
    *,
    resolution: float,
    radius: float,
    scaling: float,
    inscribed: float,
    inflate_unknown: bool,
) -> NDArray[np.uint8]:
    """noetic's InflationLayer::updateCosts over the whole map, cell by cell."""
    reach = math.ceil(radius / resolution)
    result = master.copy()
    if reach == 0:
        return result
    for x, y, source_x, source_y, _ in fire(master == LETHAL, reach):
        distance = math.hypot(x - source_x, y - source_y)
        metres = distance * resolution
        if distance == 0:
            cost = LETHAL
        elif metres <= inscribed:
            cost = INSCRIBED
        else:
            cost = int(252 * math.exp(-1.0 * scaling * (metres - inscribed)))
        old = int(result[y, x])
        if old == NO_INFORMATION and (cost > 0 if inflate_unknown else cost >= INSCRIBED):
            result[y, x] = cost
        else:
            result[y, x] = max(old, cost)
    return result


def fire(obstacles: NDArray[np.bool_], reach: int) -> Iterator[tuple[int, int, int, int, int]]:
    """Cells as they are seen: x, y, of their source x, y, and the step that led there."""
    rows, columns = obstacles.shape
    seen = np.zeros(obstacles.shape, np.bool_)
    bins: dict[float, list[tuple[int, int, int, int, int]]] = {
        0.0: [(x, y, x, y, 0) for y, x in np.argwhere(obstacles).tolist()]
    }
    distance = 0.0
    while True:
        for x, y, source_x, source_y, came in bins[distance]:
            if seen[y, x]:
                continue
            seen[y, x] = True
            yield x, y, source_x, source_y, came
            neighbours = ((x - 1, y), (x, y - 1), (x + 1, y), (x, y + 1))
            for step, (nx, ny) in enumerate(neighbours):
                if 0 <= nx < columns and 0 <= ny < rows and not seen[ny, nx]:
                    further = math.hypot(nx - source_x, ny - source_y)
                    if further <= reach:
                        bins.setdefault(further, []).append((nx, ny, source_x, source_y, step))
        later = [key for key in bins if key > distance]
        if not later:
            return
        distance = min(later)
