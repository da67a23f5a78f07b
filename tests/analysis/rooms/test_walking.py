"""How far a robot walks: against Dijkstra's algorithm on the floor, through doors, by lifts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given

import semmap_log as sl
from semmap_log.analysis.rooms import (
    Place,
    TravelTimes,
    WalkingDistances,
    door_ways,
    plan_of,
    room_plan,
)
from semmap_log.analysis.rooms.walking_floor import grown
from semmap_log.core.model.doors import DoorId, DoorMap, Level
from semmap_log.errors import CostmapError
from semmap_log.interop.importing.importing import import_file
from tests.analysis.rooms.buildings import CELL_M, Building, buildings, door_at, drawn, floor_of
from tests.analysis.rooms.grid_graph import shortest

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
"""Two rooms with a doorway between them at x 5..6, y 3..4."""
BETWEEN = door_at(1, (5.5, 3.0), (5.5, 4.0))
LEFT, RIGHT, YARD = (3.0, 2.6), (8.0, 4.2), (0.5, 0.5)


def _one(distances: WalkingDistances, start: object, end: object, **options: object) -> float:
    return float(distances.between([start], [end], **options)[0, 0])  # type: ignore[arg-type, list-item]


def test_a_way_through_a_door_is_there_while_it_is_not_shut() -> None:
    """Through its middle; shut, there is none, and the yard is never reached."""
    walking = WalkingDistances(TWO_ROOMS, [BETWEEN])
    straight = math.dist(LEFT, (5.5, 3.5)) + math.dist((5.5, 3.5), RIGHT)

    assert straight == pytest.approx(_one(walking, LEFT, RIGHT), rel=0.1)
    assert straight <= _one(walking, LEFT, RIGHT) + 0.2
    assert math.inf == _one(walking, LEFT, RIGHT, shut=[DoorId(1)])
    assert math.inf == _one(walking, LEFT, YARD)
    assert _one(walking, LEFT, RIGHT) == pytest.approx(_one(walking, RIGHT, LEFT))


def test_within_a_room_no_door_matters() -> None:
    """At most 8 % more than the straight line, at least that line."""
    walking = WalkingDistances(TWO_ROOMS, [BETWEEN])
    ends = [(2.5, 2.5), (4.5, 4.5), (4.4, 2.6), (2.4, 3.9)]

    found = walking.between(ends, ends, [DoorId(1)])

    for row, start in enumerate(ends):
        for column, end in enumerate(ends):
            line = math.dist(start, end)
            assert line - 1e-3 <= found[row, column] <= 1.083 * line + 0.45


@given(buildings())
def test_doors_open_the_way_is_that_of_dijkstra_on_the_open_floor(building: Building) -> None:
    """Within a few cells a door, which is passed through its middle; nowhere shorter by more."""
    walking = WalkingDistances(building.floor, building.doors, cell_m=CELL_M)
    plan = plan_of(building.door_map, {0: building.floor})
    points = [(room.x, room.y) for room in plan.graph.rooms.values()]
    free = ~grown(~building.free, 2.5)
    flats = np.array([int(y / CELL_M) * free.shape[1] + int(x / CELL_M) for x, y in points])

    found = walking.between(points, points)
    expected = shortest(free, flats)[:, flats] * CELL_M / 1000

    assert np.array_equal(np.isfinite(expected), np.isfinite(found))
    assert (found >= expected - 0.3 * len(points)).all()
    assert (found <= expected * 1.05 + 0.6 * len(points)).all()


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (12, 5), (5, 12)])
@pytest.mark.parametrize("by", [0.0, 1.0, 2.5, 7.0, 1e300, math.inf])
def test_walls_grow_as_far_as_a_circle_reaches(shape: tuple[int, int], by: float) -> None:
    """Also one that is larger than the floor: then no work is done outside."""
    walls = np.random.default_rng(len(shape) + int(min(by, 99))).random(shape) < 0.1
    rows, columns = np.nonzero(walls)

    found = grown(walls, by)

    at = np.indices(shape)
    away = np.hypot(at[0][..., None] - rows, at[1][..., None] - columns)
    assert np.array_equal((away <= by).any(axis=-1), found)
    assert not grown(np.zeros(shape, bool), by).any()


@given(buildings())
def test_with_all_doors_shut_a_robot_stays_in_its_room(building: Building) -> None:
    """And with one shut, it reaches what the room graph without that door joins."""
    walking = WalkingDistances(building.floor, building.doors)
    graph = plan_of(building.door_map, {0: building.floor}).graph
    points = [(room.x, room.y) for room in graph.rooms.values()]
    shut = [door.door_id for door in building.doors]

    alone = np.isfinite(walking.between(points, points, shut))
    assert np.array_equal(np.eye(len(points), dtype=bool), alone)

    for door_id in shut[:2]:
        some = np.isfinite(walking.between(points, points, [door_id]))
        doorway = graph.doorways[door_id]
        assert not some[doorway.left - 1, doorway.right - 1]  # type: ignore[operator]
        assert len(points) <= some.sum() < len(points) ** 2


def test_a_robot_stands_before_a_door_on_both_sides() -> None:
    """Left first; where the other side has no floor, nowhere."""
    walking = WalkingDistances(TWO_ROOMS, [BETWEEN, door_at(2, (1.5, 3.0), (1.5, 4.0))])
    left, right = walking.before(DoorId(1))
    _, inside = walking.before(DoorId(2))

    assert left is not None
    assert right is not None
    assert inside is not None
    assert left[0] < 5.5 < right[0]
    assert 0.3 > max(abs(left[1] - 3.5), abs(right[1] - 3.5))
    assert inside[0] > 2
    assert (None, None) == walking.before(DoorId(9))
    assert 0.3 < _one(walking, left, right) < 1.2


def test_a_point_near_a_wall_is_where_the_robot_can_stand_and_one_in_it_nowhere() -> None:
    """And never on the other side of a thin wall."""
    thin = TWO_ROOMS.cells.copy()
    thin[:, 50:60][thin[:, 50:60] == 100] = 0
    thin[20:50, 55] = 100
    walking = WalkingDistances(floor_of(thin), [])

    assert _one(walking, (5.4, 3.0), LEFT) < 3.2
    assert math.inf == _one(walking, (5.4, 3.0), RIGHT)
    assert math.inf == _one(walking, (5.55, 3.0), LEFT)
    assert math.inf == _one(walking, (1.5, 3.0), LEFT)
    assert math.inf == _one(walking, (-700.0, 3.0), LEFT)


def test_from_a_gap_too_narrow_to_stand_in_no_way_leads_through_its_wall() -> None:
    """Though the floor behind that wall is nearer than any other."""
    cells = np.full((60, 90), 100, np.int8)
    cells[2:58, 2:40] = 0
    cells[2:58, 50:54] = 0
    cells[2:58, 55:88] = 0
    walking = WalkingDistances(floor_of(cells), [])

    assert math.isfinite(_one(walking, (5.7, 3.0), (8.0, 3.0)))
    assert math.inf == _one(walking, (5.35, 3.0), (8.0, 3.0))


def test_a_narrow_door_is_passed_through_its_middle() -> None:
    """Though walls, grown by the robot's radius, leave no gap of it."""
    cells = TWO_ROOMS.cells.copy()
    cells[30:33, 50:60] = 100
    cells[37:40, 50:60] = 100
    walking = WalkingDistances(floor_of(cells), [door_at(1, (5.5, 3.3), (5.5, 3.7))])

    assert 5 < _one(walking, LEFT, RIGHT) < 6.5


