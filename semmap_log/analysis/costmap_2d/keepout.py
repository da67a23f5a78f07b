"""The door layer as a mask for Nav2's KeepoutFilter: closed doors are kept out of, nothing else.

Write the mask with `map_server_out.write_map(Path("keepout.pgm"), mask, geometry)` and give it to
Nav2 so (nav2_bringup's names; all three are lifecycle nodes):

    filter_mask_server:                     # nav2_map_server's map_server
      ros__parameters:
        yaml_filename: keepout.yaml
        topic_name: filter_mask
    costmap_filter_info_server:
      ros__parameters:
        type: 0                             # keepout
        filter_info_topic: costmap_filter_info
        mask_topic: filter_mask
        base: 0.0                           # the values mean what they are in an OccupancyGrid
        multiplier: 1.0
    global_costmap:
      global_costmap:
        ros__parameters:
          filters: [keepout_filter]
          keepout_filter:
            plugin: nav2_costmap_2d::KeepoutFilter
            enabled: true
            filter_info_topic: costmap_filter_info

The filter writes a mask's cell over a cheaper cell of the costmap, and over one without information
even where the mask is 0; -1 it skips (ros-navigation/navigation2
nav2_costmap_2d/plugins/costmap_filters/keepout_filter.cpp, process). So the rest of this mask is
-1: with 0 there, as in masks drawn by hand, all unknown space would become free.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import FREE_SPACE, NO_INFORMATION, to_occupancy


def keepout_mask(layer: NDArray[np.uint8], *, elsewhere: int = -1) -> NDArray[np.int8]:
    """Return a mask of what a door layer blocks.

    Args:
        layer: uint8 costs of the door layer alone, (height, width), row 0 at the lowest y.
        elsewhere: The mask's value where no door costs anything: -1 leaves the costmap as it is,
            0 also frees what it does not know.

    Returns:
        int8, of the same shape: 100 at closed doors, 1..99 where a door has a cost in between.

    Raises:
        CostmapError: The layer is not uint8.
    """
    costs_nothing = (layer == FREE_SPACE) | (layer == NO_INFORMATION)
    return np.where(costs_nothing, np.int8(elsewhere), to_occupancy(layer))
