"""The global planner's costmap: static map, door layer, obstacle layer, inflation.

Obstacles lie above doors, and the greater cost counts (`updateWithMax`): what the laser sees shut
is shut, though the map says open; what the map says is shut is shut, though the laser saw through.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from navigation.floors import Cell, Cells, Floor
from navigation.obstacle_layer import ObstacleLayer
from semmap_log.analysis.costmap_2d.costs import FREE_SPACE, INSCRIBED, LETHAL, DoorLayer, DoorLine
from semmap_log.analysis.costmap_2d.layered import (
    CostmapLayer,
    InflationLayer,
    LayeredCostmap,
    StaticLayer,
)
from semmap_log.analysis.rooms.regions import regions_of
from semmap_log.core.model.doors import DoorId

NOWHERE = 0
"""The region of cells where the robot cannot be."""
RADIUS_M = 0.25
"""The robot's: so near to an obstacle its middle cannot be."""
INFLATION_M, SCALING = 0.55, 10.0
"""`inflation_radius` and `cost_scaling_factor` of costmap_2d, as they come."""
NEUTRAL, FACTOR = 50, 0.8
"""A cell costs the planner NEUTRAL + FACTOR x its cost, as in navfn; here in units of NEUTRAL."""
FITS_IN = 8
"""Cells: so far the planner looks for a free cell, where the robot stands in none."""


class GlobalCostmap:
    """The costs, and which cells hang together; worked out when they are asked for."""

    def __init__(self, floor: Floor, obstacles: ObstacleLayer | None) -> None:
        """Lay the layers of a floor.

        Args:
            floor: Its static map, and its doors.
            obstacles: None: it has no obstacle layer.
        """
        self._floor = floor
        geometry = floor.geometry
        self._doors = DoorLayer(geometry)
        inflation = InflationLayer(geometry, INFLATION_M, scaling=SCALING, inscribed=RADIUS_M)
        above = [] if obstacles is None else [obstacles]
        static = StaticLayer(geometry, floor.static)
        layers: list[CostmapLayer] = [static, self._doors, *above, inflation]
        self._master = LayeredCostmap(geometry, layers, track_unknown=True)
        self._extra: dict[DoorId, float] = {}
        self._weights = np.full(geometry.shape, np.inf, np.float32)
        self._regions: NDArray[np.int32] | None = None
        self.version = 0
        """Another number after each change."""

    def show_doors(self, passable: Mapping[DoorId, bool]) -> None:
        """Draw doors: FREE or LETHAL; a door that is left out is as the static map has it."""
        lines = self._floor.lines()
        self._doors.draw({
            door: DoorLine(line.x, line.y, line.theta, line.width, _cost(passable[door]))
            for door, line in lines.items()
            if door in passable
        })  # fmt: skip

    def charge(self, extra: Mapping[DoorId, float]) -> None:
        """Let the way through doors cost so much more, in cells of free floor."""
        if self._extra != extra:
            self._extra = dict(extra)
            self._weigh()

    def update(self) -> None:
        """Take in what changed below."""
        if self._master.update():
            self._weigh()
            self._regions = None

    def _weigh(self) -> None:
        self._weights = _WEIGHTS[self._master.costs]
        flat = self._weights.reshape(-1)
        for door, extra in self._extra.items():
            cells: Cells = self._floor.door_cells[door]
            flat[cells] += extra
        self.version += 1

    @property
    def weights(self) -> NDArray[np.float32]:
        """(rows, columns): what a step into a cell costs, 1 and more; inf: the robot cannot."""
        return self._weights

    @property
    def regions(self) -> NDArray[np.int32]:
        """(rows, columns): which cells hang together; `NOWHERE`: the robot cannot be there."""
        if self._regions is None:
            self._regions = regions_of(self._master.costs < INSCRIBED, by_corners=True).label_grid()
        return self._regions

    def is_reachable(self, start: Cell, goal: Cell) -> bool:
        """Tell whether a way leads from one cell to the other."""
        here = self.regions[start]
        return bool(here != NOWHERE and here == self.regions[goal])

    def has_room(self, cell: Cell, margin_m: float) -> bool:
        """Tell whether the robot in a cell keeps so far from obstacles."""
        cost = (INSCRIBED - 1) * math.exp(-SCALING * margin_m)
        return bool(self._master.costs[cell] <= cost)

    def free_cell(self, cell: Cell) -> Cell | None:
        """Return the nearest cell in which the robot can be, its own if it can; None: none near."""
        low = (max(cell[0] - FITS_IN, 0), max(cell[1] - FITS_IN, 0))
        part = self.regions[low[0] : cell[0] + FITS_IN + 1, low[1] : cell[1] + FITS_IN + 1]
        rows, columns = np.nonzero(part != NOWHERE)
        if not len(rows):
            return None
        away = (rows + low[0] - cell[0]) ** 2 + (columns + low[1] - cell[1]) ** 2
        nearest = int(away.argmin())
        return int(rows[nearest]) + low[0], int(columns[nearest]) + low[1]


def _cost(passable: bool) -> int:  # noqa: FBT001 - what it is about
    return FREE_SPACE if passable else LETHAL


_WEIGHTS = np.full(256, np.inf, np.float32)
_WEIGHTS[:INSCRIBED] = 1 + np.arange(INSCRIBED) * FACTOR / NEUTRAL
