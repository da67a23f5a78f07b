"""Open-RMF buildings: doors in metres with y up, levels in order, floor plans."""

import math
from collections import Counter

import numpy as np
import pytest
import yaml

from semmap_log.core.model.doors import Level
from semmap_log.errors import FormatError
from semmap_log.interop.formats.files.building import read_building

# A room of 4 m x 3 m, a pixel being 0.05 m, with a door of 1 m in its lower (y = 40 px) wall.
VERTICES = """
    vertices:
      - [20, 40, 0, ""]
      - [100, 40, 0, ""]
      - [100, 100, 0, ""]
      - [20, 100, 0, ""]
      - [40, 40, 0, ""]
      - [60, 40, 0, ""]
"""
ROOM = (
    VERTICES
    + """
    measurements:
      - [0, 1, {distance: [3, 4.0]}]
    doors:
      - [4, 5, {name: [1, front], type: [1, double_sliding]}]
    walls:
      - [0, 4, {}]
      - [5, 1, {}]
      - [1, 2, {}]
      - [2, 3, {}]
      - [3, 0, {}]
    floors:
      - {parameters: {}, vertices: [0, 1, 2, 3]}
"""
)


def building(tmp_path, levels, head=""):
    path = tmp_path / "b.building.yaml"
    path.write_text(f"{head}\nname: b\nlevels:\n{levels}")
    return path


def test_a_door_starts_at_its_first_vertex_in_metres_with_y_up(tmp_path):
    """Pixels times the scale of the measurement, y negated; the kind is an annotation."""
    table = read_building(building(tmp_path, f"  L1:\n    elevation: 2.5\n{ROOM}"))

    (door,) = table.doors
    assert (2.0, -2.0, 0.0, 1.0) == pytest.approx((door.x, door.y, door.theta, door.width))
    assert {"name": "front", "kind": "double_sliding"} == door.annotations
    assert door.door_id is None
    assert door.state is None
    assert (Level(1, "L1", 2.5),) == table.levels


def test_the_scale_is_the_mean_of_the_measurements(tmp_path):
    """4 m / 80 px and 4.5 m / 60 px: 0.0625 m a pixel."""
    levels = "  L1:\n" + ROOM.replace(
        "{distance: [3, 4.0]}]", "{distance: [3, 4.0]}]\n      - [1, 2, {distance: [3, 4.5]}]"
    )

    (door,) = read_building(building(tmp_path, levels)).doors

    assert 20 * 0.0625 == pytest.approx(door.width)


def test_cartesian_metres_are_taken_as_they_are(tmp_path):
    """The other coordinate system of traffic_editor: y up already, no measurements needed."""
    levels = "  L1:\n" + ROOM.replace("[0, 1, {distance: [3, 4.0]}]", "[0, 1, {}]")

    (door,) = read_building(building(tmp_path, levels, "coordinate_system: cartesian_meters")).doors

    assert (40.0, 40.0, 20.0) == (door.x, door.y, door.width)


def test_levels_are_numbered_from_the_lowest_and_keep_their_numbers(tmp_path):
    """By elevation, then by name; asking for one of them does not renumber it."""
    levels = "".join(
        f"  {name}:\n    elevation: {elevation}\n{ROOM}"
        for name, elevation in (("top", 8), ("b", 0), ("a", 0))
    )
    path = building(tmp_path, levels)

    assert [(1, "a"), (2, "b"), (3, "top")] == [
        (level.level, level.name) for level in read_building(path).levels
    ]
    only = read_building(path, level="top")
    assert [3] == [level.level for level in only.levels]
    assert [3] == [door.level for door in only.doors]
    assert [3] == [plan.level for plan in only.floor_maps]


def test_the_floor_plan_has_walls_floors_and_a_way_through_the_door(tmp_path):
    """100 on a wall, 0 inside and in the doorway, -1 outside; row 0 is the lowest y."""
    (plan,) = read_building(building(tmp_path, f"  L1:\n{ROOM}")).floor_maps

    def cell(x, y):
        return plan.cells[
            int((y - plan.origin_y) / plan.resolution), int((x - plan.origin_x) / plan.resolution)
        ]

    assert 100 == cell(1.0, -3.5)
    assert 100 == cell(3.0, -5.0)
    assert 100 == cell(4.0, -2.0)
    assert 0 == cell(2.5, -2.0)
    assert 0 == cell(3.0, -3.5)
    assert -1 == cell(0.5, -3.5)
    assert -1 == cell(3.0, -1.5)
    assert float(np.float32(0.05)) == plan.resolution
    assert (0.0, -6.0) == pytest.approx((plan.origin_x, plan.origin_y), abs=0.06)


