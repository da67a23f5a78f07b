"""A YAML file is known by its keys, whatever it is called."""

from __future__ import annotations

from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import FormatError
from semmap_log.interop.formats.files.map_server import kind_of_yaml
from semmap_log.interop.importing.importing import import_file

BUILDING = """name: mill
levels:
  L1:
    vertices: [[40, 40, 0, ""], [60, 40, 0, ""], [0, 0, 0, ""], [100, 0, 0, ""]]
    measurements: [[2, 3, {distance: [3, 5.0]}]]
    doors: [[0, 1, {name: [1, gate]}]]
"""
MAP = "image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n"
DOORS = "1:\n  position: {x: 0, y: 0, theta: 0}\n  width: 1\n"


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        (BUILDING, "building"),
        (MAP, "map"),
        ("origin: [0, 0, .nan]", "map"),
        ("resolution: 0.05\nfree_thresh: ten", "map"),
        ("{image: m.pgm, resolution: 0.05}", "map"),
        ('"image" : m.pgm', "map"),
        (DOORS, "doors"),
        ("{1: {position: {x: 0}}}", "doors"),
        ("1:\n  image: front.png\n  levels: 3\n", "doors"),
        ("1:\n  position: {}\nimage: front.png\nlevels: 3\n", "doors"),
        ("# image: no\n1: {}", "doors"),
        ("", "doors"),
        ("- a", "doors"),
    ],
)
def test_the_uppermost_keys_tell(tmp_path: Path, text: str, kind: str) -> None:
    """Block style or flow style; comments and deeper keys tell nothing."""
    for name in ("a.yaml", "a.building.yaml", "map.yml"):
        (tmp_path / name).write_text(text)

        assert kind == kind_of_yaml(tmp_path / name)


@pytest.mark.parametrize("text", ["a" + " " * 4_000_000, "a:\n" * 1_000_000, " : " * 1_000_000])
def test_what_nobody_would_write_costs_little(tmp_path: Path, text: str) -> None:
    """Each line is looked at once."""
    (tmp_path / "a.yaml").write_text(text)

    assert "doors" == kind_of_yaml(tmp_path / "a.yaml")


@pytest.mark.parametrize(("text", "doors"), [(BUILDING, 1), (DOORS, 1)])
def test_a_file_is_imported_whatever_it_is_called(tmp_path: Path, text: str, doors: int) -> None:
    """A building that was renamed, and doors that are called as a building is."""
    for name in ("map.yaml", "doors.yml", "mill.building.yaml"):
        path = tmp_path / name
        path.write_text(text)
        with sl.create(tmp_path / f"log_{name}", tz="UTC") as log:
            import_file(log, path)
            assert doors == len(log.replay().doors)


def test_a_wrong_map_is_a_wrong_map(tmp_path: Path) -> None:
    """Not a door database with six wrong keys."""
    (tmp_path / "map.yaml").write_text(MAP.replace("0, 0, 0", "0, 0, .nan"))

    with (
        sl.create(tmp_path / "log", tz="UTC") as log,
        pytest.raises(FormatError, match=r"map.yaml:3: a map: origin"),
    ):
        import_file(log, tmp_path / "map.yaml")


def test_a_nav_graph_is_no_building(tmp_path: Path) -> None:
    """It has levels, but nothing on them that a log holds."""
    path = tmp_path / "0.yaml"
    path.write_text("building_name: mill\ndoors: {}\nlevels: {L1: {lanes: []}}\nlifts: {}\n")

    with pytest.raises(FormatError, match="this is a nav graph, which Open-RMF made"):
        kind_of_yaml(path)
