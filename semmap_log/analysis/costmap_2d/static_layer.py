"""The floor plan as a layer: costs that do not change."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.combining import maximum, overwrite_all
from semmap_log.analysis.costmap_2d.grid import CellWindow, GridGeometry, merged
from semmap_log.errors import CostmapError


class StaticLayer:
    """A map's costs, as `costs.static_costs` makes them of its occupancy.

    Args:
        geometry: Of the costmap.
        costs: uint8, (height, width), row 0 at the lowest y.
        use_maximum: Keep greater costs of the layers below; else overwrite them, also where the
            map knows nothing (StaticLayer::updateCosts).

    Raises:
        CostmapError: The costs have another shape than the costmap.
    """

    reach = 0

    def __init__(
        self, geometry: GridGeometry, costs: NDArray[np.uint8], *, use_maximum: bool = False
    ) -> None:
        if costs.shape != geometry.shape:
            raise CostmapError(f"a map: expected {geometry.shape} cells, got {costs.shape}")
        self._costs = costs
        self._combine = maximum if use_maximum else overwrite_all
        self._changes = [geometry.whole]

    def take_changes(self) -> list[CellWindow]:
        """Return the whole map, once."""
        changes, self._changes = self._changes, []
        return merged(changes)

    def update_costs(self, master: NDArray[np.uint8], window: CellWindow) -> CellWindow:
        """Write the map into the master, in that window."""
        self._combine(master[window.slices], self._costs[window.slices])
        return window
