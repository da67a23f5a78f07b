"""`rooms` as a user types it: the table, the notes below it, the files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import semmap_log as sl
from semmap_log.core.model.events import FloorMap, LevelAdded
from tests.analysis.rooms.buildings import drawn
from tests.golden_text import GoldenText
from tests.verbs import Refuses, Verb, run

SECOND = 10**9
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


@pytest.fixture
def office(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the log `office`: two levels with plans and a lift, one without a plan."""
    monkeypatch.chdir(tmp_path)
    with sl.create("office", tz="UTC", building="House") as log:
        for number, name in ((1, "ground"), (2, "first"), (3, "attic")):
            log.append([LevelAdded(level=number, name=name, happened_ns=SECOND)])
        for level in (1, 2):
            floor = FloorMap(
                level=level, resolution=0.1, origin_x=0.0, origin_y=0.0, cells=FLOOR.cells,
                happened_ns=SECOND,
            )  # fmt: skip
            log.append([floor])
        up = {"theta": np.pi / 2, "width": 1.0, "at": "@100"}
        front = log.add_door(x=5.5, y=3.0, level=1, name="front", **up)
        log.annotate(front, "rooms", "lab,hall", at="@100")
        lift = log.add_door(x=5.5, y=3.0, level=2, name="lift_door", **up)
        log.annotate(lift, "lift", "a", at="@100")
        log.add_door(x=8.0, y=3.0, level=1, name="gate", **up)
        log.add_door(x=40.0, y=3.0, level=1, name="far", **up)
        log.add_door(x=5.5, y=3.0, level=3, name="hatch", **up)
    return tmp_path


def test_a_row_for_each_room_and_what_is_odd_below(
    office: Path, run_verb: Verb, golden: GoldenText
) -> None:
    """Loops, doors without a room, doors in no wall, lifts, levels without a plan."""
    code, out, err = run_verb("rooms", "office")

    assert 0 == code
    assert [7] * 5 == [len(line.split("\t")) for line in out.splitlines()]
    golden("rooms", "two levels", out)
    golden("rooms", "two levels: notes", err)


