"""The peer of the costmap: the rules of the thesis and of noetic as plain loops over cells.

As costmap_2d/plugins/inflation_layer.cpp has them (costs and distances in tables, lists of cells by
distance), in the Python that runs fastest: flat indices, bytes, local names.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import INSCRIBED, LETHAL, NO_INFORMATION, DoorLine
from semmap_log.analysis.costmap_2d.grid import CellWindow, GridGeometry

Corners = tuple[int, int, int, int]
"""The cells where a line starts and ends: x, y, x, y."""


def drawn(
    geometry: GridGeometry, static: NDArray[np.uint8], doors: Iterable[DoorLine]
) -> NDArray[np.uint8]:
    """Return the floor plan with doors in it, those with information only."""
    costs = static.copy()
    draw_in(costs, doors, geometry, geometry.whole)
    return costs


def draw_in(
    costs: NDArray[np.uint8], doors: Iterable[DoorLine], geometry: GridGeometry, window: CellWindow
) -> None:
    """Draw doors into a part of the floor plan."""
    layer: dict[tuple[int, int], int] = {}
    for door in doors:
        for x, y in line(*corners_of(geometry, door)):
            if window.x0 <= x < window.xn and window.y0 <= y < window.yn:
                layer[y - window.y0, x - window.x0] = door.cost
    for cell, cost in layer.items():
        if cost != NO_INFORMATION:
            costs[cell] = cost


def corners_of(geometry: GridGeometry, door: DoorLine) -> Corners:
    """Return the cells where a door's line starts and ends, on the map or off it."""
    end_x = door.x + door.width * math.cos(door.theta)
    end_y = door.y + door.width * math.sin(door.theta)
    x0, y0, size = geometry.origin_x, geometry.origin_y, geometry.resolution
    return (
        math.floor((door.x - x0) / size), math.floor((door.y - y0) / size),
        math.floor((end_x - x0) / size), math.floor((end_y - y0) / size),
    )  # fmt: skip


def line(x0: int, y0: int, x1: int, y1: int) -> Iterator[tuple[int, int]]:
    """Yield the cells of a line: the loop of the thesis, Fig. 4.2."""
    dx, dy = abs(x1 - x0), -abs(y1 - y0)
    sx, sy = (1 if x0 < x1 else -1), (1 if y0 < y1 else -1)
    error = dx + dy
    while True:
        yield x0, y0
        if x0 == x1 and y0 == y1:
            return
        doubled = 2 * error
        if doubled > dy:
            error += dy
            x0 += sx
        if doubled < dx:
            error += dx
            y0 += sy


def cost_at(cells: float, *, resolution: float, scaling: float, inscribed: float) -> int:
    """Return the cost so many cells away from an obstacle (`computeCost`)."""
    if cells == 0:
        return LETHAL
    metres = cells * resolution
    if metres <= inscribed:
        return INSCRIBED
    return int((INSCRIBED - 1) * math.exp(-1.0 * scaling * (metres - inscribed)))


def inflated(
    costs: NDArray[np.uint8], *, resolution: float, radius: float, scaling: float, inscribed: float
) -> NDArray[np.uint8]:
    """Return a master with noetic's inflation; unknown cells are left, as by default."""
    reach = math.ceil(radius / resolution)
    side = range(reach + 2)
    distances = [[math.hypot(dx, dy) for dy in side] for dx in side]
    cost_of = [
        [cost_at(d, resolution=resolution, scaling=scaling, inscribed=inscribed) for d in row]
        for row in distances
    ]
    rows, columns = costs.shape
    master, seen = bytearray(costs.tobytes()), bytearray(costs.size)
    bins: dict[float, list[tuple[int, int, int, int]]] = {
        0.0: [(x, y, x, y) for y, x in np.argwhere(costs == LETHAL).tolist()]
    }
    while bins:
        distance = min(bins)
        for x, y, source_x, source_y in bins[distance]:
            cell = y * columns + x
            if seen[cell]:
                continue
            seen[cell] = 1
            cost, old = cost_of[abs(x - source_x)][abs(y - source_y)], master[cell]
            if cost >= INSCRIBED if old == NO_INFORMATION else cost > old:
                master[cell] = cost
            for nx, ny in ((x - 1, y), (x, y - 1), (x + 1, y), (x, y + 1)):
                if 0 <= nx < columns and 0 <= ny < rows and not seen[ny * columns + nx]:
                    further = distances[abs(nx - source_x)][abs(ny - source_y)]
                    if distance <= further <= reach:  # what is nearer has been gone through
                        if further in bins:
                            bins[further].append((nx, ny, source_x, source_y))
                        else:
                            bins[further] = [(nx, ny, source_x, source_y)]
        del bins[distance]
    return np.frombuffer(master, np.uint8).reshape(costs.shape)
