"""A building's named points become names of rooms, told at the rooms' doors."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.analysis.rooms import rooms_of
from semmap_log.interop.formats.files.door_table import DoorTable, TableDoor, TablePlace
from semmap_log.interop.importing.as_recorded import with_room_names
from semmap_log.interop.importing.importing import import_file
from tests.analysis.rooms.buildings import drawn

FLOOR = drawn(
    """
............
.##########.
.#...#....#.
.#........#.
.#...#....#.
.##########.
............
""",
    level=1,
    scale=10,
)
"""A room of 3 x 3 m, a doorway at x 5..6, y 3..4, and a room of 4 x 3 m."""
BETWEEN = TableDoor(1, None, 1, 5.5, 3.0, math.pi / 2, 1.0, annotations={"name": "d"})
OTHER_LEVEL = replace(BETWEEN, level=2)
LAB, DESK = TablePlace("lab", 1, 3.0, 3.0), TablePlace("desk", 1, 8.0, 4.0)


def _table(*places: TablePlace, floor_maps: int = 1) -> DoorTable:
    return DoorTable(
        Path("b.building.yaml"), (BETWEEN, OTHER_LEVEL), floor_maps=(FLOOR,) * floor_maps,
        places=places,
    )  # fmt: skip


def test_a_doors_sides_are_called_as_the_points_in_their_rooms() -> None:
    """Left and right of its line; doors of other levels are as they were."""
    named = with_room_names(_table(LAB, DESK))

    assert {"name": "d", "rooms": "lab,desk"} == named.doors[0].annotations
    assert (OTHER_LEVEL, ()) == (named.doors[1], named.left_out)


@pytest.mark.parametrize(
    ("places", "left_out"),
    [
        ([LAB, replace(LAB, name="bench")], 2),
        ([replace(LAB, x=0.2)], 1),
        ([replace(LAB, x=1.5)], 1),
        ([replace(LAB, x=-90.0)], 1),
        ([replace(LAB, level=7)], 1),
        ([replace(LAB, name="lab, big")], 1),
    ],
    ids=["two names", "outside", "in a wall", "off the plan", "a level without a plan", "a comma"],
)
def test_points_that_name_no_room_are_said(places: list[TablePlace], left_out: int) -> None:
    """How many of them; the doors are told nothing."""
    named = with_room_names(_table(*places))

    assert [BETWEEN, OTHER_LEVEL] == list(named.doors)
    (said,) = named.left_out
    assert said.startswith(f"{left_out} named point")


def test_points_of_one_name_in_a_room_are_one() -> None:
    """A waiting area may have several."""
    named = with_room_names(_table(LAB, replace(LAB, x=4.0)))

    assert "lab," == named.doors[0].annotations["rooms"]


def test_without_a_plan_nothing_is_named() -> None:
    """Nor is anything wrong."""
    assert [BETWEEN, OTHER_LEVEL] == list(with_room_names(_table(LAB, floor_maps=0)).doors)


@pytest.mark.slow
def test_the_rooms_of_a_real_building_have_their_names(shared_data: Path, tmp_path: Path) -> None:
    """From points, from lifts, from doors."""
    path = shared_data / "maps" / "rmf_hotel" / "hotel.building.yaml"
    with sl.create(tmp_path / "log", tz="UTC") as log:
        import_file(log, path)

    names = [room.name for room in rooms_of(sl.read(tmp_path / "log")).rooms.values()]

    assert {
        "lobby", "shop", "restaurant", "kitchen", "L2_master_suite", "L3_master_suite",
        "Lift1", "Lift2", None,
    } == set(names)  # fmt: skip
