"""A map that is written loads in every server to the same cells, and is written whole or not."""

import os

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from semmap_log.analysis.costmap_2d.costs import to_occupancy
from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.analysis.costmap_2d.map_rules import RULES
from semmap_log.errors import CostmapError, OutputError
from semmap_log.interop.formats.files.map_server import read_map
from semmap_log.interop.formats.files.map_server_out import write_costs, write_map

EVERY_VALUE = np.arange(-1, 101, dtype=np.int8).reshape(6, 17)
EVERY_COST = np.arange(256, dtype=np.uint8).reshape(8, 32)


def geometry_of(grid, resolution=0.05, x=-1.0, y=2.5):
    height, width = grid.shape
    return GridGeometry(width, height, resolution, x, y)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("rules", RULES)
def test_every_value_loads_in_every_server(tmp_path, rules):
    """Raw carries all 102 values."""
    mode = write_map(tmp_path / "m.pgm", EVERY_VALUE, geometry_of(EVERY_VALUE))

    found = read_map(tmp_path / "m.yaml", rules=rules)

    assert "raw" == mode
    assert EVERY_VALUE.tolist() == found.cells.tolist()
    assert (float(np.float32(0.05)), -1.0, 2.5, 0.0) == (
        found.resolution, found.origin_x, found.origin_y, found.origin_theta
    )  # fmt: skip


@pytest.mark.parametrize("rules", RULES)
@pytest.mark.parametrize("mode", [None, "trinary", "raw"])
def test_a_plain_map_loads_in_every_server_and_mode(tmp_path, rules, mode):
    """Walls, floor and unknown; trinary unless asked for, so that any reader of maps knows it."""
    grid = np.array([[-1, 0, 100], [100, 100, 0]], np.int8)

    written = write_map(tmp_path / "m.yaml", grid, geometry_of(grid), mode=mode)

    assert (mode or "trinary") == written
    assert grid.tolist() == read_map(tmp_path / "m.yaml", rules=rules).cells.tolist()


@pytest.mark.parametrize("rules", RULES)
def test_every_cost_loads_as_costmap_2d_publishes_it(tmp_path, rules):
    """All 256."""
    write_costs(tmp_path / "m.pgm", EVERY_COST, geometry_of(EVERY_COST))

    found = read_map(tmp_path / "m.yaml", rules=rules)

    assert to_occupancy(EVERY_COST).tolist() == found.cells.tolist()


def test_the_files_are_what_map_server_documents(tmp_path):
    """The first row of the picture is the highest y."""
    grid = np.array([[0, 100], [-1, 0]], np.int8)

    write_map(tmp_path / "m.pgm", grid, geometry_of(grid), comment="doors\nat noon\x07")

    assert b"P5\n2 2\n255\n" + bytes([205, 254, 254, 0]) == (tmp_path / "m.pgm").read_bytes()
    assert [
        "# doors", "image: m.pgm", "mode: trinary", "resolution: 0.05",
        "origin: [-1.0, 2.5, 0.0]", "negate: 0", "occupied_thresh: 0.65", "free_thresh: 0.196",
    ] == (tmp_path / "m.yaml").read_text().splitlines()  # fmt: skip


@settings(deadline=None, suppress_health_check=list(HealthCheck))
@given(
    resolution=st.floats(1e-6, 1e6) | st.floats(2**-19, 2**19, width=32),
    x=st.floats(-1e12, 1e12),
    y=st.floats(-1e12, 1e12) | st.sampled_from([1e-5, -5e-324, 1e300, -0.0]),
)
def test_numbers_come_back_to_the_last_bit(tmp_path, resolution, x, y):
    """In YAML 1.1's own reading, where 1e-05 is a text, and as ROS keeps them."""
    grid = np.zeros((1, 1), np.int8)

    write_map(tmp_path / "m.pgm", grid, geometry_of(grid, resolution, x, y))

    plain = yaml.safe_load((tmp_path / "m.yaml").read_text())
    assert [float, float, float] == [type(number) for number in plain["origin"]]
    assert [x, y, 0.0] == plain["origin"]
    assert isinstance(plain["resolution"], float)
    assert np.float32(resolution) == np.float32(plain["resolution"])
    found = read_map(tmp_path / "m.yaml")
    assert (float(np.float32(resolution)), x, y) == (
        found.resolution, found.origin_x, found.origin_y
    )  # fmt: skip


@pytest.mark.parametrize("resolution", [0.05, float(np.float32(0.05))])
def test_a_resolution_is_said_as_people_say_it(tmp_path, resolution):
    """0.05, also where it went through ROS's float32."""
    grid = np.zeros((1, 1), np.int8)

    write_map(tmp_path / "m.pgm", grid, geometry_of(grid, resolution))

    assert "\nresolution: 0.05\n" in (tmp_path / "m.yaml").read_text()


