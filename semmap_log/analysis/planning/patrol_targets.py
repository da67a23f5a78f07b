"""What a patrol shall visit: rooms by their doors, or doors themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from semmap_log.analysis.planning.named_places import NamedPlaces, room_label
from semmap_log.analysis.planning.ways_between import WaysBetween
from semmap_log.analysis.rooms import OUTSIDE, Place, RoomId
from semmap_log.core.model.doors import Door
from semmap_log.errors import PlanError

HALL_DOORS = 6
"""A room that so many doors lead into is a hall: one comes through it anyway."""


@dataclass(frozen=True, slots=True)
class WantedTarget:
    """Something to be visited, the doors that let one in, and where one stands before each."""

    name: str
    room: RoomId | None
    """None: a door is visited, to be gone through."""
    doors: tuple[Door, ...]
    places: tuple[tuple[Place, ...], ...]
    """Of each door, one or two."""


@dataclass(frozen=True, slots=True)
class NotVisited:
    """A target that is not in the plan, and why."""

    name: str
    reason: str
    """`shut`, `no way`, `budget`, `no place`, `hall` or `start`."""
    said: str
    """The same in words."""


Wanted = tuple[list[WantedTarget], list[NotVisited]]


def wanted_doors(ways: WaysBetween, doors: Sequence[Door]) -> Wanted:
    """Return doors as targets; those that have no place are left out."""
    targets, left_out = [], []
    for door in {door.door_id: door for door in doors}.values():
        places = ways.before(door) if door.is_placed else []
        if places:
            targets.append(WantedTarget(door.label, None, (door,), (tuple(places),)))
        else:
            where = "no floor before it" if door.is_placed else "it has no place in the map"
            left_out.append(NotVisited(door.label, "no place", where))
    return targets, left_out


def wanted_rooms(ways: WaysBetween, rooms: Sequence[RoomId], start: Place | None) -> Wanted:
    """Return rooms as targets; those that no door leads into are left out."""
    targets, left_out = [], []
    inside = ways.room_of(start) if start is not None else None
    for room in dict.fromkeys(rooms):
        name = room_label(ways.plan, room)
        target = _room(ways, room, name)
        if room == inside:
            left_out.append(NotVisited(name, "start", "the round starts in it"))
        elif target is None:
            left_out.append(NotVisited(name, "no way", "no door leads into it"))
        else:
            targets.append(target)
    return targets, left_out


def all_rooms(ways: WaysBetween, start: Place | None) -> Wanted:
    """Return all rooms that doors lead into; halls are passed anyway."""
    graph = ways.plan.graph
    doors_of = {room: graph.doors_of(room) for room in graph.rooms}
    halls = [room for room, doors in doors_of.items() if len(doors) > HALL_DOORS]
    small = [room for room, doors in doors_of.items() if doors and room not in halls]
    targets, left_out = wanted_rooms(ways, small, start)
    inside = ways.room_of(start) if start is not None else None
    passed = [
        NotVisited(room_label(ways.plan, room), "hall",
                f"a hall of {len(doors_of[room])} doors, passed anyway")
        for room in halls
        if room != inside
    ]  # fmt: skip
    return targets, left_out + passed


def all_wanted(ways: WaysBetween, start: Place | None) -> Wanted:
    """Return all rooms, or all doors where there are no rooms.

    Raises:
        PlanError: There are no doors.
    """
    doors = list(ways.plan.door_map.doors.values())
    if not doors:
        raise PlanError("patrol-plan: no door is in the map then; there is nothing to visit.")
    if any(ways.plan.graph.doors_of(room) for room in ways.plan.graph.rooms):
        without_plan = [d for d in doors if d.is_placed and d.level not in ways.plan.floors]
        rooms, doors_alone = all_rooms(ways, start), wanted_doors(ways, without_plan)
        return rooms[0] + doors_alone[0], rooms[1] + doors_alone[1]
    return wanted_doors(ways, doors)


def wanted_by_name(
    ways: WaysBetween, names: NamedPlaces, rooms: Sequence[str], doors: Sequence[str],
    start: Place | None,
) -> Wanted:  # fmt: skip
    """Return the rooms and doors of these names.

    Raises:
        PlanError: There is no such room.
        UnknownDoorError: There is no such door.
    """
    by_room = wanted_rooms(ways, [names.room(called).room_id for called in rooms], start)
    by_door = wanted_doors(ways, [names.door(called) for called in doors])
    return by_room[0] + by_door[0], by_room[1] + by_door[1]


def _room(ways: WaysBetween, room: RoomId, name: str) -> WantedTarget | None:
    graph = ways.plan.graph
    doors = [
        ways.plan.door_map[door]
        for door in graph.doors_of(room)
        if graph.doorways[door].beyond(room) != OUTSIDE or _is_alone(ways, room)
    ]
    before = {door.door_id: tuple(ways.before(door, room)) for door in doors}
    usable = tuple(door for door in doors if before[door.door_id])
    if not usable:
        return None
    return WantedTarget(name, room, usable, tuple(before[door.door_id] for door in usable))


def _is_alone(ways: WaysBetween, room: RoomId) -> bool:
    """Tell whether a room has no doors but those to the outside."""
    graph = ways.plan.graph
    return all(graph.doorways[door].beyond(room) == OUTSIDE for door in graph.doors_of(room))