def test_unknown_floor_is_not_walked_on() -> None:
    """A way leads around it, or there is none."""
    cells = TWO_ROOMS.cells.copy()
    cells[cells == 0] = -1
    cells[20:50, 20:50] = 0

    walking = WalkingDistances(floor_of(cells), [BETWEEN])

    assert math.inf == _one(walking, LEFT, RIGHT)
    assert math.isfinite(_one(walking, LEFT, (4.0, 3.0)))


@pytest.mark.parametrize("radius_m", [0.0, 0.6, 2.0])
def test_a_wide_robot_has_less_room(radius_m: float) -> None:
    """Of none at all, a point; one wider than the rooms stands nowhere."""
    walking = WalkingDistances(TWO_ROOMS, [BETWEEN], radius_m=radius_m)

    assert math.isinf(_one(walking, LEFT, RIGHT)) == (radius_m == 2.0)


@pytest.mark.parametrize(
    ("name", "value"), [("radius_m", -1.0), ("radius_m", math.nan), ("cell_m", 0.0)]
)
def test_numbers_that_no_robot_has_are_refused(name: str, value: float) -> None:
    """With the name of what was wrong."""
    with pytest.raises(CostmapError, match=name):
        WalkingDistances(TWO_ROOMS, [BETWEEN], **{name: value})


def test_too_fine_a_grid_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before it is made."""
    monkeypatch.setattr("semmap_log.analysis.rooms.walking_floor.MOST_CELLS", 5_000)

    WalkingDistances(TWO_ROOMS, [], cell_m=0.2)
    with pytest.raises(CostmapError, match=r"5,000 cells of 0\.1 m, got 120 x 70"):
        WalkingDistances(TWO_ROOMS, [], cell_m=0.1)


def test_what_is_not_kept_is_measured_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same distances, with room for one field or none, one or many at a time."""
    points = [LEFT, RIGHT, (2.5, 4.4)]
    expected = WalkingDistances(TWO_ROOMS, [BETWEEN]).between(points, points)

    monkeypatch.setattr(door_ways, "MOST_KEPT", 300)
    monkeypatch.setattr(door_ways, "MOST_TOGETHER", 1)
    walking = WalkingDistances(TWO_ROOMS, [BETWEEN])

    for _ in range(2):
        assert expected == pytest.approx(walking.between(points, points))


