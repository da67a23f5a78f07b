"""ROS's inflation layer: costs that fall off around obstacles (noetic's `inflation_layer.cpp`).

Where it changes part of a map it gives what it would give for all of it, cell for cell. noetic's
own incremental update does not: which obstacle claims a cell may depend, step by step, on cells
beyond the update's window. Here that is not hoped for but checked: see `InflationLayer._claimed`.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.brushfire import Brushfire
from semmap_log.analysis.costmap_2d.costs import FREE_SPACE, INSCRIBED, LETHAL, NO_INFORMATION
from semmap_log.analysis.costmap_2d.door_layer import DoorLayer
from semmap_log.analysis.costmap_2d.grid import CellWindow, GridGeometry
from semmap_log.errors import CostmapError

MOST_REACH = 1500
"""Cells: its tables, one entry for each place within reach, take 0.8 GB then."""
SURROUNDINGS = 1024
"""So many are remembered: a door that opens and closes finds the same ones again and again."""
MOST_REMEMBERED_CELLS = 2**15


class InflationLayer:
    """Costs around the lethal cells of the layers below, or around doors.

    Args:
        geometry: Of the costmap.
        radius: How far it reaches, metres (`inflation_radius`); rounded up to cells.
        scaling: How fast costs fall off, 1/m (`cost_scaling_factor`).
        inscribed: Within this distance, metres, the robot surely touches: INSCRIBED.
        inflate_unknown: Also write costs where nothing is known.
        around: Inflate that layer's doors that are, or may be, closed, instead of all lethal cells:
            with a wider radius than that of walls, a robot keeps away from a door that may open
            (the thesis's wish, 2.2.2). The doors' own cells stay as they are.

    Raises:
        CostmapError: A number is negative or not finite, or the radius is beyond `MOST_REACH`.
    """

    def __init__(
        self,
        geometry: GridGeometry,
        radius: float,
        *,
        scaling: float = 10.0,
        inscribed: float = 0.0,
        inflate_unknown: bool = False,
        around: DoorLayer | None = None,
    ) -> None:
        for name, value in (("radius", radius), ("scaling", scaling), ("inscribed", inscribed)):
            if not (math.isfinite(value) and value >= 0):
                raise CostmapError(f"inflation's {name}: expected 0 or more, got {value!r}")
        cells = math.ceil(radius / geometry.resolution)
        self.reach = min(cells, math.ceil(math.hypot(*geometry.shape)))
        """Cells: a change concerns those so far away from it, at most its diagonal."""
        if self.reach > MOST_REACH:
            raise CostmapError(
                f"inflation's radius: expected at most {MOST_REACH:,} cells "
                f"({MOST_REACH * geometry.resolution:g} m), got {radius:g} m"
            )
        self._geometry = geometry
        self._around = around
        self._inflate_unknown = inflate_unknown
        self._obstacles = np.zeros(geometry.shape, np.bool_)
        self._fire = Brushfire(self.reach)
        self._claims = np.zeros(geometry.shape, self._fire.dtype)
        costs = [self._cost(cells, scaling, inscribed) for cells in self._fire.distances]
        self._cost_of_claim = np.array([*costs, FREE_SPACE], np.uint8)[self._fire.distance_of_claim]
        self._remembered = lru_cache(SURROUNDINGS)(self._burnt_packed)

    def take_changes(self) -> list[CellWindow]:
        """Return nothing: what it adds changes with the layers below."""
        return []

    def update_costs(self, master: NDArray[np.uint8], window: CellWindow) -> CellWindow:
        """Add costs to the master, in that window, or tell which one is needed.

        Args:
            master: (height, width); in the window, the layers below.
            window: Where the master is to be brought up to date; all changes lie `reach` inside.

        Returns:
            The window, if all is done; a wider one, if the layers below must be drawn in that.
        """
        if not self.reach:
            return window
        part = window.slices
        if self._around is None:
            self._obstacles[part] = master[part] == LETHAL
        else:
            costs = self._around.costs[part]
            self._obstacles[part] = (costs != FREE_SPACE) & (costs != NO_INFORMATION)
        claims = self._claimed(window)
        if claims is None:
            return window.dilated(self.reach + 8).within(self._geometry.whole)
        self._claims[part] = claims
        self._add(master[part], self._cost_of_claim[claims])
        return window

    def _claimed(self, window: CellWindow) -> NDArray[np.unsignedinteger] | None:
        """Return which obstacle claims each cell of a window; None: more than the window changed.

        The fire is laid in a wider window. Near that one's edge it may burn otherwise than in the
        whole map, for what lies beyond is missing. But if in a band around `window` every cell has
        the claim that the whole map gave it before, source and way, then the new claims inside and
        the old ones outside fit together at every cell: who claims a cell follows from its four
        neighbours, and in which order those were reached from the ways to their sources, none
        longer than `reach` along either axis. Claims that follow from each other, from the
        sources up, are those of a fire in the whole map.
        """
        whole = self._geometry.whole
        band = window.dilated(self.reach + 2).within(whole)
        wide = window.dilated(3 * self.reach + 8).within(whole)
        burnt = self._burnt(wide)
        inner, outer = window.seen_from(wide).slices, band.seen_from(wide).slices
        if window != whole:
            differs = burnt[outer] != self._claims[band.slices]
            differs[window.seen_from(band).slices] = False
            if differs.any():
                return None
        return burnt[inner]

    def _burnt(self, window: CellWindow) -> NDArray[np.unsignedinteger]:
        obstacles = self._obstacles[window.slices]
        if window.area > MOST_REMEMBERED_CELLS:
            return self._fire.burnt(obstacles)
        return self._remembered(np.packbits(obstacles).tobytes(), window.shape)

    def _burnt_packed(
        self, obstacles: bytes, shape: tuple[int, int]
    ) -> NDArray[np.unsignedinteger]:
        bits = np.unpackbits(np.frombuffer(obstacles, np.uint8), count=shape[0] * shape[1])
        return self._fire.burnt(bits.reshape(shape).view(np.bool_))

    def _cost(self, cells: float, scaling: float, inscribed: float) -> int:
        """Return the cost so many cells away from an obstacle (`computeCost`)."""
        if cells == 0:
            return LETHAL if self._around is None else FREE_SPACE
        metres = cells * self._geometry.resolution
        if metres <= inscribed:
            return INSCRIBED
        return int((INSCRIBED - 1) * math.exp(-1.0 * scaling * (metres - inscribed)))

    def _add(self, master: NDArray[np.uint8], costs: NDArray[np.uint8]) -> None:
        """Keep the greater cost; where nothing is known, write what is sure, or all."""
        shows = costs > FREE_SPACE if self._inflate_unknown else costs >= INSCRIBED
        np.copyto(master, costs, where=np.where(master == NO_INFORMATION, shows, costs > master))
