"""The rooms of a log's levels as the JSON that `rooms` prints."""

from __future__ import annotations

from typing import Any

from semmap_log.analysis.rooms import Doorway, Room, RoomPlan
from semmap_log.interop.formats.json.door_json import door_map_to_json


def rooms_to_json(plan: RoomPlan, *, level: int | None = None) -> dict[str, Any]:
    """Return rooms, doorways and lifts, ids ascending; room 0 is the outside.

    Args:
        plan: Of a moment.
        level: Only the rooms and doorways of that one; None: of all.
    """
    graph = plan.graph
    said = door_map_to_json(plan.door_map)
    return {
        "event": said["event"],
        "at": said["at"],
        "known_at": said["known_at"],
        "levels": said["levels"],
        "levels_without_plan": list(graph.levels_without_plan),
        "rooms": [
            room_to_json(plan, room) for room in graph.rooms.values() if level in (None, room.level)
        ],
        "doorways": [
            _doorway(plan, each) for each in graph.doorways.values() if level in (None, each.level)
        ],
        "lifts": [{"name": lift.name, "doors": list(lift.doors)} for lift in graph.lifts],
    }


def room_to_json(plan: RoomPlan, room: Room) -> dict[str, Any]:
    """Return a room, the doors that lead into it and the rooms that they lead to."""
    return {
        "room_id": room.room_id,
        "level": room.level,
        "level_name": plan.door_map.level_name(room.level),
        "name": room.name,
        "area_m2": round(room.area_m2, 3),
        "x": room.x,
        "y": room.y,
        "doors": list(plan.graph.doors_of(room.room_id)),
        "leads_to": list(plan.graph.neighbours(room.room_id)),
    }


def _doorway(plan: RoomPlan, doorway: Doorway) -> dict[str, Any]:
    lift = plan.graph.lift_of(doorway.door_id)
    return {
        "door_id": doorway.door_id,
        "name": plan.door_map[doorway.door_id].name,
        "level": doorway.level,
        "left": doorway.left,
        "right": doorway.right,
        "joins_two": doorway.joins_two,
        "is_loop": doorway.is_loop,
        "in_wall": doorway.in_wall,
        "lift": lift.name if lift else None,
    }