# The way itself


@given(buildings())
def test_a_way_is_as_long_as_it_is_said_to_be(building: Building) -> None:
    """From end to end, through the doors that are open, never through a wall."""
    walking = WalkingDistances(building.floor, building.doors, cell_m=CELL_M)
    plan = plan_of(building.door_map, {0: building.floor})
    points = [(room.x, room.y) for room in plan.graph.rooms.values()]
    shut = [building.doors[0].door_id] if building.doors else []

    for closed in ([], shut):
        lengths = walking.between(points[:1], points, closed)[0]
        for end, length in zip(points, lengths.tolist(), strict=True):
            way = walking.way(points[0], end, closed)
            assert (way is None) == math.isinf(length)
            if way is None:
                continue
            assert (points[0], end) == (way[0], way[-1])
            line = sum(math.dist(a, b) for a, b in pairwise(way))
            assert length - 0.15 * len(building.doors) - 0.01 <= line <= length + 0.01
            assert all(building.free[int(y / CELL_M), int(x / CELL_M)] for x, y in _along(way))


def _along(way: list[tuple[float, float]]) -> Iterator[tuple[float, float]]:
    """Yield points of a way, each tenth of a metre."""
    for (x0, y0), (x1, y1) in pairwise(way):
        for share in np.linspace(0, 1, 2 + int(math.dist((x0, y0), (x1, y1)) * 10)):
            yield x0 + share * (x1 - x0), y0 + share * (y1 - y0)


def test_a_way_over_levels_takes_the_lift() -> None:
    """Both ends of the ride are corners."""
    way = _building().way(Place(1, *LEFT), Place(2, *RIGHT))

    assert way is not None
    levels = [place.level for place in way]
    assert sorted(levels) == levels
    assert {1, 2} == set(levels)


# Over levels


def _building(*, lift: bool = True) -> TravelTimes:
    annotations = {"lift": "a"} if lift else {}
    doors = [
        door_at(1, (5.5, 3.0), (5.5, 4.0), level=1, **annotations),
        door_at(2, (5.5, 3.0), (5.5, 4.0), level=2, **annotations),
    ]
    floors = {level: replace(TWO_ROOMS, level=level) for level in (1, 2)}
    door_map = DoorMap({d.door_id: d for d in doors}, {n: Level(n) for n in floors})
    return TravelTimes.of_plan(plan_of(door_map, floors), speed_m_s=0.5, ride_s=30.0)


def test_a_lift_takes_a_robot_to_the_other_level() -> None:
    """The ways to its doors, and the ride; a shut door of it ends this."""
    times = _building()
    below, above = Place(1, *LEFT), Place(2, *RIGHT)
    walked_m = _one(WalkingDistances(TWO_ROOMS, [BETWEEN]), LEFT, RIGHT)

    assert 30 + walked_m / 0.5 == pytest.approx(times.between([below], [above])[0, 0], abs=1e-6)
    for door in (1, 2):
        assert math.inf == times.between([below], [above], [DoorId(door)])[0, 0]
    assert math.inf == _building(lift=False).between([below], [above])[0, 0]
    assert math.inf == times.between([Place(7, *LEFT)], [below])[0, 0]


# The real thing


@pytest.mark.slow
def test_all_doors_of_the_clinic_are_within_reach(shared_data: Path, tmp_path: Path) -> None:
    """Of each level, from both sides of each; as far as Dijkstra finds on the floor itself."""
    path = shared_data / "maps" / "rmf_clinic" / "clinic.building.yaml"
    with sl.create(tmp_path / "log", tz="UTC") as log:
        import_file(log, path)
    plan = room_plan(sl.read(tmp_path / "log"))
    for level, floor in plan.floors.items():
        doors = [door for door in plan.door_map.doors.values() if door.level == level]
        walking = WalkingDistances(floor, doors, cell_m=0.1)
        sides = [walking.before(door.door_id) for door in doors if "lift" not in door.annotations]
        points = [point for pair in sides for point in pair if point is not None]

        found = walking.between(points, points)

        assert 2 * len(sides) == len(points)
        assert np.isfinite(found).all()
        line = np.array([[math.dist(a, b) for b in points] for a in points])
        assert (found >= line - 0.01).all()
        assert np.allclose(found, found.T)
