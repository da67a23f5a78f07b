"""How a layer's costs come into the master: the update methods of ROS's CostmapLayer.

Each takes the same window of both grids (uint8, of one shape) and writes into the first. Sources:
costmap_2d/src/costmap_layer.cpp; nav2_costmap_2d/src/costmap_layer.cpp for the last one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import INSCRIBED, NO_INFORMATION

Costs = NDArray[np.uint8]


def overwrite_all(master: Costs, layer: Costs) -> None:
    """Copy every cell, those without information too (`updateWithTrueOverwrite`)."""
    master[:] = layer


def overwrite(master: Costs, layer: Costs) -> None:
    """Copy the cells with information (`updateWithOverwrite`)."""
    np.copyto(master, layer, where=layer != NO_INFORMATION)


def maximum(master: Costs, layer: Costs) -> None:
    """Keep the greater cost; information beats none (`updateWithMax`)."""
    _raise_to(master, layer, (master == NO_INFORMATION) | (master < layer))


def maximum_of_known(master: Costs, layer: Costs) -> None:
    """Keep the greater cost where the master has one (Nav2's `…MaxWithoutUnknownOverwrite`)."""
    _raise_to(master, layer, (master != NO_INFORMATION) & (master < layer))


def addition(master: Costs, layer: Costs) -> None:
    """Add the costs, at most to just below INSCRIBED (`updateWithAddition`)."""
    total = np.minimum(master.astype(np.uint16) + layer, INSCRIBED - 1).astype(np.uint8)
    total = np.where(master == NO_INFORMATION, layer, total)
    np.copyto(master, total, where=layer != NO_INFORMATION)


def _raise_to(master: Costs, layer: Costs, where: NDArray[np.bool_]) -> None:
    np.copyto(master, layer, where=where & (layer != NO_INFORMATION))
