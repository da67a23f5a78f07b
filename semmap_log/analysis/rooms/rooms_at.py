"""The rooms of a log at a moment: its floor plans then, cut by the doors that it had then."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from semmap_log.analysis.rooms.door_sides import sides_of
from semmap_log.analysis.rooms.door_walls import in_walls
from semmap_log.analysis.rooms.level_rooms import LevelRooms, level_rooms
from semmap_log.analysis.rooms.room_graph import OUTSIDE, Doorway, Lift, Room, RoomGraph, RoomId
from semmap_log.analysis.rooms.room_names import LIFT, room_names
from semmap_log.analysis.rooms.room_points import room_points
from semmap_log.core.folds.doors_of_class import only_doors
from semmap_log.core.model.doors import Door, DoorMap
from semmap_log.core.model.events import FloorMap
from semmap_log.core.model.keywords import knows_keywords
from semmap_log.core.model.moments import format_local
from semmap_log.log.door_log.door_log import DoorLog, Time


@dataclass(frozen=True)
class RoomPlan:
    """The rooms of a building, and where they lie.

    Attributes:
        graph: What joins them.
        levels: For each level with a floor plan, which room each cell lies in.
        floors: The floor plans.
        door_map: The doors.
        later: Of levels without a floor plan that got one later: from when on it counts, in words.
    """

    graph: RoomGraph
    levels: Mapping[int, LevelRooms]
    floors: Mapping[int, FloorMap]
    door_map: DoorMap
    later: Mapping[int, str] = field(default_factory=dict)

    def why_no_plan(self, levels: Iterable[int] | None = None) -> str:
        """Return that levels have no floor plan, as the end of a sentence about them.

        Args:
            levels: Those that are asked about; None: all.
        """
        chosen = self.later.keys() if levels is None else self.later.keys() & set(levels)
        if not chosen:
            return "has no floor plan"
        since = min(self.later[level] for level in chosen)
        return (
            f"has no floor plan then, only from {since} on (if it was there before, say so: import "
            "LOG MAP.YAML --since TIME)"
        )

    def room_at(self, level: int, x: float, y: float) -> RoomId | None:
        """Return the room that a point lies in; None: a wall, a door, or a level without a plan."""
        if level not in self.levels:
            return None
        found = int(self.levels[level].rooms_at(x, y))
        return found if found >= OUTSIDE else None


@knows_keywords
def rooms_of(
    log: DoorLog, *, at: Time = None, known_at: Time = None, event: int | None = None
) -> RoomGraph:
    """Return the rooms of all levels at a moment, and what joins them; without arguments: now.

    Rooms are cut from the log's floor plans by the doors, in whatever state these are, so that
    they change only with the plan, or with where doors are. A level without a floor plan has
    none: it is named in `levels_without_plan`.

    Args:
        log: Where the plans and the doors are from.
        at: What was true then, with all that is known today.
        known_at: Only what had been recorded by then.
        event: Only what has a number up to that.

    Raises:
        CostmapError: A floor plan is turned against its grid.
        MomentError: A time cannot be read.
    """
    return room_plan(log, at=at, known_at=known_at, event=event).graph


@knows_keywords
def room_plan(
    log: DoorLog, *, at: Time = None, known_at: Time = None, event: int | None = None
) -> RoomPlan:
    """Return the same with where the rooms lie.

    Args:
        log: Where the plans and the doors are from.
        at: What was true then, with all that is known today.
        known_at: Only what had been recorded by then.
        event: Only what has a number up to that.

    Raises:
        CostmapError: A floor plan is turned against its grid.
        MomentError: A time cannot be read.
    """
    door_map = only_doors(log.replay(at, known_at, event))
    floors = {
        level: floor
        for level in sorted(door_map.levels)
        if (floor := log.floor_of(door_map, level)) is not None
    }
    plan = plan_of(door_map, floors)
    return plan if (at, event) == (None, None) else replace(plan, later=_later(log, floors))


def _later(log: DoorLog, floors: Mapping[int, FloorMap]) -> dict[int, str]:
    """Return from when on levels have a floor plan that have none among `floors`, in words."""
    now = log.replay()
    events = {
        level: known.floor_map_event
        for level, known in now.levels.items()
        if known.floor_map_event is not None and level not in floors
    }
    zone = log.info.timezone
    return {
        level: format_local(log.entry(event).happened_ns, zone) for level, event in events.items()
    }


def plan_of(door_map: DoorMap, floors: Mapping[int, FloorMap]) -> RoomPlan:
    """Return the rooms of these floor plans, by level, cut by these doors.

    Raises:
        CostmapError: A floor plan is turned against its grid.
    """
    placed = placed_on(door_map.doors.values())
    levels: dict[int, LevelRooms] = {}
    rooms: dict[RoomId, Room] = {}
    doorways: list[Doorway] = []
    for level, floor in sorted(floors.items()):
        doors = placed.get(level, [])
        levels[level] = found = level_rooms(floor, doors, first_room=len(rooms) + 1)
        doorways += _doorways(floor, found, doors)
        rooms |= _rooms(found)
    doorways.sort(key=lambda doorway: doorway.door_id)
    names = room_names(rooms, doorways, door_map.doors)
    graph = RoomGraph(
        rooms={i: replace(room, name=names.get(i)) for i, room in rooms.items()},
        doorways={doorway.door_id: doorway for doorway in doorways},
        lifts=lifts_of(door_map.doors.values()),
        levels_without_plan=tuple(sorted(placed.keys() - floors.keys())),
    )
    return RoomPlan(graph, levels, floors, door_map)


def placed_on(doors: Iterable[Door]) -> dict[int, list[Door]]:
    """Return the doors that have a place, by their level, ids ascending."""
    placed = defaultdict(list)
    for door in sorted(doors, key=lambda door: door.door_id):
        if door.is_placed:
            placed[door.level].append(door)
    return dict(placed)


def lifts_of(doors: Iterable[Door]) -> tuple[Lift, ...]:
    """Return the lifts that doors belong to, by name."""
    named = defaultdict(list)
    for door in sorted(doors, key=lambda door: (door.level, door.door_id)):
        if door.annotations.get(LIFT):
            named[door.annotations[LIFT]].append(door.door_id)
    return tuple(Lift(name, tuple(ids)) for name, ids in sorted(named.items()))


def _doorways(floor: FloorMap, rooms: LevelRooms, doors: Sequence[Door]) -> list[Doorway]:
    if not doors:
        return []
    found = zip(doors, sides_of(rooms, doors), in_walls(floor, doors), strict=True)
    return [
        Doorway(door.door_id, door.level, left, right, in_wall=in_wall)
        for door, (left, right), in_wall in found
    ]


def _rooms(rooms: LevelRooms) -> dict[RoomId, Room]:
    points = room_points(rooms)
    cells = rooms.regions.cell_counts()
    made = {}
    for room in rooms.rooms:
        area_m2 = float(cells[rooms.label_of(room)]) * rooms.geometry.resolution**2
        made[room] = Room(room, rooms.level, None, area_m2, *points[room])
    return made
