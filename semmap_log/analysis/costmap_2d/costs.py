"""What the numbers of a costmap mean, and how ROS turns them into map values and back.

Sources: costmap_2d/cost_values.h; the publisher's table, costmap_2d_publisher.cpp (the same in
Nav2); StaticLayer::interpretValue, static_layer.cpp.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.errors import CostmapError

FREE_SPACE = 0
INSCRIBED = 253
"""A robot whose centre is here touches something, whichever way it is turned."""
LETHAL = 254
NO_INFORMATION = 255


def to_occupancy(costs: NDArray[np.uint8]) -> NDArray[np.int8]:
    """Return what costmap_2d publishes of costs: a nav_msgs/OccupancyGrid's data.

    Free is 0, 1..252 spread over 1..98, inscribed is 99, lethal 100, no information -1.

    Args:
        costs: uint8, of any shape.

    Returns:
        int8, of the same shape.

    Raises:
        CostmapError: The costs are not uint8.
    """
    _expect(costs, np.uint8, "costs")
    return _OCCUPANCY_OF_COST[costs]


def static_costs(
    occupancy: NDArray[np.int8],
    *,
    track_unknown: bool = True,
    trinary: bool = True,
    lethal_threshold: int = 100,
    unknown_value: int = -1,
) -> NDArray[np.uint8]:
    """Return the costs that costmap_2d's static layer makes of a map.

    A map's value is read as an unsigned byte (so -2 is 254, above every threshold).

    Args:
        occupancy: int8, of any shape: -1 unknown, 0 free .. 100 occupied.
        track_unknown: Unknown is NO_INFORMATION; else FREE_SPACE.
        trinary: What lies below the threshold is FREE_SPACE; else its share of LETHAL.
        lethal_threshold: From here on LETHAL; taken into 0..100, as the layer does.
        unknown_value: The value that means unknown; its lowest byte counts.

    Returns:
        uint8, of the same shape.

    Raises:
        CostmapError: The occupancy is not int8.
    """
    _expect(occupancy, np.int8, "occupancy")
    lethal = max(0, min(100, lethal_threshold))

    def cost_of(value: int) -> int:
        if value == unknown_value & 0xFF:
            return NO_INFORMATION if track_unknown else FREE_SPACE
        if value >= lethal:
            return LETHAL
        return FREE_SPACE if trinary else int(value / lethal * LETHAL)

    return _table(cost_of, np.uint8)[occupancy.view(np.uint8)]


def _table(entry_of: Callable[[int], int], dtype: type[Any]) -> NDArray[Any]:
    return np.array([entry_of(byte) for byte in range(256)], dtype)


def _published(cost: int) -> int:
    ends = {FREE_SPACE: 0, INSCRIBED: 99, LETHAL: 100, NO_INFORMATION: -1}
    return ends.get(cost, 1 + 97 * (cost - 1) // 251)


_OCCUPANCY_OF_COST: NDArray[np.int8] = _table(_published, np.int8)


def _expect(array: NDArray[Any], dtype: type[Any], what: str) -> None:
    if array.dtype != dtype:
        raise CostmapError(f"{what}: expected {np.dtype(dtype)}, got {array.dtype}")
