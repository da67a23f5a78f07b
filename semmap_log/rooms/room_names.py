"""What rooms are called: by what is told at their doors, by a lift, or by their doors' names.

1. The doors' annotations `left_room` and `right_room`: what the room on that side is called,
   looking from the door's start along its line. Most doors decide. The import of a building sets
   them where one named vertex lies in the room; a person sets them with `semmap-log annotate`.
2. A room whose doors are all of one lift is that lift's cabin, and has its name.
3. A room with several doors has the name that these have in common but for a last word such as
   `_inner` or `_outer`; a room with one door, that of its door. A door that is only numbered
   (`L2_door5`) names none, nor does one between two rooms that have no other.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence

from semmap_log.domain.doors import Door, DoorId
from semmap_log.rooms.room_graph import Doorway, RoomId

LEFT_ROOM, RIGHT_ROOM = "left_room", "right_room"
"""Annotations of a door: what the room on that side of it is called."""
LIFT = "lift"
"""The annotation of a lift's doors: the lift's name. Doors with the same one are of one lift."""

_SIDE = re.compile(r"[ _-](inner|outer|inside|outside|in|out|front|back|door)$", re.IGNORECASE)
_NUMBERED = re.compile(r"(.*[ _-])?door[ _-]?\d+|door", re.IGNORECASE)


def room_names(
    rooms: Sequence[RoomId], doorways: Sequence[Doorway], doors: Mapping[DoorId, Door]
) -> dict[RoomId, str]:
    """Return the names of the rooms that have one.

    Args:
        rooms: All of them.
        doorways: All of them, by door, ascending.
        doors: The doors.
    """
    every = _leading(doorways)
    walked = _leading([each for each in doorways if not doors[each.door_id].annotations.get(LIFT)])
    found = {}
    for room in rooms:
        name = (
            _told(room, doorways, doors)
            or _lift_of([doors[doorway.door_id] for doorway in every.get(room, ())])
            or _common([doors[doorway.door_id] for doorway in walked.get(room, ())])
            or _of_its_door(room, walked, doors)
        )
        if name:
            found[room] = name
    return found


def stem(name: str) -> str:
    """Return a door's name without its last word, where that says which door of a room it is."""
    return _SIDE.sub("", name)


def _leading(doorways: Sequence[Doorway]) -> dict[RoomId, list[Doorway]]:
    """Return the doorways that lead into each room from another."""
    found: dict[RoomId, list[Doorway]] = {}
    for doorway in doorways:
        if doorway.joins_two:
            for side in (doorway.left, doorway.right):
                assert side is not None
                found.setdefault(side, []).append(doorway)
    return found


def _told(room: RoomId, doorways: Sequence[Doorway], doors: Mapping[DoorId, Door]) -> str | None:
    """Return what most of a room's doors call it; of several names the first door's."""
    names = Counter(
        name
        for doorway in doorways
        for side, key in ((doorway.left, LEFT_ROOM), (doorway.right, RIGHT_ROOM))
        if side == room and (name := doors[doorway.door_id].annotations.get(key))
    )
    return names.most_common(1)[0][0] if names else None


def _lift_of(doors: Sequence[Door]) -> str | None:
    lifts = {door.annotations.get(LIFT) for door in doors}
    return lifts.pop() if len(lifts) == 1 else None


def _common(doors: Sequence[Door]) -> str | None:
    """Return the stem that all names of several doors have."""
    stems = {stem(door.name or "") for door in doors}
    only = stems.pop() if len(doors) > 1 and len(stems) == 1 else ""
    return only or None


def _of_its_door(
    room: RoomId, leading: Mapping[RoomId, Sequence[Doorway]], doors: Mapping[DoorId, Door]
) -> str | None:
    """Return the name of a room's only door, if it can mean that room only."""
    if len(leading.get(room, ())) != 1:
        return None
    (doorway,) = leading[room]
    beyond = doorway.beyond(room)
    name = doors[doorway.door_id].name or ""
    if not beyond or len(leading[beyond]) == 1 or _NUMBERED.fullmatch(name):
        return None
    return stem(name) or None
