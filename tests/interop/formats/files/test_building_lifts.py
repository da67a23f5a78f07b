"""Lifts of Open-RMF buildings: their doors on each level, where the cabin is."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from semmap_log.errors import FormatError
from semmap_log.interop.formats.files.building import read_building
from semmap_log.interop.formats.files.door_table import DoorTable, TableDoor

LEVEL = """
    vertices:
      - [0, 0, 0, ""]
      - [100, 0, 0, ""]
      - [100, 100, 0, "lobby", {is_parking_spot: [4, true]}]
      - [0, 100, 0, "charger_1", {is_charger: [4, true]}]
      - [50, 50, 0, "desk", {is_charger: [4, false], spawn_robot_name: [1, ""]}]
    measurements:
      - [0, 1, {distance: [3, 10.0]}]
    walls:
      - [0, 1, {}]
      - [1, 2, {}]
"""
TWICE = LEVEL.replace("10.0", "5.0").replace("[100, ", "[200, ")
"""Another drawing, in which a metre has four times the pixels."""
SHIFTED = "    fiducials: [[200, 0, a], [600, 0, b], [200, 400, 3]]\n"
TURNED = "    fiducials: [[0, 0, a], [0, -100, b], [100, 0, 3]]\n"
"""A quarter of a turn, against the clock."""
HERE = "    fiducials: [[0, 0, a], [100, 0, b], [0, 100, 3], [7, 7, other]]\n"
LIFT = """
lifts:
  lift_1:
    x: 40
    y: 20
    yaw: 1.5707963267948966
    width: 2
    depth: 3
    reference_floor_name: L1
    doors:
      lift_1_front: {x: 0.5, y: 1.5, width: 1.2, motion_axis_orientation: 0, door_type: 2}
      side: {x: -1, y: 0, width: 0.8, motion_axis_orientation: 1.5707963267948966}
    level_doors: {L1: [lift_1_front], L2: [side, lift_1_front]}
"""


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., DoorTable]:
    def read(text: str, *, upper: str = LEVEL + HERE, head: str = "", **options: Any) -> DoorTable:
        path = tmp_path / "b.building.yaml"
        path.write_text(
            f"{head}\nlevels:\n  L1:\n    elevation: 0\n{LEVEL}{HERE}"
            f"  L2:\n    elevation: 4\n{upper}{text}"
        )
        return read_building(path, **options)

    return read


def _ends(door: TableDoor) -> tuple[float, ...]:
    end = door.x + door.width * math.cos(door.theta), door.y + door.width * math.sin(door.theta)
    return (door.x, door.y, *end)


def test_a_lifts_door_is_a_door_of_each_level_that_it_serves(
    read: Callable[..., DoorTable],
) -> None:
    """In metres from the cabin's middle, turned with it; named for its lift, and of its kind."""
    table = read(LIFT)

    assert [(1, "lift_1_front"), (2, "lift_1_side"), (2, "lift_1_front")] == [
        (door.level, door.annotations["name"]) for door in table.doors
    ]
    assert {"lift_1"} == {door.annotations["lift"] for door in table.doors}
    assert ["double_sliding", None, "double_sliding"] == [
        door.annotations.get("kind") for door in table.doors
    ]
    # The cabin's middle is (4, -2); turned by a quarter, its front is to the left.
    assert (2.5, -2.1, 2.5, -0.9) == pytest.approx(_ends(table.doors[0]))
    assert (4.4, -3.0, 3.6, -3.0) == pytest.approx(_ends(table.doors[1]))
    assert ((), ()) == (table.left_out, table.warnings)


@pytest.mark.parametrize(
    "upper",
    [
        pytest.param(TWICE + SHIFTED, id="another scale, shifted"),
        pytest.param(LEVEL + TURNED, id="turned by a quarter"),
        pytest.param(LEVEL, id="without fiducials"),
    ],
)
def test_a_lift_stands_at_one_place_on_all_levels(
    read: Callable[..., DoorTable], upper: str
) -> None:
    """As in Open-RMF: however another level is drawn."""
    first, _, other = read(LIFT, upper=upper).doors

    assert _ends(first) == _ends(other)


def test_metres_need_no_fiducials(read: Callable[..., DoorTable]) -> None:
    """In cartesian metres all levels have one frame, y up."""
    table = read(LIFT, upper=LEVEL, head="coordinate_system: cartesian_meters")

    assert ((), (38.5, 19.9)) == (
        table.warnings, pytest.approx((table.doors[0].x, table.doors[0].y)),
    )  # fmt: skip


