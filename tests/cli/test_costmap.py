"""`costmap` as a person types it: the files, what it says of them, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

import semmap_log as sl
from semmap_log.core.model.events import FloorMap, LevelAdded
from semmap_log.interop.formats.files.map_server import read_map
from tests.golden_text import GoldenText
from tests.verbs import Refuses, Verb

FREE, INSCRIBED, LETHAL, UNKNOWN = 0, 253, 254, 255
EIGHT_NS = 1_772_352_000 * 10**9
"""1 March 2026, 08:00 UTC."""
FLOOR = np.zeros((30, 40), np.int8)
FLOOR[10] = 100  # a wall along y = 1.0..1.1 m
FLOOR[25:] = -1


def floor(level: int = 0, **values: float) -> FloorMap:
    """Return a floor plan that was there before the doors."""
    placed = {"resolution": float(np.float32(0.1)), "origin_x": 0.0, "origin_y": 0.0, **values}
    return FloorMap(level=level, cells=FLOOR, happened_ns=EIGHT_NS, **placed)


@pytest.fixture
def run(run_verb: Verb, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Verb:
    """Run a verb beside a log `office`: a floor with a wall, and doors of all sorts in it."""
    monkeypatch.chdir(tmp_path)
    at = "2026-03-01T08:00"
    wall = {"y": 1.05, "theta": 0.0, "width": 0.5, "at": at}
    with sl.create("office", tz="UTC") as log:
        log.append([floor()])
        front = log.add_door(x=0.55, name="front", state="closed", **wall)
        log.add_door(x=1.55, name="back", state="open", prob_open=0.75, **wall)
        log.add_door(x=2.55, name="side", state="unknown", **wall)
        log.add_door(name="button", at=at)
        log.add_door(x=90.0, name="shed", state="closed", **wall)
        log.observe(front, "open", at="2026-03-01T09:00")
    with sl.create("nothing", tz="UTC"):
        pass

    return run_verb


def row_of_wall(name: str) -> list[int]:
    """The wall's cells: of each door the second, then one of the wall itself."""
    costs = np.load(name)
    return [int(costs[10, x]) for x in (6, 16, 26, 36)]


def test_costs_at_a_moment(run: Verb) -> None:
    """A closed door is lethal, an open one cuts through the wall, an unknown one shows the wall."""
    before = run("costmap", "office", "before.npy", "--at", "2026-03-01T08:30")
    after = run("costmap", "office", "after.npy")

    assert (0, 0) == (before[0], after[0])
    assert [LETHAL, FREE, LETHAL, LETHAL] == row_of_wall("before.npy")
    assert [FREE, FREE, LETHAL, LETHAL] == row_of_wall("after.npy")
    costs = np.load("after.npy")
    assert ((30, 40), np.uint8) == (costs.shape, costs.dtype)
    assert [FREE, UNKNOWN] == [costs[0, 0], costs[29, 0]]  # the first row is the lowest y


def test_it_says_what_it_drew_and_what_not(run: Verb, golden: GoldenText) -> None:
    """To people on stderr, nothing on stdout; --json has every door."""
    code, out, err = run("costmap", "office", "now.npy")

    assert (0, "") == (code, out)
    golden("costmap", "what was drawn", err)


def test_the_same_as_json(run: Verb) -> None:
    """One document: files, moment, grid, doors with their costs, and why others are left out."""
    code, out, err = run("costmap", "office", "now.yaml", "--at", "2026-03-01T08:30", "--json")

    said = json.loads(out)
    assert (0, "") == (code, err)
    assert ["now.yaml", "now.pgm"] == said["files"]
    assert ("master", "2026-03-01T08:30:00.000000000Z") == (said["layer"], said["at"])
    assert (40, 30, True) == (said["width"], said["height"], said["has_floor"])
    assert [("front", "CLOSED", 254), ("back", "OPEN", 0), ("side", "UNKNOWN", 255)] == [
        (door["name"], door["state"], door["cost"]) for door in said["doors"]
    ]
    assert [("button", "without a place"), ("shed", "off the map")] == [
        (door["name"], door["why"]) for door in said["left_out"]
    ]


@pytest.mark.parametrize("rules", ["noetic", "nav2", "nav2_humble"])
@pytest.mark.parametrize("out", ["now.yaml", "now.pgm"])
def test_a_ros_map_reads_back_to_the_same_cells(run: Verb, out: str, rules: str) -> None:
    """Both files, whichever is named; every server sees walls, doors, and the costs around them."""
    code, *_ = run("costmap", "office", out, "--inflate", 0.4, "--inscribed", 0.15)
    run("costmap", "office", "now.npy", "--inflate", 0.4, "--inscribed", 0.15)

    read = read_map(Path("now.yaml"), rules=rules)
    costs = np.load("now.npy")
    assert 0 == code
    assert (floor().resolution, 0.0, 0.0) == (read.resolution, read.origin_x, read.origin_y)
    for cost, value in ((FREE, 0), (INSCRIBED, 99), (LETHAL, 100), (UNKNOWN, -1)):
        assert ((costs == cost) == (read.cells == value)).all()
        assert (costs == cost).any()
    assert ((costs > FREE) & (costs < INSCRIBED)).any()


