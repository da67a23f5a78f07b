"""A planned patrol: its options, its targets, its stops, and the ways between them.

Targets are rooms by their doors, or doors themselves. Places are given as people name them:
`2.5,1.5`, `2.5,1.5,L1`, a door, or a room. Travel times between places come from the floor plan, or
from a straight line where there is no plan.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.planning.door_chances import LONGEST_S, SkipRule
from semmap_log.analysis.rooms.door_ways import Place
from semmap_log.analysis.rooms.level_rooms import RoomPlan
from semmap_log.analysis.rooms.room_graph import OUTSIDE, Room, RoomId
from semmap_log.analysis.rooms.walking import SPEED_M_S, TravelTimes
from semmap_log.core.folds.levels import resolve_level
from semmap_log.core.model.doors import Door, DoorId
from semmap_log.core.model.moments import Time
from semmap_log.errors import PlanError, UnknownDoorError, UnknownLevelError
from semmap_log.log import DoorLog


def patrol_ways(plan: PatrolPlan, ways: WaysBetween) -> list[list[Place]]:
    """Return the corners of each way: to the first stop, if the start is known, and then on.

    Args:
        plan: The round; its times are those of these ways.
        ways: In the building, as it was at the round's start.
    """
    start = [] if plan.start is None else [plan.start]
    places = [*start, *(stop.place for stop in plan.stops)]
    return [ways.way(here, there, plan.avoided) for here, there in pairwise(places)]


ENTER_S, WAIT_S, LOOK_S = 17.0, 10.0, 3.0


@dataclass(frozen=True, slots=True)
class PatrolOptions:
    """What a round is like."""

    speed_m_s: float = SPEED_M_S
    budget_s: float | None = None
    enter_s: float = ENTER_S
    """The time to go in, look, and come out."""
    wait_s: float = WAIT_S
    """How long the robot waits at a door that is shut, after a look of 3 s."""
    asks: bool = False
    """The robot may ask for doors: P is that of passing, learnt from earlier tries."""
    skip: SkipRule = field(default_factory=SkipRule)


@dataclass(frozen=True, slots=True)
class PlannedStop:
    """A stop of the plan."""

    target: WantedTarget
    door: Door
    """By which to go in."""
    place: Place
    """Where to stand before it."""
    others: tuple[Door, ...]
    """To try if that is shut."""
    arrives_ns: int
    """On average."""
    p_passes: float
    """When one arrives."""
    low: float
    high: float
    """The 90 % interval's end."""
    is_known: bool
    """False: UNKNOWN; P is that of the others on average."""
    wait_s: float | None
    """Mean wait from the arrival until it is open; None: unknown."""
    why: str


@dataclass(frozen=True, slots=True)
class PatrolPlan:
    """A round, planned."""

    start_ns: int
    known_ns: int
    """Later events do not count."""
    tz: str
    estimator: str
    options: PatrolOptions
    start: Place | None
    """None: the robot's place is unknown; the round begins at its first stop."""
    stops: tuple[PlannedStop, ...]
    left_out: tuple[NotVisited, ...]
    mean_visit_s: float
    """Mean time from the start to the visit of a target that lets the robot in."""
    visits: float
    """How many of the stops let the robot in at their first door, on average."""
    notes: tuple[str, ...]
    """Warnings."""
    avoided: frozenset[DoorId] = frozenset()
    """Doors that are likely shut at the start: ways lead through them only if they must."""


def check_options(options: PatrolOptions) -> None:
    """Check the options of a round.

    Raises:
        PlanError: A time is invalid.
    """
    if options.budget_s is not None and not (math.isfinite(options.budget_s)
                                             and options.budget_s > 0):  # fmt: skip
        raise PlanError(f"budget: expected a time above 0 s, got {options.budget_s:g} s.")
    for name, seconds in (("enter", options.enter_s), ("wait", options.wait_s)):
        if not (math.isfinite(seconds) and 0 <= seconds <= LONGEST_S):
            raise PlanError(f"{name}: expected 0 s to {LONGEST_S:g} s, got {seconds:g} s.")


HALL_DOORS = 6
"""A room that so many doors lead into is a hall: one comes through it anyway."""


