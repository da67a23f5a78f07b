"""The rooms of a building and the doors and lifts that join them, as a graph.

Rooms are nodes, doorways edges. A door with the same room on both sides is a loop: a corridor or
a hall that has another, open end. What lies around the building is the room `OUTSIDE`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from semmap_log.core.model.doors import DoorId

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
    """The rooms of a log's floor plans at a moment, and what joins them.

    Attributes:
        rooms: By id, ascending; without the outside.
        doorways: By door, ascending; each door that has a place on a level with a floor plan.
        lifts: By name.
        levels_without_plan: Levels that have doors and no floor plan: nothing is known of their
            rooms.
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
        """Return the rooms that one leads to: through its doors, and by the lifts behind them.

        From the outside lead the doors of all levels, but no lift.
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