def test_doors_may_be_given_more_room_than_walls(run: Verb) -> None:
    """Around a closed door costs reach further; around the wall no further than before."""
    options = ("--at", "2026-03-01T08:30", "--scaling", 1)
    run("costmap", "office", "walls.npy", *options, "--inflate", 0.2)
    run("costmap", "office", "doors.npy", *options, "--inflate", 0.2, "--door-inflate", 0.6)

    walls, doors = np.load("walls.npy"), np.load("doors.npy")
    front, wall = 7, 36
    assert [FREE, FREE] == [walls[15, front], walls[15, wall]]
    assert FREE < doors[15, front] < INSCRIBED
    assert FREE == doors[15, wall]


def test_the_door_layer_has_no_floor_in_it(run: Verb) -> None:
    """Only doors: what they do not draw is unknown, and so is a door of unknown state."""
    code, *_ = run("costmap", "office", "doors.npy", "--layer", "door")

    assert 0 == code
    assert [FREE, FREE, UNKNOWN, UNKNOWN] == row_of_wall("doors.npy")
    assert 12 == (np.load("doors.npy") != UNKNOWN).sum()


def test_by_belief_a_door_costs_and_does_not_block(run: Verb) -> None:
    """P(open) of 0.75 is a quarter of the dearest cost that a path may cross."""
    code, *_ = run("costmap", "office", "belief.npy", "--by", "belief")

    assert 0 == code
    assert [FREE, 63, LETHAL, LETHAL] == row_of_wall("belief.npy")


def test_a_keepout_mask_holds_closed_doors_only(run: Verb) -> None:
    """100 at the closed door, nothing said of all else: not of walls, not of open doors."""
    code, *_ = run("costmap", "office", "mask.yaml", "--keepout", "--at", "2026-03-01T08:30")

    mask = read_map(Path("mask.yaml"))
    assert 0 == code
    assert [(10, x) for x in range(5, 11)] == list(zip(*np.nonzero(mask.cells == 100), strict=True))
    assert {-1, 100} == set(np.unique(mask.cells).tolist())


def test_a_picture_for_people(run: Verb) -> None:
    """A PNG that shows the map larger than its cells, and is not of one colour."""
    code, *_ = run("costmap", "office", "now.png", "--inflate", 0.3)

    assert 0 == code
    with Image.open("now.png") as picture:
        assert "PNG" == picture.format
        assert min(picture.size) > 400
        assert len(picture.convert("RGB").getcolors(2**24) or ()) > 10


def test_a_level_by_number_or_name(run: Verb) -> None:
    """Of several levels one must be named; the doors of the others are left out."""
    with sl.append("office") as log:
        log.append([LevelAdded(level=1, name="attic"), floor(1)])
        log.add_door(x=0.55, y=1.05, theta=0.0, width=0.5, level=1, state="closed", name="hatch")

    unnamed = run("costmap", "office", "now.npy")
    by_number, by_name = (
        run("costmap", "office", f"{level}.npy", "--level", level) for level in ("1", "attic")
    )

    assert 1 == unnamed[0]
    assert "several levels" in unnamed[2]
    assert (0, 0) == (by_number[0], by_name[0])
    assert "left out: 4 doors on level 0: front, back, side, …" in by_name[2]
    assert (np.load("1.npy") == np.load("attic.npy")).all()
    assert [LETHAL] * 4 == row_of_wall("1.npy")


