"""The rooms of a building and the doors and lifts that join them, as a graph.

Rooms are nodes, doorways edges. A door with the same room on both sides is a loop: a corridor or
a hall that has another, open end. What lies around the building is the room `OUTSIDE`.

Rooms get their names from these sources, in order:

1. The doors' annotation `rooms`, `lobby,corridor`: the room on the left and that on the right,
   looking from the door's start along its line. The doors of a room decide together, so that a
   person who takes one for the other is outvoted. The import of a building sets it where a named
   vertex lies alone in a room; a person, with `semmap-log annotate LOG DOOR rooms …`.
2. A room whose doors are all of one lift is that lift's cabin, and has its name.
3. A room with several doors has the name that these have in common but for a last word such as
   `_inner` or `_outer`; a room with one door, that of its door. A door that is only numbered
   (`L2_door5`) names none, nor does one between two rooms that have no other.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from semmap_log.core.model.doors import Door, DoorId

ROOMS = "rooms"
"""The annotation of a door: what the rooms on its left and its right are called."""
LIFT = "lift"
"""The annotation of a lift's doors: the lift's name. Doors with the same one are of one lift."""

ON_ITS_SIDE, ON_THE_OTHER = 3, 2
"""How much a name on a door counts for the room on its side, and for the other."""

_SIDE = re.compile(r"[ _-](inner|outer|inside|outside|in|out|front|back|door)$", re.IGNORECASE)
_NUMBERED = re.compile(r"(.*[ _-])?door[ _-]?\d+|door", re.IGNORECASE)


def room_names(
    rooms: Mapping[RoomId, Room], doorways: Sequence[Doorway], doors: Mapping[DoorId, Door]
) -> dict[RoomId, str]:
    """Return the names of the rooms that have one.

    Args:
        rooms: All of them, by number.
        doorways: All of them, by door, ascending.
        doors: The doors.
    """
    every = _leading(doorways)
    walked = _leading([each for each in doorways if not doors[each.door_id].annotations.get(LIFT)])
    told = _told({room: every[room] for room in rooms if room in every}, doors)
    found = {}
    for room in rooms:
        name = (
            told.get(room)
            or _lift_of(rooms[room], every.get(room, ()), rooms, doors)
            or _common([doors[doorway.door_id] for doorway in walked.get(room, ())])
            or _of_its_door(room, walked, doors)
        )
        if name:
            found[room] = name
    return found


def annotated_rooms(door: Door) -> tuple[str, str] | None:
    """Return the names of a door's left and right room by its annotation; "": unnamed.

    None: there is no annotation, or not of two names.
    """
    names = [name.strip() for name in door.annotations.get(ROOMS, "").split(",")]
    if len(names) != 2 or not any(names) or names[0] == names[1]:
        return None
    return names[0], names[1]


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


def _told(
    leading: Mapping[RoomId, Sequence[Doorway]], doors: Mapping[DoorId, Door]
) -> dict[RoomId, str]:
    """Return what the doors of rooms call them; the surest first, whose name no neighbour has."""
    votes: dict[RoomId, Counter[str]] = {}
    for room, doorways in leading.items():
        for doorway in doorways:
            if told := _votes(room, doorway, doors[doorway.door_id]):
                votes.setdefault(room, Counter()).update(told)
    found: dict[RoomId, str] = {}
    while votes:
        room = max(votes, key=lambda each: (max(votes[each].values()), -each))
        ((name, count),) = votes.pop(room).most_common(1)
        if not count:
            continue
        found[room] = name
        for doorway in leading[room]:
            beyond = doorway.beyond(room)
            if beyond in votes:
                votes[beyond].subtract(_votes(beyond, doorway, doors[doorway.door_id], only=name))
    return found


def _votes(
    room: RoomId, doorway: Doorway, door: Door, *, only: str | None = None
) -> dict[str, int]:
    """Return a door's votes for a room's name: more for that on its side, fewer for the other."""
    told = annotated_rooms(door) or ("", "")
    left, right = (ON_ITS_SIDE, ON_THE_OTHER) if room == doorway.left else (
        ON_THE_OTHER, ON_ITS_SIDE
    )  # fmt: skip
    weights = {told[1]: right, told[0]: left}
    return {name: weight for name, weight in weights.items() if name and only in (None, name)}


def _lift_of(
    room: Room,
    doorways: Sequence[Doorway],
    rooms: Mapping[RoomId, Room],
    doors: Mapping[DoorId, Door],
) -> str | None:
    """Return the lift whose cabin a room is: no larger than what lies before its doors."""
    lifts = {doors[doorway.door_id].annotations.get(LIFT) for doorway in doorways}
    beyond = [rooms.get(doorway.beyond(room.room_id) or OUTSIDE) for doorway in doorways]
    if len(lifts) != 1 or any(other and other.area_m2 < room.area_m2 for other in beyond):
        return None
    return lifts.pop()


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


RoomId = int

OUTSIDE: RoomId = 0
"""What lies around the building, on every level."""


@dataclass(frozen=True)
class Room:
    """A region of one level's floor that walls and doors enclose.

    Attributes:
        room_id: 1 and up, by level, then by the region's first cell: the same plan and doors
            give the same numbers.
        level: The level's number.
        name: What it is called, from a vertex that lies in it or from its doors' names; None:
            it has no name.
        area_m2: Its floor, square metres.
        x: A point in it that is far from its walls, metres, map frame.
        y: The point's y.
    """

    room_id: RoomId
    level: int
    name: str | None
    area_m2: float
    x: float
    y: float


@dataclass(frozen=True)
class Doorway:
    """A door and the rooms that it joins.

    Attributes:
        door_id: The door.
        level: Its level.
        left: The room to the left of the door's line, looking from its start along theta;
            None: no room was found there.
        right: The room to its right.
        in_wall: Whether both ends of its line are at a wall, or at another door: else it keeps
            nothing apart.
    """

    door_id: DoorId
    level: int
    left: RoomId | None
    right: RoomId | None
    in_wall: bool = True

    @property
    def joins_two(self) -> bool:
        """Whether it joins two rooms, of which one may be the outside."""
        return None not in (self.left, self.right) and self.left != self.right

    @property
    def is_loop(self) -> bool:
        """Whether the same room lies on both of its sides."""
        return self.left is not None and self.left == self.right

    def beyond(self, room_id: RoomId) -> RoomId | None:
        """Return the room on the other side than that one."""
        return self.right if room_id == self.left else self.left


@dataclass(frozen=True)
class Lift:
    """A lift that joins levels.

    Attributes:
        name: What it is called in the building.
        doors: Its doors, by level, then id.
    """

    name: str
    doors: tuple[DoorId, ...]


@dataclass(frozen=True)
class RoomGraph:
    """The rooms of a log's floor plans at a moment, with the doors and lifts that join them.

    Attributes:
        rooms: By id, ascending; without the outside.
        doorways: By door, ascending; each door that has a place on a level with a floor plan.
        lifts: By name.
        levels_without_plan: Levels that have doors but no floor plan: their rooms are unknown.
    """

    rooms: Mapping[RoomId, Room]
    doorways: Mapping[DoorId, Doorway]
    lifts: tuple[Lift, ...] = ()
    levels_without_plan: tuple[int, ...] = ()

    @property
    def loops(self) -> tuple[DoorId, ...]:
        """The doors that have the same room on both sides, ascending."""
        return tuple(i for i, doorway in self.doorways.items() if doorway.is_loop)

    def doors_of(self, room_id: RoomId) -> tuple[DoorId, ...]:
        """Return the doors that lead into that room from another, ascending."""
        return tuple(
            door_id
            for door_id, doorway in self.doorways.items()
            if doorway.joins_two and room_id in (doorway.left, doorway.right)
        )

    def neighbours(self, room_id: RoomId) -> tuple[RoomId, ...]:
        """Return the rooms that one leads to: through its doors, and by the lifts beyond them.

        The outside leads to rooms through the doors of all levels, but by no lift.
        """
        doorways = [self.doorways[door_id] for door_id in self.doors_of(room_id)]
        beyond = {room for doorway in doorways if (room := doorway.beyond(room_id)) is not None}
        for lift in self.lifts if room_id != OUTSIDE else ():
            stops = {door_id: self._rooms_at(door_id) for door_id in lift.doors}
            here = {i for i, rooms in stops.items() if room_id in rooms}
            if here:
                beyond |= set().union(*(rooms for i, rooms in stops.items() if i not in here))
        return tuple(sorted(beyond - {room_id}))

    def lift_of(self, door_id: DoorId) -> Lift | None:
        """Return the lift that a door belongs to; None: it is no lift's."""
        return next((lift for lift in self.lifts if door_id in lift.doors), None)

    def _rooms_at(self, door_id: DoorId) -> set[RoomId]:
        """Return the rooms on a door's sides."""
        doorway = self.doorways.get(door_id)
        sides = (doorway.left, doorway.right) if doorway else ()
        return {room for room in sides if room is not None}
