"""What rooms are called: by what is told at their doors, a lift, or the doors' own names."""

from __future__ import annotations

from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.analysis.rooms import plan_of, rooms_of
from semmap_log.analysis.rooms.room_graph import stem
from semmap_log.core.model.doors import DoorMap, Level
from semmap_log.interop.importing.importing import import_file
from tests.analysis.rooms.buildings import door_at, drawn

THREE_ROOMS = drawn(
    """
................
.##############.
.#...#....#...#.
.#............#.
.#...#....#...#.
.##############.
................
""",
    scale=10,
)
"""Rooms 1, 2 and 3, from left to right, with doorways at x 5..6 and 10..11, y 3..4."""
WEST = ((5.5, 3.0), (5.5, 4.0))
EAST = ((10.5, 3.0), (10.5, 4.0))
SOUTH = ((8.0, 1.5), (9.0, 1.5))
"""In room 2's lower wall: it leads outside."""


def _names(*doors: sl.Door) -> list[str | None]:
    door_map = DoorMap({door.door_id: door for door in doors}, {0: Level(0)})
    return [room.name for room in plan_of(door_map, {0: THREE_ROOMS}).graph.rooms.values()]


CASES = {
    "the words of a door name its sides, before any name of a door": (
        [door_at(1, *WEST, name="a", rooms="lab,hall"),
         door_at(2, *EAST, name="b", rooms=" , store")],
        ["lab", "hall", "store"],
    ),
    "a person took left for right at both doors": (
        [door_at(1, *WEST, rooms="hall,lab"), door_at(2, *EAST, rooms="store,hall")],
        ["lab", "hall", "store"],
    ),
    "a person took left for right at one door": (
        [door_at(1, *WEST, rooms="hall,lab"), door_at(2, *EAST, rooms="hall,store")],
        ["lab", "hall", "store"],
    ),
    "most doors decide": (
        [door_at(1, *WEST, rooms=",hall"), door_at(2, *EAST, rooms="foyer,"),
         door_at(3, *SOUTH, rooms="foyer,")],
        ["hall", "foyer", None],
    ),
    "of as many doors the first": (
        [door_at(1, *WEST, rooms=",hall"), door_at(2, *EAST, rooms="foyer,")],
        [None, "hall", "foyer"],
    ),
    "a room with the doors of one lift is its cabin": (
        [door_at(1, *WEST), door_at(2, *EAST, name="lift_1_door", lift="lift_1")],
        [None, None, "lift_1"],
    ),
    "doors that differ in a last word": (
        [door_at(1, *WEST, name="office_outer"), door_at(2, *EAST, name="office_inner")],
        ["office", "office", "office"],
    ),
    "doors that differ in more": (
        [door_at(1, *WEST, name="office_outer"), door_at(2, *EAST, name="office_inner"),
         door_at(3, *SOUTH, name="yard")],
        ["office", None, "office"],
    ),
    "a door between two rooms without others": ([door_at(1, *WEST, name="lab")], [None, None]),
    "a door to the outside": ([door_at(1, *SOUTH, name="lab")], [None]),
    "a lift beside a room's only door": (
        [door_at(1, *WEST, name="hall"), door_at(2, *SOUTH, name="office"),
         door_at(3, *EAST, name="lift_1_door", lift="lift_1")],
        ["hall", None, "lift_1"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_rooms_are_named_by_their_doors(case: str) -> None:
    doors, names = CASES[case]
    assert names == _names(*doors)


@pytest.mark.parametrize("told", ["", "lab", ",", "lab,lab", "a,b,c"])
def test_what_names_no_two_sides_tells_nothing(told: str) -> None:
    """The doors' own names remain."""
    assert ["office", None, "store"] == _names(
        door_at(1, *WEST, name="office", rooms=told), door_at(2, *EAST, name="store")
    )


@pytest.mark.parametrize(
    ("name", "room"),
    [("lab", "lab"), ("lab_door", "lab"), ("Lab outer", "Lab"), ("door", None), ("L2_door5", None),
     ("Door 12", None), ("indoor", "indoor")],
)  # fmt: skip
def test_a_rooms_only_door_names_it(name: str, room: str | None) -> None:
    """A number is no name."""
    assert room == _names(door_at(1, *WEST, name=name), door_at(2, *EAST, name="other_door"))[0]


def test_the_stem_of_a_name() -> None:
    """One last word goes, and only one that says which door it is."""
    assert ["L1_rm_13", "L1_rm_13", "m", "rm_outer", "wc_1"] == [
        stem(name) for name in ("L1_rm_13_inner", "L1_rm_13_OUTER", "m", "rm_outer_door", "wc_1")
    ]


@pytest.mark.slow
def test_the_rooms_of_the_clinic_with_two_doors_have_names(
    shared_data: Path, tmp_path: Path
) -> None:
    """All 53 of them: 51 by their doors' names, two by a point in them."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        import_file(log, shared_data / "maps" / "rmf_clinic" / "clinic.building.yaml")
    graph = rooms_of(sl.read(tmp_path / "log"))

    names = [room.name for room in graph.rooms.values() if len(graph.doors_of(room.room_id)) == 2]

    assert (53, 53) == (len(names), len(set(names) - {None}))
