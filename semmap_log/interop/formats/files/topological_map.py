"""A level's rooms and doors as a topological map (`.tmap2.yaml`), which robots navigate by.

The format of LCAS/topological_navigation, heir of the STRANDS project's: nodes are places to drive
to, edges say how. Here a room is a node at a point far from its walls, a door one in its middle,
and edges join each door with the rooms on its sides. The file has one plane, so it has one level.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from datetime import datetime, timezone
from typing import Any

import yaml

from semmap_log.analysis.rooms.level_rooms import Point, RoomPlan
from semmap_log.analysis.rooms.walking_floor import middle_of
from semmap_log.core.model.doors import Door
from semmap_log.core.model.moments import SECOND_NS

ACTION, ACTION_TYPE = "NavigateToPose", "geometry_msgs/PoseStamped"
REACH_M = 0.5
"""Radius of the zone around a room's point in which a robot counts as there."""
SIDES = 8
"""Of that zone's outline."""

Json = dict[str, Any]


def dump_topological_map(plan: RoomPlan, level: int, *, name: str) -> str:
    """Return the map of a level that has a floor plan.

    Args:
        plan: Of a moment.
        level: Which level.
        name: Of the map, such as the building's.
    """
    nodes = _Nodes(plan, level, name)
    moment = datetime.fromtimestamp(plan.door_map.moment_ns // SECOND_NS, timezone.utc)
    document = {
        "meta": {"last_updated": f"{moment:%Y-%m-%d_%H-%M-%S}"},
        "metric_map": nodes.metric_map,
        "name": name,
        "pointset": name,
        "transformation": {
            "child": "topo_map",
            "parent": "map",
            "rotation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0},
            "translation": {"x": 0.0, "y": 0.0, "z": 0.0},
        },
        "nodes": [*nodes.of_rooms(), *nodes.of_doors()],
    }
    text: str = yaml.dump(document, Dumper=_Plain, sort_keys=False, allow_unicode=True)
    return text


class _Plain(yaml.SafeDumper):
    """Writes each value in full: no references from one node to another."""

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002 - yaml's way to ask
        return True


class _Nodes:
    """The nodes of a level, each under a name that no other has."""

    def __init__(self, plan: RoomPlan, level: int, pointset: str) -> None:
        self.plan = plan
        self.pointset = pointset
        self.metric_map = plan.door_map.level_name(level)
        self.rooms = [room for room in plan.graph.rooms.values() if room.level == level]
        self.doorways = [each for each in plan.graph.doorways.values() if each.level == level]
        self._edge_ids: set[str] = set()
        taken: set[str] = set()
        self.room_names = {
            room.room_id: _own(taken, room.name, f"room_{room.room_id}") for room in self.rooms
        }
        self.door_names = {
            each.door_id: _own(taken, plan.door_map[each.door_id].name, f"door_{each.door_id}")
            for each in self.doorways
        }

    def of_rooms(self) -> Iterator[Json]:
        """Yield a node for each room."""
        for room in self.rooms:
            doors = [
                self.door_names[each.door_id]
                for each in self.doorways
                if room.room_id in (each.left, each.right)
            ]
            own = {"room_id": room.room_id, "area_m2": round(room.area_m2, 3)}
            yield self._node(self.room_names[room.room_id], (room.x, room.y), 0.0, doors, own)

    def of_doors(self) -> Iterator[Json]:
        """Yield a node for each door; it looks across the door's line, to its left."""
        for doorway in self.doorways:
            door = self.plan.door_map[doorway.door_id]
            sides = dict.fromkeys((doorway.left, doorway.right))
            rooms = [self.room_names[side] for side in sides if side in self.room_names]
            name = self.door_names[doorway.door_id]
            yield self._node(name, middle_of(door), door.theta + math.pi / 2, rooms, _of_door(door))

    def _node(self, name: str, at: Point, heading: float, beyond: list[str], own: Json) -> Json:
        reach_m = REACH_M
        half = heading / 2
        return {
            "meta": {"map": self.metric_map, "node": name, "pointset": self.pointset},
            "node": {
                "edges": [self._edge(name, other) for other in beyond],
                "localise_by_topic": "",
                "name": name,
                "parent_frame": "map",
                "pose": {
                    "orientation": {"w": math.cos(half), "x": 0.0, "y": 0.0, "z": math.sin(half)},
                    "position": {"x": at[0], "y": at[1], "z": 0.0},
                },
                "properties": {
                    "xy_goal_tolerance": 0.3,
                    "yaw_goal_tolerance": 0.1,
                    "semmap_log": own,
                },
                "restrictions_planning": "True",
                "restrictions_runtime": "True",
                "verts": [
                    {
                        "x": reach_m * math.cos(2 * math.pi * side / SIDES),
                        "y": reach_m * math.sin(2 * math.pi * side / SIDES),
                    }
                    for side in range(SIDES)
                ],
            },
        }

    def _edge(self, source: str, target: str) -> Json:
        return {
            "action": ACTION,
            "action_type": ACTION_TYPE,
            "config": [],
            "edge_id": _own(self._edge_ids, f"{source}_{target}", "edge"),
            "fail_policy": "fail",
            "fluid_navigation": True,
            "goal": {
                "target_pose": {"header": {"frame_id": "$node.parent_frame"}, "pose": "$node.pose"}
            },
            "node": target,
            "recovery_behaviours_config": "",
            "restrictions_planning": "True",
            "restrictions_runtime": "True",
        }


def _of_door(door: Door) -> Json:
    own: Json = {"door_id": int(door.door_id), "state": door.state.name, "width": door.width}
    if "lift" in door.annotations:
        own["lift"] = door.annotations["lift"]
    return own


def _own(taken: set[str], name: str | None, otherwise: str) -> str:
    """Return a name that is not taken, and take it."""
    wanted = name or otherwise
    if wanted in taken:
        wanted = f"{wanted}_{otherwise}"
    while wanted in taken:
        wanted += "_"
    taken.add(wanted)
    return wanted
