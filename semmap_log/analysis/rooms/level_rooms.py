"""The rooms of a log at a moment: its floor plans, cut into regions by the doors.

The rule, for every plan: occupied cells are walls, and each door is a stroke 0.1 m thick, open or
shut; what they leave falls into 4-connected regions. A region at the border of the plan is the
outside, one below 1 m² a shaft, any other a room. Unknown cells are floor here: only walls and
doors cut. So rooms need walls all around: one whose floor ends in the unknown, as a laser's map may
have it, is part of the outside.

Which rooms lie on a door's two sides: seven probes start on the middle 60 % of the door's line and
go straight away from it, at most a metre, to the first cell of a room or of the outside; the
majority decides. A door that does not hang in a wall separates no rooms.

Each room has a point far from its walls, where a robot may stand and a name be written. Rooms are
eroded from their walls inward, a cell at a time, alternately with and without the corners, so that
the last cells lie about the middle of the widest circle in the room.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.analysis.rooms import room_graph
from semmap_log.analysis.rooms.regions import Regions, regions_of
from semmap_log.core.folds.levels import only_doors
from semmap_log.core.model.doors import Door, DoorMap
from semmap_log.core.model.events import FloorMap
from semmap_log.core.model.moments import Time, format_local
from semmap_log.log import DoorLog


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

    graph: room_graph.RoomGraph
    levels: Mapping[int, LevelRooms]
    floors: Mapping[int, FloorMap]
    door_map: DoorMap
    later: Mapping[int, str] = field(default_factory=dict)

    def why_no_plan(self, levels: Iterable[int] | None = None) -> str:
        """Return that levels have no floor plan, as the end of a sentence about them.

        Args:
            levels: The queried levels; None: all.
        """
        chosen = self.later.keys() if levels is None else self.later.keys() & set(levels)
        if not chosen:
            return "has no floor plan"
        since = min(self.later[level] for level in chosen)
        return (
            f"has no floor plan then, only from {since} on (if it was there before, say so: import "
            "LOG MAP.YAML --since TIME)"
        )

    def room_at(self, level: int, x: float, y: float) -> room_graph.RoomId | None:
        """Return the room that a point lies in; None: a wall, a door, or a level without a plan."""
        if level not in self.levels:
            return None
        found = int(self.levels[level].rooms_at(x, y))
        return found if found >= room_graph.OUTSIDE else None


def rooms_of(
    log: DoorLog, *, at: Time = None, known_at: Time = None, event: int | None = None
) -> room_graph.RoomGraph:
    """Return the rooms of all levels at a moment, and what joins them; without arguments: now.

    Rooms are cut from the log's floor plans by the doors, in whatever state these are, so that
    they change only with the plan, or with where doors are. A level without a floor plan has
    none: it is named in `levels_without_plan`.

    Args:
        log: The log of the plans and the doors.
        at: The moment, with all that is known today.
        known_at: Only what had been recorded by then.
        event: Only events with numbers up to that.

    Raises:
        CostmapError: A floor plan is rotated against its grid.
        MomentError: A time cannot be read.
    """
    return room_plan(log, at=at, known_at=known_at, event=event).graph


def room_plan(
    log: DoorLog, *, at: Time = None, known_at: Time = None, event: int | None = None
) -> RoomPlan:
    """Return the rooms with their places on the plans.

    Args:
        log: The log of the plans and the doors.
        at: The moment, with all that is known today.
        known_at: Only what had been recorded by then.
        event: Only events with numbers up to that.

    Raises:
        CostmapError: A floor plan is rotated against its grid.
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
    """Return in words when levels without a plan among `floors` get one later."""
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
        CostmapError: A floor plan is rotated against its grid.
    """
    placed = placed_on(door_map.doors.values())
    levels: dict[int, LevelRooms] = {}
    rooms: dict[room_graph.RoomId, room_graph.Room] = {}
    doorways: list[room_graph.Doorway] = []
    for level, floor in sorted(floors.items()):
        doors = placed.get(level, [])
        levels[level] = found = level_rooms(floor, doors, first_room=len(rooms) + 1)
        doorways += _doorways(floor, found, doors)
        rooms |= _rooms(found)
    doorways.sort(key=lambda doorway: doorway.door_id)
    names = room_graph.room_names(rooms, doorways, door_map.doors)
    graph = room_graph.RoomGraph(
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


def lifts_of(doors: Iterable[Door]) -> tuple[room_graph.Lift, ...]:
    """Return the lifts that doors belong to, by name."""
    named = defaultdict(list)
    for door in sorted(doors, key=lambda door: (door.level, door.door_id)):
        if door.annotations.get(room_graph.LIFT):
            named[door.annotations[room_graph.LIFT]].append(door.door_id)
    return tuple(room_graph.Lift(name, tuple(ids)) for name, ids in sorted(named.items()))


def _doorways(
    floor: FloorMap, rooms: LevelRooms, doors: Sequence[Door]
) -> list[room_graph.Doorway]:
    if not doors:
        return []
    found = zip(doors, sides_of(rooms, doors), in_walls(floor, doors), strict=True)
    return [
        room_graph.Doorway(door.door_id, door.level, left, right, in_wall=in_wall)
        for door, (left, right), in_wall in found
    ]


def _rooms(rooms: LevelRooms) -> dict[room_graph.RoomId, room_graph.Room]:
    points = room_points(rooms)
    cells = rooms.regions.cell_counts()
    made = {}
    for room in rooms.rooms:
        area_m2 = float(cells[rooms.label_of(room)]) * rooms.geometry.resolution**2
        made[room] = room_graph.Room(room, rooms.level, None, area_m2, *points[room])
    return made


PROBES = np.array([0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8])
"""Where on the line they start, from its middle on: of two equal counts the nearer one decides."""
REACH_M = 1.0
"""How far a probe goes."""
STEPS_A_CELL = 2

LEFT, RIGHT = 1.0, -1.0


def sides_of(
    rooms: LevelRooms, doors: Sequence[Door]
) -> list[tuple[room_graph.RoomId | None, room_graph.RoomId | None]]:
    """Return the rooms on the left and on the right of doors; None: no probe found one.

    A door off the plan has none on either side.
    """
    left = _found(rooms, doors, LEFT)
    right = _found(rooms, doors, RIGHT)
    return [(_most(a), _most(b)) for a, b in zip(left, right, strict=True)]


def _found(rooms: LevelRooms, doors: Sequence[Door], side: float) -> NDArray[np.int64]:
    """Return what each door's probes found on a side: (doors, probes)."""
    start_x, start_y, theta, width = (
        np.array([getattr(door, name) for door in doors])[:, None]
        for name in ("x", "y", "theta", "width")
    )
    x = start_x + PROBES * width * np.cos(theta)
    y = start_y + PROBES * width * np.sin(theta)
    found = np.full(x.shape, NO_ROOM, np.int64)
    columns, rows = rooms.cells_at(x, y)
    on_plan = (columns >= 0) & (columns < rooms.geometry.width)
    on_plan &= (rows >= 0) & (rows < rooms.geometry.height)
    step_m = rooms.geometry.resolution / STEPS_A_CELL
    for step in range(int(REACH_M / step_m) + 1):
        seeking = on_plan & (found == NO_ROOM)
        if not seeking.any():
            break
        away = side * step * step_m
        here = rooms.rooms_at(x - away * np.sin(theta), y + away * np.cos(theta))
        found[seeking] = here[seeking]
    return found