@dataclass(frozen=True, slots=True)
class WantedTarget:
    """A target, the doors that lead into it, and where to stand before each."""

    name: str
    room: RoomId | None
    """None: the target is a door, to go through."""
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
    """Return whether all doors of a room lead to the outside."""
    graph = ways.plan.graph
    return all(graph.doorways[door].beyond(room) == OUTSIDE for door in graph.doors_of(room))


_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
_POINT = re.compile(rf"({_NUMBER})\s*,\s*({_NUMBER})(?:\s*,\s*(.+))?", re.ASCII)
_ROOM_ID = re.compile(r"(?:room[ :])?(\d+)", re.ASCII | re.IGNORECASE)


class NamedPlaces:
    """Reads names of places, as of a moment."""

    def __init__(self, log: DoorLog, ways: WaysBetween, at: Time = None) -> None:
        """Take a log, and the moment of the names; None: its end."""
        self._log = log
        self._ways = ways
        self._scope = log.scope(at)

    @property
    def _plan(self) -> RoomPlan:
        return self._ways.plan

    def door(self, called: str) -> Door:
        """Return the door of that id, name, or level/name.

        Raises:
            UnknownDoorError: There is no such door, or more than one.
        """
        door_map = self._plan.door_map
        found: DoorId = self._log.resolve_in(called.strip(), self._scope, door_map)
        return door_map[found]

    def room(self, called: str) -> Room:
        """Return the room of that number or name.

        Raises:
            PlanError: There is no such room, or several have the name.
        """
        rooms = self._plan.graph.rooms
        called = called.strip()
        named = [room for room in rooms.values() if room.name == called]
        if len(named) == 1:
            return named[0]
        if named:
            numbers = ", ".join(str(room.room_id) for room in named)
            raise PlanError(f"room {called!r}: rooms {numbers} bear that name; give the number.")
        number = _ROOM_ID.fullmatch(called)
        if number and int(number[1]) in rooms:
            return rooms[int(number[1])]
        if not rooms:
            raise PlanError(f"room {called!r}: the log {self._plan.why_no_plan()}: no rooms.")
        raise PlanError(
            f"room {called!r}: expected a name, or a number of 1..{max(rooms)}; "
            "`semmap-log rooms` lists them."
        )

    def place(self, called: str, option: str, *, seen_from: Place | None = None) -> Place:
        """Return the place of a text: a point, the middle of a room, or before a door.

        Args:
            called: The text as it was typed.
            option: The name of the argument, for messages.
            seen_from: Of a door, the side that is reached first from there; None: its left.

        Raises:
            PlanError: There is no such place, or no robot can stand there.
        """
        if found := _POINT.fullmatch(called.strip()):
            place = Place(self._level(found[3], option), float(found[1]), float(found[2]))
            self._ways.check_start(place, option)
            return place
        if (room := self._room_or_none(called)) is not None:
            return Place(room.level, room.x, room.y)
        try:
            door = self.door(called)
        except UnknownDoorError as error:
            raise PlanError(
                f"{option} {called!r}: expected X,Y or X,Y,LEVEL in metres, a room, or a door. "
                f"{error}"
            ) from None
        if not door.is_placed:
            raise PlanError(f"{option} {called!r}: the door has no place in the map.")
        before = self._ways.before(door)
        if not before:
            raise PlanError(f"{option} {called!r}: there is no floor on either side of the door.")
        return self._ways.nearest(before, seen_from)

    def _room_or_none(self, called: str) -> Room | None:
        """Return the room of a text; a bare number is a door's."""
        if called.strip().isdigit():
            return None
        try:
            return self.room(called)
        except PlanError:
            if called.strip().lower().startswith("room"):
                raise
            return None

    def _level(self, called: str | None, option: str) -> int:
        try:
            return resolve_level(called, self._plan.door_map)
        except UnknownLevelError as error:
            raise PlanError(f"{option}: expected X,Y or X,Y,LEVEL; {error}") from None


def room_label(plan: RoomPlan, room: RoomId) -> str:
    """Return a room's label: its name, or its number."""
    known = plan.graph.rooms.get(room)
    return (known.name if known else None) or f"room {room}"


