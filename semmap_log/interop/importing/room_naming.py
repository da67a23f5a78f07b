"""Names of rooms, from a building's file to the doors that lead into them.

A building names points, not rooms. Where one such point lies in a room, and no other, the room is
called so; each of its doors is told, by the annotation `rooms`. So the name stays with the
doors wherever the floor plan comes from later.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace

from semmap_log.analysis.rooms.door_sides import sides_of
from semmap_log.analysis.rooms.level_rooms import LevelRooms, level_rooms
from semmap_log.analysis.rooms.room_graph import OUTSIDE, RoomId
from semmap_log.analysis.rooms.room_names import ROOMS
from semmap_log.core.model.doors import NAN, Door, DoorId, DoorState
from semmap_log.core.texts import counted
from semmap_log.interop.formats.files.door_table import DoorTable, TableDoor, TablePlace

Number = int
"""Of a door in the table."""


def with_room_names(table: DoorTable) -> DoorTable:
    """Return a building whose doors say what the rooms on their sides are called.

    Raises:
        CostmapError: A floor plan is turned against its grid.
    """
    told: dict[Number, dict[str, str]] = {}
    used: set[TablePlace] = set()
    for floor in table.floor_maps:
        numbers = [n for n, door in enumerate(table.doors) if door.level == floor.level]
        doors = [_door(table.doors[n]) for n in numbers]
        rooms = level_rooms(floor, doors)
        named = _named(rooms, [place for place in table.places if place.level == floor.level])
        sides = sides_of(rooms, doors) if doors else []
        for number, (left, right) in zip(numbers, sides, strict=True):
            names = [named[side].name if side in named else "" for side in (left, right)]
            if any(names) and left != right:
                told[number] = {ROOMS: ",".join(names)}
                used |= {named[side] for side in (left, right) if side in named}
    doors_told = tuple(
        replace(door, annotations={**door.annotations, **told.get(number, {})})
        for number, door in enumerate(table.doors)
    )
    return replace(
        table, doors=doors_told, left_out=(*table.left_out, *_said(len(table.places), len(used)))
    )


def _named(rooms: LevelRooms, places: Sequence[TablePlace]) -> dict[RoomId | None, TablePlace]:
    """Return the places that lie alone in a room, or with others of the same name, by room."""
    inside: defaultdict[RoomId, list[TablePlace]] = defaultdict(list)
    for place in places:
        inside[int(rooms.rooms_at(place.x, place.y))].append(place)
    return {
        room: found[0]
        for room, found in inside.items()
        if room > OUTSIDE and len({place.name for place in found}) == 1 and "," not in found[0].name
    }


def _said(places: int, used: int) -> Iterable[str]:
    if places > used:
        yield (
            f"{counted(places - used, 'named point')}: one names a room where it lies there alone, "
            "at the room's doors"
        )


def _door(door: TableDoor) -> Door:
    return Door(
        DoorId(0), door.level, door.x, door.y, door.theta, door.width, DoorState.UNKNOWN, NAN, NAN
    )