@pytest.mark.parametrize(
    "name", ["1e5", "a b", "it's: #1", 'quo"te', "tür", "-x", "~", "a\\b", "null"]
)
def test_odd_names(tmp_path, name):
    """The header names its picture, whatever it is called."""
    grid = np.array([[100]], np.int8)

    write_map(tmp_path / f"{name}.pgm", grid, geometry_of(grid))

    assert [[100]] == read_map(tmp_path / f"{name}.yaml").cells.tolist()


@pytest.mark.parametrize(
    ("grid", "options", "message"),
    [
        ([[50]], {"mode": "trinary"}, "trinary: expected -1, 0 and 100, got 50; write .* raw"),
        ([[101]], {}, "a map in mode raw: expected -1 to 100, got 101"),
        ([[-56]], {}, "a map in mode raw: expected -1 to 100, got -56"),
        ([[0]], {"mode": "scale"}, "expected trinary or raw, got 'scale'; scale means other"),
    ],
)
def test_values_that_no_mode_holds(tmp_path, grid, options, message):
    """Refused, and nothing is written."""
    grid = np.array(grid, np.int8)

    with pytest.raises(CostmapError, match=message):
        write_map(tmp_path / "m.pgm", grid, geometry_of(grid), **options)
    assert [] == names(tmp_path)


def test_grids_that_do_not_fit(tmp_path):
    """Another shape, another type, a resolution that reads back as none."""
    grid = np.zeros((2, 3), np.int8)

    with pytest.raises(CostmapError, match=r"expected int8 \(3, 2\), got int8 \(2, 3\)"):
        write_map(tmp_path / "m.pgm", grid, GridGeometry(2, 3, 0.05))
    with pytest.raises(CostmapError, match="got uint8"):
        write_map(tmp_path / "m.pgm", grid.view(np.uint8), geometry_of(grid))
    with pytest.raises(CostmapError, match="1e-6 to 1e6 metres, got 1e-09"):
        write_map(tmp_path / "m.pgm", grid, geometry_of(grid, 1e-9))


@pytest.mark.parametrize("name", ["m.png", "m", "m.PGM"])
def test_names_that_tell_no_map(tmp_path, name):
    """The two files are called .pgm and .yaml."""
    with pytest.raises(OutputError, match=r"expected a name that ends in .pgm or .yaml"):
        write_map(tmp_path / name, np.zeros((1, 1), np.int8), GridGeometry(1, 1, 1.0))


def test_a_map_takes_the_place_of_another(tmp_path):
    """And leaves nothing else behind."""
    for value in (0, 100):
        grid = np.array([[value]], np.int8)
        write_map(tmp_path / "m.pgm", grid, geometry_of(grid))

    assert [[100]] == read_map(tmp_path / "m.yaml").cells.tolist()
    assert ["m.pgm", "m.yaml"] == names(tmp_path)


@pytest.mark.parametrize("step", range(1, 5))
def test_a_swap_that_fails_is_undone(tmp_path, monkeypatch, step):
    """At each of its four renames: the old map stays, whole."""
    old = np.array([[0]], np.int8)
    write_map(tmp_path / "m.pgm", old, geometry_of(old))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    rename, calls = os.rename, []

    def failing(self, target):
        calls.append(target)
        if len(calls) == step:
            raise OSError(5, "Input/output error")
        rename(self, target)
        return target

    monkeypatch.setattr("pathlib.Path.rename", failing)
    with pytest.raises(OutputError, match=r"m.yaml"):
        write_map(tmp_path / "m.pgm", np.array([[100]], np.int8), geometry_of(old))

    assert before == {path.name: path.read_bytes() for path in tmp_path.iterdir()}


def test_no_header_ever_stands_beside_another_s_picture(tmp_path, monkeypatch):
    """Killed after any rename, what is there is one map or the other, or no header at all."""
    old, new = np.array([[0]], np.int8), np.array([[100, 0]], np.int8)
    write_map(tmp_path / "m.pgm", old, geometry_of(old))
    rename, seen = os.rename, []

    def watched(self, target):
        rename(self, target)
        header = tmp_path / "m.yaml"
        seen.append(read_map(header).cells.tolist() if header.exists() else None)
        return target

    monkeypatch.setattr("pathlib.Path.rename", watched)
    write_map(tmp_path / "m.pgm", new, geometry_of(new))

    assert [None, None, None, [[100, 0]]] == seen


def test_a_folder_in_the_way(tmp_path):
    """Nothing of it is touched."""
    (tmp_path / "m.pgm").mkdir()

    with pytest.raises(OutputError, match="there is a folder of that name"):
        write_map(tmp_path / "m.yaml", np.zeros((1, 1), np.int8), GridGeometry(1, 1, 1.0))
    assert ["m.pgm"] == names(tmp_path)


def test_no_folder_at_all(tmp_path):
    """Said as one of ours."""
    with pytest.raises(OutputError, match=r"none/m.yaml"):
        write_map(tmp_path / "none" / "m.pgm", np.zeros((1, 1), np.int8), GridGeometry(1, 1, 1.0))
