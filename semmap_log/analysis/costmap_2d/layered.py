"""The layered costmap: layers in their order, and a master that is what they make together.

The update cycle of costmap_2d/src/layered_costmap.cpp: where a layer changed, the master is reset
to its default, and each layer writes into that window in turn. Windows are exact cells here, and
wide enough: the master after an update is, byte for byte, the master drawn anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import FREE_SPACE, NO_INFORMATION
from semmap_log.analysis.costmap_2d.grid import CellWindow, GridGeometry, merged, read_only


class CostmapLayer(Protocol):
    """What a costmap is made of."""

    @property
    def reach(self) -> int:
        """Cells: so far around a change below it the layer's own costs may change."""

    def take_changes(self) -> list[CellWindow]:
        """Return where the layer's costs changed since the last call."""

    def update_costs(self, master: NDArray[np.uint8], window: CellWindow, /) -> CellWindow:
        """Write into the master, in that window; return it, or the wider one that is needed."""


class LayeredCostmap:
    """Some layers' master.

    Args:
        geometry: Of all layers.
        layers: In the order in which they write (the plugins of a costmap's configuration).
        track_unknown: Where no layer writes, nothing is known; else it is free.
    """

    def __init__(
        self, geometry: GridGeometry, layers: Sequence[CostmapLayer], *, track_unknown: bool = False
    ) -> None:
        self.geometry = geometry
        self._layers = tuple(layers)
        self._default = NO_INFORMATION if track_unknown else FREE_SPACE
        self._master = np.full(geometry.shape, self._default, np.uint8)
        self._reach = sum(layer.reach for layer in self._layers)

    @property
    def costs(self) -> NDArray[np.uint8]:
        """The master, (height, width), row 0 at the lowest y; read-only; as of the last update."""
        return read_only(self._master)

    def update(self) -> list[CellWindow]:
        """Bring the master up to date.

        Returns:
            Where cells may have changed.
        """
        whole = self.geometry.whole
        changed = [window for layer in self._layers for window in layer.take_changes()]
        widened = merged(window.dilated(self._reach).within(whole) for window in changed)
        return [self._update(window) for window in widened]

    def _update(self, window: CellWindow) -> CellWindow:
        """Redraw a window, or the wider one that the layers turn out to need."""
        needed = self._drawn_in(window)
        while needed != window:
            window = needed
            needed = self._drawn_in(window)
        return window

    def _drawn_in(self, window: CellWindow) -> CellWindow:
        self._master[window.slices] = self._default
        for layer in self._layers:
            needed = layer.update_costs(self._master, window)
            if needed != window:
                return needed
        return window