def listed(texts: Sequence[str]) -> list[str]:
    """Return the names in `a,b` and in options that were given several times."""
    return [name.strip() for text in texts for name in text.split(",") if name.strip()]


SLOWEST_M_S, QUICKEST_M_S = 0.001, 1000.0


class WaysBetween:
    """Travel times: over the floor plans, and on levels without one in a straight line."""

    def __init__(self, plan: RoomPlan, *, speed_m_s: float = SPEED_M_S) -> None:
        """Draw the floors.

        Raises:
            PlanError: The speed is invalid.
            CostmapError: A floor plan cannot be walked on.
        """
        if not SLOWEST_M_S <= speed_m_s <= QUICKEST_M_S:
            raise PlanError(
                f"speed: expected {SLOWEST_M_S:g} to {QUICKEST_M_S:g} metres a second, "
                f"got {speed_m_s:g}."
            )
        self.plan = plan
        self.speed_m_s = speed_m_s
        self._times = TravelTimes.of_plan(plan, speed_m_s=speed_m_s)

    def before(self, door: Door, room: RoomId | None = None) -> list[Place]:
        """Return where the robot may stand before a door.

        Args:
            door: It has a place.
            room: Into which it is to lead: only on its other side; None: on either.
        """
        if door.level not in self.plan.floors:
            return [middle_of(door)]
        doorway = self.plan.graph.doorways[door.door_id]
        sides = zip((doorway.left, doorway.right), self._times.before(door.door_id), strict=True)
        return [place for side, place in sides if place is not None and side != room]

    def nearest(self, places: Sequence[Place], to: Place | None) -> Place:
        """Return which of some places is reached first from another; None: the first of them."""
        if len(places) == 1 or to is None:
            return places[0]
        return places[int(self.between_s([to], places)[0].argmin())]

    def without_plan(self, levels: Iterable[int]) -> str | None:
        """Return a note on levels where distances are straight lines; None: there are none."""
        flat = sorted(set(levels) - set(self.plan.floors))
        if not flat:
            return None
        called = ", ".join(self.plan.door_map.level_name(level) for level in flat)
        return f"level {called} {self.plan.why_no_plan(flat)}: distances are straight lines"

    def room_of(self, place: Place) -> RoomId | None:
        """Return the room that a place lies in; None: in none, or its level has no plan."""
        return self.plan.room_at(place.level, place.x, place.y)

    def check_start(self, place: Place, called: str) -> None:
        """Check that a robot can stand at a place.

        Raises:
            PlanError: The place is in a wall, or off the map.
        """
        floor = self.plan.floors.get(place.level)
        if floor is None:
            if place.level not in self.plan.door_map.levels and self.plan.floors:
                raise PlanError(f"{called}: there is no level {place.level}.")
            return
        around = self._times.between([place], [place])
        if not math.isfinite(around[0, 0]):
            room = self.room_of(place)
            where = "outside of the floor plan" if room == OUTSIDE else "in or too near to a wall"
            raise PlanError(
                f"{called}: ({place.x:g}, {place.y:g}) on level {place.level} is {where}; "
                "expected a place where a robot of 0.25 m radius can stand."
            )

    def between_s(
        self, sources: Sequence[Place], targets: Sequence[Place], shut: Collection[DoorId] = ()
    ) -> NDArray[np.float64]:
        """Return the seconds from places to places: (n, m); inf: there is no way."""
        found = self._times.between(sources, targets, shut)
        for row, source in enumerate(sources):
            for column, target in enumerate(targets):
                if source.level == target.level and source.level not in self.plan.floors:
                    away_m = math.dist((source.x, source.y), (target.x, target.y))
                    found[row, column] = away_m / self.speed_m_s
        return found

    def way(self, source: Place, target: Place, shut: Collection[DoorId] = ()) -> list[Place]:
        """Return the corners of the way between two places, both included.

        Args:
            source: From where.
            target: To where.
            shut: Doors that it avoids if there is a way without them.
        """
        found = self._times.way(source, target, shut) or self._times.way(source, target)
        return found or [source, target]


def middle_of(door: Door) -> Place:
    """Return the middle of a door's line."""
    (x0, y0), (x1, y1) = door.start, door.end
    return Place(door.level, (x0 + x1) / 2, (y0 + y1) / 2)
