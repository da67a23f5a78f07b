"""Costmaps of a log, at any moment, over time and live; the arithmetic is in `costmap`."""

from semmap_log.analysis.costmaps.level_costmap import (
    Costmap,
    CostmapFrame,
    CostmapOptions,
    costmap_at,
    costmap_frames,
    costmap_live,
)

__all__ = [
    "Costmap",
    "CostmapFrame",
    "CostmapOptions",
    "costmap_at",
    "costmap_frames",
    "costmap_live",
]
