"""The rooms of a log: cut by its doors, joined by them, at any moment."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given

import semmap_log as sl
from semmap_log.analysis.rooms import OUTSIDE, RoomGraph, RoomPlan, plan_of, room_plan, rooms_of
from semmap_log.core.model.doors import DoorId, DoorMap, Level
from semmap_log.core.model.events import FloorMap, LevelAdded
from semmap_log.errors import CostmapError
from semmap_log.interop.importing.importing import import_file
from tests.analysis.rooms.buildings import Building, buildings, door_at, drawn, floor_of
from tests.analysis.rooms.flood import flooded

SECOND = 10**9
TWO_ROOMS = drawn(
    """
............
.##########.
.#...#....#.
.#........#.
.#...#....#.
.##########.
............
""",
    scale=10,
)
"""Two rooms, 3 x 3 m and 4 x 3 m, with a doorway between them at x 5..6, y 3..4."""
BETWEEN = door_at(1, (5.5, 3.0), (5.5, 4.0))


def _plan(floor: FloorMap, *doors: sl.Door) -> RoomPlan:
    return plan_of(
        DoorMap({door.door_id: door for door in doors}, {floor.level: Level(floor.level)}),
        {floor.level: floor},
    )


def _joined(graph: RoomGraph) -> list[set[int]]:
    """Return which rooms doors join, directly or by way of others."""
    groups = [{room} for room in graph.rooms]
    for doorway in graph.doorways.values():
        touched = [group for group in groups if group & {doorway.left, doorway.right}]
        groups = [group for group in groups if group not in touched] + [set().union(*touched)]
    return groups


@given(buildings())
def test_every_door_shut_cuts_the_rooms_that_a_flood_fill_finds(building: Building) -> None:
    """As many as the walls and doors were made for, whatever state the doors are in."""
    graph = plan_of(building.door_map, {0: building.floor}).graph

    assert building.rooms == len(graph.rooms)
    assert all(doorway.joins_two for doorway in graph.doorways.values())
    assert all(doorway.in_wall for doorway in graph.doorways.values())


@given(buildings())
def test_every_door_open_joins_what_a_flood_fill_reaches(building: Building) -> None:
    """Rooms are joined in the graph if, and only if, one can walk from one to the other."""
    plan = plan_of(building.door_map, {0: building.floor})
    labels = flooded(building.free)
    room_of_cell = plan.levels[0].regions.label_at(*np.indices(labels.shape))
    walked = Counter(
        frozenset(plan.levels[0].room_of[np.unique(room_of_cell[labels == label])].tolist())
        for label in range(1, labels.max() + 1)
    )

    expected = sorted(sorted(room for room in group if room > 0) for group in walked)

    assert [group for group in expected if group] == sorted(map(sorted, _joined(plan.graph)))


@given(buildings())
def test_a_rooms_point_lies_in_it(building: Building) -> None:
    """And away from its walls: a robot may stand there."""
    plan = plan_of(building.door_map, {0: building.floor})

    for room in plan.graph.rooms.values():
        around = [(room.x + dx, room.y + dy) for dx in (-0.4, 0.4) for dy in (-0.4, 0.4)]
        assert {room.room_id} == {plan.room_at(0, *point) for point in around}


def test_a_door_has_one_room_to_its_left_and_one_to_its_right() -> None:
    """Looking along the line: turned round, it has them the other way."""
    plan = _plan(TWO_ROOMS, BETWEEN)
    turned = _plan(TWO_ROOMS, door_at(1, BETWEEN.end, BETWEEN.start))
    (doorway,), (other,) = plan.graph.doorways.values(), turned.graph.doorways.values()

    assert [1, 2] == list(plan.graph.rooms)
    assert (1, 2) == (doorway.left, doorway.right)
    assert (2, 1) == (other.left, other.right)
    assert 9.0 == pytest.approx(plan.graph.rooms[1].area_m2, abs=0.6)
    assert (1, 2, OUTSIDE, None) == tuple(
        plan.room_at(0, x, y) for x, y in [(3, 3), (8, 3), (-7, 3), (1.5, 1.5)]
    )


def test_most_probes_decide_which_room_lies_there() -> None:
    """A wall ends in the doorway: most of the door lies before the room behind it."""
    cells = np.full((60, 60), 100, np.int8)
    cells[2:28, 2:58] = 0
    cells[32:58, 2:13] = 0
    cells[32:58, 14:58] = 0
    cells[28:32, 10:20] = 0
    cells[29:32, 13] = 100

    graph = _plan(floor_of(cells), door_at(1, (1.0, 3.0), (2.0, 3.0))).graph

    assert [1, 2, 3] == list(graph.rooms)
    assert (3, 1) == (graph.doorways[DoorId(1)].left, graph.doorways[DoorId(1)].right)


def test_a_door_that_others_walk_around_is_a_loop() -> None:
    """The same room on both sides; and one that hangs in no wall is told apart."""
    free_standing = door_at(2, (8.0, 3.0), (8.0, 4.0))
    graph = _plan(TWO_ROOMS, BETWEEN, free_standing).graph

    assert (DoorId(2),) == graph.loops
    assert [True, False] == [doorway.in_wall for doorway in graph.doorways.values()]
    assert [(2,), (1,)] == [graph.neighbours(room) for room in graph.rooms]


def test_doors_over_one_another_join_the_same_rooms() -> None:
    """A door that was added twice, a little aside, is two doors of one doorway."""
    graph = _plan(TWO_ROOMS, BETWEEN, door_at(2, (5.6, 3.0), (5.6, 4.0))).graph

    assert [(1, 2), (1, 2)] == [(each.left, each.right) for each in graph.doorways.values()]
    assert (1, 2) == graph.doors_of(1)


@pytest.mark.parametrize("value", [0, -1, 100])
def test_a_plan_without_walls_or_without_floor_has_no_rooms(value: int) -> None:
    """All free, all unknown: all is outside. All wall: there is nothing."""
    graph = _plan(floor_of(np.full((60, 60), value, np.int8)), door_at(1, (2, 2), (3, 2))).graph
    side = None if value == 100 else OUTSIDE

    assert {} == graph.rooms
    assert (side, side) == (graph.doorways[DoorId(1)].left, graph.doorways[DoorId(1)].right)


@pytest.mark.parametrize("x", [-40.0, 1e12, -1e300])
def test_a_door_off_the_plan_joins_nothing(x: float) -> None:
    """However far away it is."""
    graph = _plan(TWO_ROOMS, replace(BETWEEN, x=x)).graph
    doorway = graph.doorways[DoorId(1)]

    assert (None, None, False, False) == (
        doorway.left, doorway.right, doorway.joins_two, doorway.is_loop,
    )  # fmt: skip


def test_what_lies_off_the_plan_is_outside() -> None:
    """A door in a wall at the plan's edge leads there."""
    cells = np.full((40, 40), 100, np.int8)
    cells[2:38, 2:38] = 0
    cells[10:20, 0:2] = 0

    doorway = _plan(floor_of(cells), door_at(1, (0.05, 1.0), (0.05, 2.0))).graph.doorways[DoorId(1)]

    assert (OUTSIDE, 1) == (doorway.left, doorway.right)