def test_only_a_level(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By its name; the rooms keep their numbers."""
    assert 0 == run("rooms", "office", "--level", "first", "--json")

    said = json.loads(capsys.readouterr().out)
    assert [(3, "first"), (4, "first")] == [
        (room["room_id"], room["level_name"]) for room in said["rooms"]
    ]
    assert [("lift_door", 3, 4, True, False, "a")] == [
        (
            each["name"],
            each["left"],
            each["right"],
            each["joins_two"],
            each["is_loop"],
            each["lift"],
        )
        for each in said["doorways"]
    ]


def test_json_tells_all(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One document: rooms with doors and neighbours, doorways with sides, lifts."""
    assert 0 == run("rooms", "office", "--at", "@100", "--json")

    said = json.loads(capsys.readouterr().out)
    assert "1970-01-01T00:01:40.000000000Z" == said["at"]
    assert ([3], [{"name": "a", "doors": [2]}]) == (said["levels_without_plan"], said["lifts"])
    first = said["rooms"][0]
    assert (1, "lab", [1], [2]) == tuple(
        first[key] for key in ("room_id", "name", "doors", "leads_to")
    )
    assert 2 < first["x"] < 5
    assert {1: (1, 2, True), 3: (2, 2, False), 4: (None, None, False)} == {
        each["door_id"]: (each["left"], each["right"], each["in_wall"])
        for each in said["doorways"]
        if each["level"] == 1
    }


def test_rooms_as_geojson(office: Path) -> None:
    """A polygon each, in metres of the map, with the keys of --json."""
    assert 0 == run("rooms", "office", "--out", "rooms.geojson")

    said = json.loads(Path("rooms.geojson").read_text())
    assert ("FeatureCollection", "House") == (said["type"], said["semmap_log"]["building"])
    assert "LOCAL_CS" in said["crs"]["properties"]["name"]
    assert [1, 2, 3, 4] == [feature["id"] for feature in said["features"]]
    first = said["features"][0]
    assert "lab" == first["properties"]["name"]
    (ring,) = first["geometry"]["coordinates"]
    assert (2.0, 2.0) == pytest.approx((min(x for x, _ in ring), min(y for _, y in ring)))


def test_a_level_as_a_topological_map(office: Path) -> None:
    """A node for each room and each door, edges both ways between them, each name and edge once."""
    assert 0 == run("rooms", "office", "--level", "ground", "--out", "g.tmap2.yaml")

    said = yaml.safe_load(Path("g.tmap2.yaml").read_text())
    assert ("House", "House", "ground") == (said["name"], said["pointset"], said["metric_map"])
    assert "1970-01-01_00-01-40" == said["meta"]["last_updated"]
    nodes: dict[str, Any] = {each["node"]["name"]: each["node"] for each in said["nodes"]}
    assert ["lab", "hall", "front", "gate", "far"] == list(nodes)
    assert {
        "lab": ["front"], "hall": ["front", "gate"], "front": ["lab", "hall"], "gate": ["hall"],
        "far": [],
    } == {name: [edge["node"] for edge in node["edges"]]
          for name, node in nodes.items()}  # fmt: skip
    ids = [edge["edge_id"] for node in nodes.values() for edge in node["edges"]]
    assert len(ids) == len(set(ids))
    front = nodes["front"]
    assert {"x": 5.5, "y": 3.5, "z": 0.0} == pytest.approx(front["pose"]["position"])
    assert -1.0 == pytest.approx(2 * front["pose"]["orientation"]["w"] ** 2 - 1)  # looks to -x
    assert (1, "UNKNOWN") == (
        front["properties"]["semmap_log"]["door_id"], front["properties"]["semmap_log"]["state"],
    )  # fmt: skip
    for each in said["nodes"]:
        assert {"map", "node", "pointset"} == set(each["meta"])
        assert "map" == each["node"]["parent_frame"]
        assert 8 == len(each["node"]["verts"])


def test_a_name_that_a_room_has_is_not_a_doors_node(office: Path) -> None:
    """Names are told apart by numbers."""
    with sl.append("office") as log:
        log.annotate(1, "rooms", "front,front gate", at="@100")

    assert 0 == run("rooms", "office", "--level", "ground", "--out", "g.tmap2.yaml")

    said = yaml.safe_load(Path("g.tmap2.yaml").read_text())
    names = [each["node"]["name"] for each in said["nodes"]]
    assert ["front", "front gate", "front_door_1", "gate", "far"] == names


def test_edges_are_told_apart_where_names_run_together(office: Path) -> None:
    """`front_a` to `front`, and `front` to `a_front`."""
    with sl.append("office") as log:
        log.annotate(1, "rooms", "front_a,a_front", at="@100")

    assert 0 == run("rooms", "office", "--level", "ground", "--out", "g.tmap2.yaml")

    said = yaml.safe_load(Path("g.tmap2.yaml").read_text())
    ids = [edge["edge_id"] for each in said["nodes"] for edge in each["node"]["edges"]]
    assert ["front_a_front", "front_a_front_edge"] == [i for i in ids if "front_a_front" in i]
    assert len(ids) == len(set(ids))


@pytest.mark.parametrize("name", ["rooms.png", "rooms.svg"])
def test_rooms_as_a_picture(office: Path, name: str) -> None:
    """Of all levels, or of one."""
    assert 0 == run("rooms", "office", "--plot", name)
    both = Path(name).read_bytes()
    assert 0 == run("rooms", "office", "--level", "1", "--plot", name)

    assert 5_000 < len(Path(name).read_bytes()) < len(both)
    if name.endswith(".svg"):
        text = both.decode()
        assert all(word in text for word in ("lab", "hall", "ground", "first", "joins two rooms"))


def test_what_cannot_be_is_an_error(office: Path, refuses: Refuses) -> None:
    """One line, exit code 1, and no file."""
    before = sorted(office.rglob("*"))

    refuses("""
        rooms office --level attic
        rooms office --at @0
        rooms office --level cellar
        rooms office --out rooms.pdf
        rooms office --out rooms.tmap2.yaml
        rooms office --plot rooms.pdf
        rooms office --out office/rooms.geojson
    """)

    assert before == sorted(office.rglob("*"))


def test_an_open_plan_has_no_rooms(office: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And that is said, not an error."""
    with sl.create("open", tz="UTC") as log:
        log.append(
            [
                FloorMap(
                    resolution=0.1, origin_x=0.0, origin_y=0.0, cells=np.zeros((50, 50), np.int8)
                )
            ]
        )

    assert 0 == run("rooms", "open")
    said = capsys.readouterr().err
    assert "0 rooms, 0 doors" in said
    assert "level 0: rooms have 0 of 25 m² of known floor" in said