def test_the_reference_level_is_the_buildings_first_unless_told(
    read: Callable[..., DoorTable],
) -> None:
    """First in the file, as traffic_editor has it."""
    lift = LIFT.replace("    reference_floor_name: L1\n", "\n")
    told = read(lift, upper=TWICE + SHIFTED, head="reference_level_name: L2")

    assert read(LIFT).doors == read(lift).doors
    # 40, 20 px of L2 are (1, -0.5).
    assert (-0.5, -0.6) == pytest.approx((told.doors[2].x, told.doors[2].y))


def test_only_the_level_that_is_asked_for(read: Callable[..., DoorTable]) -> None:
    """Its plan, too, is cut for the lift's doors; the other level tells where the lift is."""
    table = read(LIFT, level="L2")

    assert [2, 2] == [door.level for door in table.doors]
    assert read(LIFT).doors[1:] == table.doors
    assert [2] == [plan.level for plan in table.floor_maps]


def test_lifts_can_be_left_out(read: Callable[..., DoorTable]) -> None:
    """As if the building had none."""
    without, none = read(LIFT, lifts=False), read("")

    assert ((), none.floor_maps) == (without.doors, without.floor_maps)


def test_a_doorway_is_cut_for_a_lift(read: Callable[..., DoorTable]) -> None:
    """Where a wall is drawn through."""
    lift = LIFT.replace(
        "x: 40\n    y: 20\n    yaw: 1.5707963267948966", "x: 40\n    y: 15\n    yaw: 0"
    )
    plan = read(lift).floor_maps[0]
    row, column = (0.0 - plan.origin_y) / plan.resolution, (4.5 - plan.origin_x) / plan.resolution

    assert 0 == plan.cells[int(row), int(column)]
    assert 100 == plan.cells[int(row), int(column) + 30]


def test_a_name_that_is_taken_is_counted_on(read: Callable[..., DoorTable]) -> None:
    """A door of the level, or of another lift, bears it."""
    door = "    doors:\n      - [0, 1, {name: [1, lift_1_front]}]\n"
    table = read(LIFT, upper=LEVEL + HERE + door)

    assert ["lift_1_front", "lift_1_side", "lift_1_front_2"] == [
        each.annotations["name"] for each in table.doors if "lift" in each.annotations
    ]


@pytest.mark.parametrize("lifts", ["", "lifts: {}", "lifts:"])
def test_a_building_without_lifts(read: Callable[..., DoorTable], lifts: str) -> None:
    """However traffic_editor writes it."""
    assert ((), ()) == (read(lifts).doors, read(lifts).left_out)


def test_a_lift_that_serves_no_level_is_left_out(read: Callable[..., DoorTable]) -> None:
    """And named."""
    lift = LIFT.replace("{L1: [lift_1_front], L2: [side, lift_1_front]}", "{}")

    assert ("lift lift_1: it serves no level by a door",) == read(lift).left_out


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("x: 40", "x: here", "lift 'lift_1': x: expected a number, got 'here'"),
        ("    x: 40\n", "", "lift 'lift_1': expected the key x, got none"),
        ("x: 40", "x: 1e9", "expected lift 'lift_1' within 100 km"),
        ("width: 1.2", "width: 0", "door 'lift_1_front': width: expected metres above 0, got '0'"),
        ("width: 1.2", "width: wide", "door 'lift_1_front': width: expected a number"),
        ("L2: [side", "L9: [side", "level_doors: expected one of the levels L1, L2; got 'L9'"),
        ("L2: [side", "L2: [back", "expected one of the doors lift_1_front, side; got 'back'"),
        ("L1: [lift_1_front]", "L1: 7", "level_doors: expected a list, got '7'"),
        ("name: L1", "name: L9", "reference_floor_name: expected one of the levels L1, L2; got"),
        ("lift_1:\n", "lift_1: 7\n  b:\n", "lift 'lift_1': expected keys and values, got '7'"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_lift_is_told_with_its_line(
    read: Callable[..., DoorTable], old: str, new: str, message: str
) -> None:
    """One mistake each."""
    assert old in LIFT

    with pytest.raises(FormatError, match=rf"\.yaml:\d+: .*{message}"):
        read(LIFT.replace(old, new, 1))


@pytest.mark.parametrize("fiducials", ["[[0, 0]]", "[[0, x, a]]", "7"])
def test_a_wrong_fiducial_is_told(read: Callable[..., DoorTable], fiducials: str) -> None:
    """Where a lift needs them."""
    with pytest.raises(FormatError, match="fiducial"):
        read(LIFT, upper=f"{LEVEL}    fiducials: {fiducials}\n")


def test_named_vertices_are_places_but_for_those_of_robots(read: Callable[..., DoorTable]) -> None:
    """A charger's name is no room's."""
    assert [("lobby", 1, 10.0, -10.0), ("desk", 1, 5.0, -5.0)] == [
        (place.name, place.level, place.x, pytest.approx(place.y))
        for place in read("", level="L1").places
    ]