def test_a_door_across_a_wall_is_cut_out_of_it(tmp_path):
    """Some plans draw the wall through."""
    levels = "  L1:\n" + ROOM.replace("- [0, 4, {}]\n      - [5, 1, {}]", "- [0, 1, {}]")

    (plan,) = read_building(building(tmp_path, levels)).floor_maps

    row = plan.cells[int((-2.0 - plan.origin_y) / plan.resolution)]
    start = int((2.5 - plan.origin_x) / plan.resolution)
    assert {0} == set(row[start - 5 : start + 5].tolist())


def test_a_level_without_walls_has_no_plan(tmp_path):
    """And one without anything needs no measurements."""
    table = read_building(building(tmp_path, f"  L1:\n{VERTICES}\n    walls: []\n    doors: {{}}"))

    assert ((), ()) == (table.doors, table.floor_maps)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[4, 5, {name: [1, front]", "[4, 9, {name: [1, front]",
         r"\.yaml:\d+: one of the doors: expected one of the 6 vertices of level 'L1', .* got 9"),
        ("[4, 5, {name: [1, front]", "[4, x, {name: [1, front]", "a whole number, got 'x'"),
        ("[4, 5, {name: [1, front]", "[4, 4, {name: [1, front]", "expected two different ends"),
        ("[4, 5, {name: [1, front], type: [1, double_sliding]}]", "[4]", "two vertices, got fewer"),
        ('- [20, 40, 0, ""]', "- [20, .nan, 0]", "expected a finite number, got .nan"),
        ('- [20, 100, 0, ""]', "- [20, 1e300, 0]", "within 100 km of the zero point"),
        ('- [20, 40, 0, ""]', "- [20]", r"expected a vertex \[x, y, …\]"),
        ("[0, 1, {distance: [3, 4.0]}]", "[0, 1, {distance: [3, 0]}]", "a distance above 0"),
        ("[0, 1, {distance: [3, 4.0]}]", "[0, 1, {}]", "expected a distance, got none"),
        ("    measurements:\n      - [0, 1, {distance: [3, 4.0]}]", "    measurements: []",
         "level 'L1': expected a measurement, which gives the metres of a pixel"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_with_its_line(tmp_path, old, new, message):
    """One mistake each, in the room above."""
    assert old in ROOM

    with pytest.raises(FormatError, match=message):
        read_building(building(tmp_path, "  L1:\n" + ROOM.replace(old, new)))


def test_a_door_twice_names_both_lines(tmp_path):
    """Twice means the same level and the same name."""
    door = "- [4, 5, {name: [1, front], type: [1, double_sliding]}]"
    levels = "  L1:\n" + ROOM.replace(door, f"{door}\n      {door}")

    with pytest.raises(FormatError, match=r"'L1' twice: first on line 17"):
        read_building(building(tmp_path, levels))


@pytest.mark.parametrize(
    "name", ['name: [1, "null"]', "name: [1, null]", "name: [1, '']", "name: [1, ' ']", "locked: 1"]
)
def test_doors_without_a_name_are_doors(tmp_path, name):
    """However an editor writes that: both come in, and a word says so."""
    door = f"- [4, 5, {{{name}}}]"
    levels = "  L1:\n" + ROOM.replace(
        "- [4, 5, {name: [1, front], type: [1, double_sliding]}]",
        f"{door}\n      {door}\n      - [0, 1, {{name: [1, ' gate ']}}]",
    )

    table = read_building(building(tmp_path, levels))

    assert [None, None, "gate"] == [door.annotations.get("name") for door in table.doors]
    (warning,) = table.warnings
    assert warning.startswith("doors without a name: 2; added under ids")


def test_a_name_may_come_again_on_another_level(tmp_path):
    """Hotels do that."""
    table = read_building(building(tmp_path, f"  L1:\n{ROOM}\n  L2:\n{ROOM}"))

    assert [(1, "front"), (2, "front")] == [
        (door.level, door.annotations["name"]) for door in table.doors
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("coordinate_system: wgs84\nlevels: {}",
         "expected reference_image or cartesian_meters, got 'wgs84'"),
        ("1: {position: {x: 0}}", "expected an Open-RMF building, which has the key levels"),
        ("- a", "a building: expected keys and values, got a list"),
        ("levels: [L1]", "levels: expected keys and values"),
        ("levels: {L1: 7}", "level 'L1': expected keys and values, got '7'"),
        ("levels: {L1: {doors: 7}}", "doors: expected a list, got '7'"),
        ("", "a building: expected keys and values, got nothing"),
    ],
)  # fmt: skip
def test_what_is_no_building_is_said(tmp_path, text, message):
    """Another YAML file given by mistake."""
    path = tmp_path / "b.building.yaml"
    path.write_text(text)

    with pytest.raises(FormatError, match=message):
        read_building(path)


def test_a_level_that_does_not_exist_names_those_that_do(tmp_path):
    """So that the next try is right."""
    path = building(tmp_path, f"  L1:\n{ROOM}\n  L2:\n{ROOM}")

    with pytest.raises(FormatError, match="levels L1, L2; got 'L3'"):
        read_building(path, level="L3")


def test_a_plan_too_large_is_refused(tmp_path):
    """Half a kilometre by half a kilometre at a millimetre a cell."""
    levels = "  L1:\n" + ROOM.replace("[20, 40, 0", "[20000, 40000, 0")

    with pytest.raises(FormatError, match="100,000,000 cells"):
        read_building(building(tmp_path, levels), resolution=0.0001)


def test_doors_of_the_hotel_lie_where_open_rmf_has_them(shared_data):
    """Both ends of each door, on all levels: as in the nav graph that Open-RMF made of it."""
    folder = shared_data / "maps" / "rmf_hotel"
    table = read_building(folder / "hotel.building.yaml", lifts=False)
    graph = yaml.safe_load((folder / "nav_graph.yaml").read_text())
    names = {level.level: level.name for level in table.levels}

    ends = {
        door.annotations["name"]: {
            "endpoints": [
                [door.x, door.y],
                [
                    door.x + door.width * math.cos(door.theta),
                    door.y + door.width * math.sin(door.theta),
                ],
            ],
            "map": names[door.level],
        }
        for door in table.doors
    }

    assert {"L1", "L2", "L3"} == {door["map"] for door in ends.values()}
    assert ends.keys() == graph["doors"].keys()
    for name, door in graph["doors"].items():
        assert door["map"] == ends[name]["map"]
        assert np.allclose(door["endpoints"], ends[name]["endpoints"], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "doors", "levels", "lifts", "widths_m"),
    [
        ("office", {"L1": 3}, [("L1", 0)], 0, (0.88, 1.90)),
        ("hotel", {"L1": 7, "L2": 9, "L3": 9}, [("L1", 0), ("L2", 8), ("L3", 16)], 2, (1.28, 3.63)),
        ("clinic", {"L1": 80, "L2": 60}, [("L1", 0), ("L2", 10)], 4, (0.91, 3.52)),
    ],
)
def test_the_buildings_of_open_rmf(  # noqa: PLR0917 - a row of the table above
    shared_data, name, doors, levels, lifts, widths_m
):
    """Every door of the three, and their lifts', its way free in the plan."""
    table = read_building(shared_data / "maps" / f"rmf_{name}" / f"{name}.building.yaml")

    names = {level.level: level.name for level in table.levels}
    assert doors == Counter(names[door.level] for door in table.doors)
    assert levels == [(level.name, level.elevation) for level in table.levels]
    assert ((), ()) == (table.left_out, table.warnings)
    assert lifts == len({door.annotations.get("lift") for door in table.doors} - {None})
    assert all(widths_m[0] <= door.width <= widths_m[1] for door in table.doors)
    plans = {plan.level: plan for plan in table.floor_maps}
    assert sorted(names) == sorted(plans)
    for door in table.doors:
        plan = plans[door.level]
        x = door.x + door.width / 2 * math.cos(door.theta)
        y = door.y + door.width / 2 * math.sin(door.theta)
        column, row = ((x - plan.origin_x) / plan.resolution, (y - plan.origin_y) / plan.resolution)
        assert 0 == plan.cells[int(row), int(column)]