def test_a_shaft_is_no_room() -> None:
    """A region below a square metre."""
    cells = np.full((40, 60), 100, np.int8)
    cells[5:14, 5:14] = 0
    cells[5:16, 25:36] = 0

    graph = _plan(floor_of(cells)).graph

    assert [pytest.approx(1.21)] == [room.area_m2 for room in graph.rooms.values()]


def test_a_turned_plan_is_refused() -> None:
    """As a costmap refuses it."""
    turned = FloorMap(
        level=0, resolution=0.1, origin_x=0.0, origin_y=0.0, origin_theta=0.3,
        cells=np.zeros((50, 50), np.int8),
    )  # fmt: skip

    with pytest.raises(CostmapError, match="yaw 0"):
        _plan(turned)


# In a log


@pytest.fixture
def log(tmp_path: Path) -> sl.DoorLog:
    """Two levels with plans, one without; on the first a door comes, and goes elsewhere."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        for number, name in ((1, "ground"), (2, "first"), (3, "attic")):
            log.append([LevelAdded(level=number, name=name, happened_ns=SECOND)])
        for floor in (replace(TWO_ROOMS, level=1), replace(TWO_ROOMS, level=2)):
            log.append([replace(floor, happened_ns=SECOND)])
        door = log.add_door(x=5.5, y=3.0, theta=np.pi / 2, width=1.0, level=1, at="@100")
        log.add_door(x=5.5, y=3.0, theta=np.pi / 2, width=1.0, level=2, name="up", at="@100")
        log.add_door(x=5.5, y=3.0, theta=0.0, width=1.0, level=3, at="@100")
        log.add_door(name="unplaced", level=1, at="@100")
        log.observe(door, "open", at="@150")
        log.update_door(door, x=8.0, at="@200")
    return sl.read(tmp_path / "log")


def test_rooms_are_those_of_the_moment(log: sl.DoorLog) -> None:
    """Before the door came, while it was there, after it moved; its state does not count."""
    counts = {
        time: len([room for room in rooms_of(log, at=time).rooms.values() if room.level == 1])
        for time in ("@50", "@100", "@150", "@200")
    }

    assert {"@50": 1, "@100": 2, "@150": 2, "@200": 1} == counts
    assert rooms_of(log) == rooms_of(log, at="@300")


def test_rooms_are_numbered_over_the_levels(log: sl.DoorLog) -> None:
    """The same at each call; a level without a plan is named, a door without a place left out."""
    graph = rooms_of(log, at="@100")

    assert [(1, 1), (2, 1), (3, 2), (4, 2)] == [(r.room_id, r.level) for r in graph.rooms.values()]
    assert ((3,), [1, 2]) == (graph.levels_without_plan, list(graph.doorways))
    assert None is room_plan(log).room_at(3, 5.0, 3.0)


def test_lifts_join_the_rooms_before_their_doors() -> None:
    """Doors that say they are of the same lift, on two levels."""
    doors = [
        door_at(1, (5.5, 3.0), (5.5, 4.0), level=1, lift="a"),
        door_at(2, (5.5, 3.0), (5.5, 4.0), level=2, lift="a"),
        door_at(3, (5.5, 3.0), (5.5, 4.0), level=3),
    ]
    floors = {level: replace(TWO_ROOMS, level=level) for level in (1, 2, 3)}
    levels = {level: Level(level) for level in floors}

    graph = plan_of(DoorMap({door.door_id: door for door in doors}, levels), floors).graph

    assert [("a", (1, 2))] == [(lift.name, lift.doors) for lift in graph.lifts]
    assert ((2, 3, 4), (6,)) == (graph.neighbours(1), graph.neighbours(5))
    assert (graph.lifts[0], None) == (graph.lift_of(DoorId(2)), graph.lift_of(DoorId(3)))


# Real plans

TABLE = {
    "clinic": {1: (76, 74, 3, 2), 2: (56, 53, 2, 3)},
    "hotel": {1: (5, 5, 1, 0), 2: (7, 7, 0, 0), 3: (7, 7, 0, 0)},
    "office": {1: (3, 3, 1, 0)},
}
"""Level -> doors, those that join two, of these to the outside, loops."""


@pytest.mark.parametrize(
    "name", [pytest.param("clinic", marks=pytest.mark.slow), "hotel", "office"]
)
def test_the_doors_of_real_buildings(shared_data: Path, tmp_path: Path, name: str) -> None:
    """150 of 155 doors join two rooms, five are loops, none lacks a side."""
    log = _imported(shared_data, tmp_path, name)
    door_map = log.replay()
    graph = rooms_of(log)

    found = {}
    for level in door_map.levels:
        doorways = [
            each
            for each in graph.doorways.values()
            if each.level == level and "lift" not in door_map[each.door_id].annotations
        ]
        two = [each for each in doorways if each.joins_two]
        outside = [each for each in two if OUTSIDE in (each.left, each.right)]
        loops = [each for each in doorways if each.is_loop]
        found[level] = len(doorways), len(two), len(outside), len(loops)

    assert TABLE[name] == found
    assert all(doorway.in_wall for doorway in graph.doorways.values())


def _imported(shared_data: Path, tmp_path: Path, name: str) -> sl.DoorLog:
    path = shared_data / "maps" / f"rmf_{name}" / f"{name}.building.yaml"
    if not path.exists():
        pytest.skip(f"{path.name} is not among the real data")
    with sl.create(tmp_path / name, tz="UTC") as log:
        import_file(log, path)
    return sl.read(tmp_path / name)