def test_another_map_than_the_log_s(run: Verb) -> None:
    """--map gives the floor, read as the server that is named reads it."""
    Image.fromarray(np.full((20, 20), 254, np.uint8)).save("hall.pgm")
    Path("hall.yaml").write_text(
        "image: hall.pgm\nresolution: 0.1\norigin: [0.0, 0.0, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )

    code, _, err = run(
        "costmap", "office", "hall.npy", "--map", "hall.yaml", "--map-rules", "noetic"
    )

    assert 0 == code
    assert "left out: 2 doors off the map: side, shed" in err
    assert (20, 20) == np.load("hall.npy").shape
    assert {FREE} == set(np.unique(np.load("hall.npy")).tolist())


def test_without_a_floor_the_grid_lies_around_the_doors(run: Verb) -> None:
    """That is said; what no door draws is unknown; cells are as large as asked for."""
    with sl.create("bare", tz="UTC") as log:
        log.add_door(x=2.0, y=3.0, theta=0.0, width=1.0, state="closed")

    code, _, err = run("costmap", "bare", "bare.npy", "--resolution", 0.25)

    costs = np.load("bare.npy")
    assert 0 == code
    assert "no floor map then: the grid lies around the doors" in err
    assert [LETHAL, UNKNOWN] == np.unique(costs).tolist()
    assert 5 == (costs == LETHAL).sum()
    assert "cells of 0.25 m, 1 door (1 closed)." in err


def test_a_floor_without_doors_is_a_costmap_too(run: Verb) -> None:
    """Nothing to draw in it: the walls alone."""
    with sl.append("nothing") as log:
        log.append([floor()])

    code, _, err = run("costmap", "nothing", "walls.npy")

    assert 0 == code
    assert "40 x 30 cells of 0.1 m, 0 doors." in err
    assert [LETHAL] * 4 == row_of_wall("walls.npy")


def test_export_makes_the_same_map(run: Verb) -> None:
    """`export LOG x.pgm` is `costmap LOG x.pgm`."""
    run("costmap", "office", "a.pgm", "--at", "2026-03-01T08:30")
    code, _, err = run("export", "office", "b.pgm", "--at", "2026-03-01T08:30")

    assert 0 == code
    assert Path("a.pgm").read_bytes() == Path("b.pgm").read_bytes()
    assert "left out: shed: off the map" in err
    assert Path("b.yaml").exists()


def test_what_cannot_be_is_said(run: Verb, refuses: Refuses) -> None:
    """One line, exit 1 or 2, and no file."""
    before = sorted(Path().rglob("*"))

    refuses("""
        costmap office now.tif
        costmap office mask.png --keepout
        costmap office mask.yaml --keepout --layer master
        costmap office now.npy --map none.yaml
        costmap office now.npy --map-rules noetic
        costmap office now.npy --level cellar
        costmap nothing now.npy
        costmap nowhere now.npy
        costmap office now.npy --inflate nan
        costmap office now.npy --inflate -1
        costmap office now.npy --inflate inf
        costmap office now.npy --scaling 3
        costmap office now.npy --layer door --inflate 1
        costmap office now.npy --resolution 0.1
        costmap office now.npy --resolution nan
        costmap office now.npy --by chance
        costmap office day.mcap --at 08:00
        costmap office day --keepout
        costmap office now.png --until 08:00
        costmap office now.png --no-updates
        costmap office day.mcap --every nan
        costmap office gone/day.mcap
        costmap office office/day.mcap
        costmap office office/now.npy
        costmap office gone/now.npy
        costmap office gone/now.yaml
        costmap office gone/now.png
    """)

    assert before == sorted(Path().rglob("*"))


@pytest.mark.parametrize("name", ["day.mcap", "day.bag", "day"])
def test_a_bag_shows_it_over_time(name: str, run: Verb) -> None:
    """Each change as a grid; the door that opens at nine is free from then on."""
    code, out, _ = run("costmap", "office", name, "--since", "2026-03-01T08:00..2026-03-01T10:00",
                       "--every", "0", "--json")  # fmt: skip

    said = json.loads(out)
    assert (0, 2, 1) == (code, said["grids"], said["updates"])
    with AnyReader([Path(name)], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
        grids = [
            (stamp // 10**9, bag.deserialize(raw, connection.msgtype))
            for connection, stamp, raw in bag.messages()
            if connection.topic == "/semmap/costmap"
        ]
    nine = EIGHT_NS // 10**9 + 3600
    assert [(nine - 3600, 100), (nine, 0)] == [
        (at, grid.data.reshape(grid.info.height, grid.info.width)[10, 6]) for at, grid in grids
    ]


@pytest.mark.parametrize("value", ["0", "-0.1", "inf"])
def test_a_resolution_that_cannot_be(run: Verb, value: str) -> None:
    """Also where there is no floor to take it from."""
    with sl.create("bare", tz="UTC") as log:
        log.add_door(x=2.0, y=3.0, theta=0.0, width=1.0, state="closed")

    code, _, err = run("costmap", "bare", "bare.npy", "--resolution", value)

    assert 1 == code
    assert "the resolution: expected metres a cell, above 0" in err


def test_a_turned_floor_is_refused(run: Verb) -> None:
    """A costmap's cells lie along the axes: a yaw is not left out in silence."""
    with sl.append("nothing") as log:
        log.append([floor(origin_theta=0.1)])

    code, _, err = run("costmap", "nothing", "now.npy")

    assert 1 == code
    assert "expected an origin with yaw 0, got 0.1; turn the picture" in err


def test_an_old_file_survives_an_error(run: Verb) -> None:
    """What cannot be made leaves what was there."""
    Path("now.npy").write_bytes(b"old")

    code, *_ = run("costmap", "nothing", "now.npy")

    assert 1 == code
    assert b"old" == Path("now.npy").read_bytes()
