"""The rooms that a view of a log tints and names."""

from __future__ import annotations

from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.analysis.rooms import RoomPlan, plan_of
from semmap_log.core.model.doors import DoorMap
from semmap_log.core.model.events import FloorMap
from semmap_log.errors import CostmapError
from semmap_log.log.door_log.door_log import DoorLog


def rooms_shown(log: DoorLog, door_map: DoorMap) -> RoomPlan:
    """Return the rooms of a door map's levels; a floor plan that is turned has none to show."""
    floors = {n: floor for n in door_map.levels if (floor := log.floor_of(door_map, n)) is not None}
    return plan_of(door_map, {n: floor for n, floor in floors.items() if _is_upright(floor)})


def _is_upright(floor: FloorMap) -> bool:
    try:
        GridGeometry.of_floor(floor)
    except CostmapError:
        return False
    return True