def _most(found: NDArray[np.int64]) -> room_graph.RoomId | None:
    """Return the most frequent finding of the probes; of several the first."""
    rooms = Counter(room for room in found.tolist() if room >= room_graph.OUTSIDE)
    return rooms.most_common(1)[0][0] if rooms else None


NEAR_M = 0.3
"""An end so near to a wall, or to another door, hangs there."""


def in_walls(floor: FloorMap, doors: Sequence[Door]) -> list[bool]:
    """Return of each door whether both of its ends are at a wall or at another door."""
    geometry = GridGeometry.of_floor(floor)
    return [
        all(
            _at_wall(floor, geometry, end) or _at_another(door, end, doors)
            for end in (door.start, door.end)
        )
        for door in doors
    ]


def _at_wall(floor: FloorMap, geometry: GridGeometry, point: Point) -> bool:
    x, y = point
    window = geometry.window_of(x - NEAR_M, y - NEAR_M, x + NEAR_M, y + NEAR_M)
    rows, columns = np.nonzero(floor.cells[window.slices] >= OCCUPIED_FROM)
    cell_m = geometry.resolution
    wall_x = geometry.origin_x + (columns + window.x0 + 0.5) * cell_m
    wall_y = geometry.origin_y + (rows + window.y0 + 0.5) * cell_m
    return bool((np.hypot(wall_x - x, wall_y - y) <= NEAR_M + cell_m / 2).any())


def _at_another(door: Door, point: Point, doors: Sequence[Door]) -> bool:
    x, y = np.array(point[0]), np.array(point[1])
    return any(
        float(distances(x, y, other.start, other.end)) <= NEAR_M
        for other in doors
        if other is not door
    )


MOST_CELLS = 100_000
"""Of a larger plan only each second, third … cell is looked at."""
SIDES = ((1, 0), (-1, 0), (0, 1), (0, -1))
CORNERS = ((1, 1), (1, -1), (-1, 1), (-1, -1))

