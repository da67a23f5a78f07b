"""The rooms of a log's floor plans, what joins them, and how far it is to walk through them.

    import semmap_log as sl
    from semmap_log.analysis.rooms import rooms_of

    graph = rooms_of(sl.read("clinic_week"))
    for room in graph.rooms.values():
        print(room.room_id, room.name, room.area_m2, graph.doors_of(room.room_id))

The guide *Rooms* describes how rooms are cut, and how they get their names.
"""

from semmap_log.analysis.rooms.door_ways import Place
from semmap_log.analysis.rooms.level_rooms import RoomPlan, plan_of, room_plan, rooms_of
from semmap_log.analysis.rooms.room_graph import OUTSIDE, Doorway, Lift, Room, RoomGraph, RoomId
from semmap_log.analysis.rooms.walking import TravelTimes, WalkingDistances

__all__ = [
    "OUTSIDE",
    "Doorway",
    "Lift",
    "Place",
    "Room",
    "RoomGraph",
    "RoomId",
    "RoomPlan",
    "TravelTimes",
    "WalkingDistances",
    "plan_of",
    "room_plan",
    "rooms_of",
]
