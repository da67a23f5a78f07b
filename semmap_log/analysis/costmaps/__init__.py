"""Costmaps of a log, at any moment, over time and live; the arithmetic is in `costmap`."""

from semmap_log.analysis.costmaps.level_costmap import Costmap, CostmapOptions, costmap_at
from semmap_log.analysis.costmaps.over_time import CostmapFrame, costmap_frames, costmap_live

__all__ = [
    "Costmap",
    "CostmapFrame",
    "CostmapOptions",
    "costmap_at",
    "costmap_frames",
    "costmap_live",
]