Labels = NDArray[np.int32]
Cells = NDArray[np.intp]


def room_points(rooms: LevelRooms) -> dict[room_graph.RoomId, Point]:
    """Return a point of each room, metres, frame `map`."""
    grid = rooms.geometry
    stride = max(1, math.ceil(math.sqrt(grid.width * grid.height / MOST_CELLS)))
    rows, columns = np.arange(0, grid.height, stride), np.arange(0, grid.width, stride)
    sampled = rooms.room_of[rooms.regions.label_at(rows[:, None], columns[None, :])]
    found = _deepest(np.maximum(sampled, 0).astype(np.int32))
    cells = {room: (int(rows[r]), int(columns[c])) for room, (r, c) in found.items()}
    chosen = {room: cells.get(room) or _longest_run(rooms, room) for room in rooms.rooms}
    return {room: grid.map_to_world(column, row) for room, (row, column) in chosen.items()}


def _deepest(labels: Labels) -> dict[room_graph.RoomId, tuple[int, int]]:
    """Return the cell of each label that is eroded last; of several the one nearest their mean."""
    depth = np.zeros(labels.shape, np.int32)
    left = np.pad(labels, 1)
    while left.any():
        depth += left[1:-1, 1:-1] > 0
        left = _eaten(left, SIDES if depth.max() % 2 else (*SIDES, *CORNERS))
    rows, columns = np.nonzero(labels)
    return _last(labels[rows, columns], depth[rows, columns], rows, columns)


def _eaten(labels: Labels, neighbours: tuple[tuple[int, int], ...]) -> Labels:
    """Return the labels without the cells that have a neighbour of another."""
    kept: Labels = labels.copy()
    inner = kept[1:-1, 1:-1]
    height, width = labels.shape
    for up, right in neighbours:
        beside = labels[1 + up : height - 1 + up, 1 + right : width - 1 + right]
        inner[beside != labels[1:-1, 1:-1]] = 0
    return kept


def _last(
    label: Labels, depth: Labels, rows: Cells, columns: Cells
) -> dict[room_graph.RoomId, tuple[int, int]]:
    """Return the deepest cell of each label; of several the one nearest the label's mean."""
    count = np.bincount(label)
    with np.errstate(invalid="ignore"):
        row = (np.bincount(label, rows) / count)[label]
        column = (np.bincount(label, columns) / count)[label]
    order = np.lexsort((columns, rows, np.hypot(rows - row, columns - column), -depth, label))
    labels, first = np.unique(label[order], return_index=True)
    chosen = order[first]
    return {
        int(room): (int(rows[cell]), int(columns[cell]))
        for room, cell in zip(labels, chosen, strict=True)
    }


def _longest_run(rooms: LevelRooms, room: room_graph.RoomId) -> tuple[int, int]:
    """Return the middle cell of the longest row of cells of a room that is in no sample."""
    regions = rooms.regions
    runs = np.flatnonzero(regions.labels == rooms.label_of(room))
    longest = runs[np.argmax(regions.ends[runs] - regions.starts[runs])]
    middle = int(regions.starts[longest] + regions.ends[longest]) // 2
    row, column = divmod(middle, regions.shape[1])
    return row, column


STROKE_M = 0.1
"""The thickness of a door's stroke; at least one cell."""
LEAST_ROOM_M2 = 1.0
"""A region below that is a shaft, or a gap between two walls."""
OCCUPIED_FROM = 65
"""A cell from there on is a wall: map_server's `occupied_thresh`."""

NO_ROOM: room_graph.RoomId = -1
"""Of a cell in a wall, a door or a shaft."""


@dataclass(frozen=True, slots=True)
class LevelRooms:
    """Which room each cell of a level's floor plan lies in."""

    level: int
    geometry: GridGeometry
    regions: Regions
    room_of: NDArray[np.int64]
    """By the label of a region, its room; `OUTSIDE`, or `NO_ROOM`."""

    @property
    def rooms(self) -> list[room_graph.RoomId]:
        """The level's rooms, ascending."""
        return [int(room) for room in self.room_of if room > room_graph.OUTSIDE]

    def label_of(self, room_id: room_graph.RoomId) -> int:
        """Return the region that a room is."""
        return int(np.flatnonzero(self.room_of == room_id)[0])

    def rooms_at(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.int64]:
        """Return the rooms at points, metres; a point off the plan is in `OUTSIDE`."""
        columns, rows = self.cells_at(x, y)
        found = self.room_of[self.regions.label_at(rows, columns)]
        on_plan = (
            (columns >= 0) & (columns < self.geometry.width)
            & (rows >= 0) & (rows < self.geometry.height)
        )  # fmt: skip
        return np.where(on_plan, found, room_graph.OUTSIDE)

    def cells_at(self, x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the columns and rows of points; off the plan, one that it does not have."""
        grid = self.geometry
        across = (np.asarray(x, np.float64) - grid.origin_x) / grid.resolution
        up = (np.asarray(y, np.float64) - grid.origin_y) / grid.resolution
        return (
            np.floor(np.clip(across, -1, grid.width)).astype(np.int64),
            np.floor(np.clip(up, -1, grid.height)).astype(np.int64),
        )


def level_rooms(
    floor: FloorMap, doors: Iterable[Door], *, first_room: room_graph.RoomId = 1
) -> LevelRooms:
    """Return the rooms of a floor plan.

    Args:
        floor: The plan.
        doors: The level's doors, in whatever state.
        first_room: The number of its first room.

    Raises:
        CostmapError: The plan is rotated against its grid.
    """
    geometry = GridGeometry.of_floor(floor)
    free = floor.cells < OCCUPIED_FROM
    draw_doors(free, geometry, doors)
    regions = regions_of(free)
    return LevelRooms(floor.level, geometry, regions, _numbered(regions, geometry, first_room))


def draw_doors(free: NDArray[np.bool_], geometry: GridGeometry, doors: Iterable[Door]) -> None:
    """Take the doors' strokes from the free cells of a grid."""
    half_m = max(STROKE_M, geometry.resolution) / 2 * (1 + 1e-6)
    for door in doors:
        clear_stroke(free, geometry, door.start, door.end, half_m)


def _numbered(
    regions: Regions, geometry: GridGeometry, first_room: room_graph.RoomId
) -> NDArray[np.int64]:
    """Return the room of each label, in the order of the regions' first cells."""
    area_m2 = regions.cell_counts() * geometry.resolution**2
    border = regions.at_border()
    is_room = ~border & (area_m2 >= LEAST_ROOM_M2)
    rooms = np.where(is_room, first_room - 1 + np.cumsum(is_room), NO_ROOM)
    rooms[border] = room_graph.OUTSIDE
    return rooms


Point = tuple[float, float]
BLOCK_CELLS = 1_000_000
"""Cells that are processed together, however long a line is."""


def clear_stroke(
    cells: NDArray[np.bool_], geometry: GridGeometry, start: Point, end: Point, half_m: float
) -> None:
    """Clear the cells whose centres lie at most `half_m` from a line; off the grid nothing is done.

    With at least half a cell no way of 4-connected cells leads through the line.
    """
    for rows, columns in _blocks(geometry, start, end, half_m):
        x = geometry.origin_x + (np.arange(columns.start, columns.stop) + 0.5) * geometry.resolution
        y = geometry.origin_y + (np.arange(rows.start, rows.stop) + 0.5) * geometry.resolution
        cells[rows, columns] &= distances(x[None, :], y[:, None], start, end) > half_m


def distances(
    x: NDArray[np.float64], y: NDArray[np.float64], start: Point, end: Point
) -> NDArray[np.float64]:
    """Return how far points lie from a line with two ends, metres."""
    (x0, y0), (x1, y1) = start, end
    dx, dy = x1 - x0, y1 - y0
    square = dx * dx + dy * dy
    along = ((x - x0) * dx + (y - y0) * dy) / square if square > 0 else np.zeros(())
    along = np.clip(along, 0.0, 1.0)
    return np.hypot(x - x0 - along * dx, y - y0 - along * dy)


def _blocks(
    geometry: GridGeometry, start: Point, end: Point, half_m: float
) -> Iterator[tuple[slice, slice]]:
    """Yield the parts of the grid in which a line can lie."""
    cell_m = geometry.resolution
    left, right = _span((start[0], end[0]), half_m, (geometry.origin_x, cell_m, geometry.width))
    low, high = _span((start[1], end[1]), half_m, (geometry.origin_y, cell_m, geometry.height))
    if left >= right:
        return
    rows = max(1, BLOCK_CELLS // (right - left))
    for row in range(low, high, rows):
        yield slice(row, min(high, row + rows)), slice(left, right)


def _span(
    ends: tuple[float, float], half_m: float, axis: tuple[float, float, int]
) -> tuple[int, int]:
    """Return the first cell of an axis that a line can touch, and the one after the last.

    Args:
        ends: Of the line, along that axis.
        half_m: Half its thickness.
        axis: Where its first cell begins, metres a cell, how many cells it has.
    """
    origin, cell_m, count = axis
    lowest, highest = min(ends) - half_m, max(ends) + half_m
    first = min(max((lowest - origin) / cell_m - 1, 0), count)
    behind = min(max((highest - origin) / cell_m + 1, 0), count)
    return math.floor(first), math.ceil(behind)
