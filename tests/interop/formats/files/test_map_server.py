"""map.yaml with its picture, read as each of ROS's servers reads it."""

import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.analysis.costmap_2d.map_rules import RULES
from semmap_log.errors import CostmapError, FormatError
from semmap_log.interop.formats.files import map_server
from semmap_log.interop.formats.files.map_server import read_map

HEADER = {
    "image": "m.png",
    "resolution": "0.05",
    "origin": "[-1.0, 2.0, 0.5]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.196",
}


def written(tmp_path, picture=None, **keys):
    if picture is not None:
        picture.save(tmp_path / "m.png")
    header = {**HEADER, **keys}
    path = tmp_path / "m.yaml"
    path.write_text("".join(f"{key}: {text}\n" for key, text in header.items() if text is not None))
    return path


def grey(*rows):
    return Image.fromarray(np.array(rows, np.uint8))


def test_the_lowest_row_of_the_picture_is_row_0(tmp_path):
    """Black is a wall, white is free, what lies between is unknown."""
    found = read_map(written(tmp_path, grey([0, 255], [205, 254])), level=3)

    assert [[-1, 0], [100, 0]] == found.cells.tolist()
    assert np.int8 == found.cells.dtype
    assert (3, -1.0, 2.0, 0.5) == (
        found.level, found.origin_x, found.origin_y, found.origin_theta
    )  # fmt: skip
    assert float(np.float32(0.05)) == found.resolution


@pytest.mark.parametrize(
    ("rules", "cells"),
    [("noetic", [-1, 100, -1, 0]), ("nav2_humble", [-1, 100, 0, 0]), ("nav2", [100, 100, 0, 0])],
)
def test_each_server_has_its_own_rules(tmp_path, rules, cells):
    """An occupancy equal to a threshold (51 of 255 is 0.8) counts in today's Nav2 only."""
    path = written(tmp_path, grey([51, 50, 204, 205]), occupied_thresh="0.8", free_thresh="0.2")

    assert [cells] == read_map(path, rules=rules).cells.tolist()


def test_the_rules_are_those_of_today_s_nav2(tmp_path):
    """Unless told otherwise."""
    path = written(tmp_path, grey([51, 204]), occupied_thresh="0.8", free_thresh="0.2")

    assert read_map(path, rules="nav2") == read_map(path)


def test_negate_takes_white_for_walls(tmp_path):
    """0 and 1, and true, which Nav2 knows."""
    picture = grey([0, 255])

    assert [[0, 100]] == read_map(written(tmp_path, picture, negate="1")).cells.tolist()
    assert [[0, 100]] == read_map(written(tmp_path, picture, negate="true")).cells.tolist()


@pytest.mark.parametrize(
    ("rules", "cells"), [("noetic", [1, 2]), ("nav2_humble", [-1, 7]), ("nav2", [-1, 7])]
)
def test_a_palette(tmp_path, rules, cells):
    """Nav2 looks the colour up; noetic takes its number for the shade."""
    picture = Image.fromarray(np.array([[1, 2]], np.uint8), "L")
    picture.putpalette([0, 0, 0, 200, 200, 200, 7, 7, 7])
    assert "P" == picture.mode

    path = written(tmp_path, picture, mode="raw")

    assert [cells] == read_map(path, rules=rules).cells.tolist()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_every_depth_of_grey_reads_alike(tmp_path, dtype):
    """Sixteen bits, eight and one."""
    most = np.iinfo(dtype).max
    picture = Image.fromarray(np.array([[0, most]], dtype))

    assert [[100, 0]] == read_map(written(tmp_path, picture)).cells.tolist()
    assert [[100, 0]] == read_map(written(tmp_path, grey([0, 255]).convert("1"))).cells.tolist()


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"image": None}, "m.yaml:1: a map: expected the key image, got none"),
        ({"origin": None, "negate": None}, "(?s)key origin.*key negate"),
        ({"resolution": "0"}, "m.yaml:2: a map: resolution: expected .* above 0, got '0'"),
        ({"resolution": "-1"}, "above 0, got '-1'"),
        ({"resolution": "fine"}, "resolution: expected a number, got 'fine'"),
        ({"origin": "[0, 0]"}, r"m.yaml:3: a map: origin: expected \[x y yaw\], got 2 values"),
        ({"origin": "[0, 0, .nan]"}, "m.yaml:3: .*expected a finite number"),
        ({"mode": "ternary"}, "mode: expected one of trinary, scale, raw, got 'ternary'"),
        ({"negate": "maybe"}, "negate: expected 0 or 1, got 'maybe'"),
        ({"negate": "2"}, "negate: expected 0 or 1, got '2'"),
        ({"resolution": ".nan"}, "m.yaml:2: a map: resolution: expected a finite number"),
        ({"resolution": ".inf"}, "m.yaml:2: expected a finite number"),
        ({"resolution": "1e-9"}, "resolution: expected .* above 0, got '1e-9'"),
        ({"occupied_thresh": "65"}, "occupied_thresh: expected a share from 0 to 1, got '65'"),
        ({"free_thresh": "-0.1"}, "free_thresh: expected a share from 0 to 1, got '-0.1'"),
        ({"free_thresh": ".nan"}, "expected a finite number"),
        ({"mode": "scale", "free_thresh": "0.65"}, "less than occupied_thresh .0.65. in mode"),
        ({"free_thresh": "0.7"}, r"free_thresh: expected at most occupied_thresh \(0.65\)"),
        ({"image": "none.png"}, "m.yaml:1: image: .*none.png: cannot be read: No such file"),
        ({"image": "m.yaml"}, "m.yaml:1: image: the picture .*m.yaml cannot be read"),
        ({"image": "."}, "expected a regular file, got a folder"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(tmp_path, keys, message):
    """One wrong key each."""
    with pytest.raises(FormatError, match=message):
        read_map(written(tmp_path, grey([0]), **keys))


def test_a_torn_picture_is_said(tmp_path):
    """Half a file is no map."""
    path = written(tmp_path, Image.effect_noise((200, 200), 80))
    picture = tmp_path / "m.png"
    picture.write_bytes(picture.read_bytes()[:2000])

    with pytest.raises(FormatError, match=r"image: the picture .* cannot be read: "):
        read_map(path)


@pytest.mark.parametrize("side", [10_001, 60_000])
def test_a_picture_too_large_is_not_unpacked(tmp_path, side):
    """Its header says how large it is."""
    path = written(tmp_path, image="m.pgm")
    (tmp_path / "m.pgm").write_bytes(b"P5 %d %d 255\n" % (side, side) + b"\0" * 1000)

    with pytest.raises(FormatError, match=r"expected at most 100,000,000 pixels|exceeds limit"):
        read_map(path)


@pytest.mark.parametrize(
    ("keys", "cell", "message"),
    [
        ({"negate": "true"}, -1, "negate: expected 0 or 1, which is all that map_server of noetic"),
        ({"mode": "Scale"}, 67, "mode: expected one of trinary, scale, raw, got 'Scale'"),
    ],
)
def test_what_noetic_cannot_read(tmp_path, keys, cell, message):
    """Nav2 can."""
    path = written(tmp_path, grey([128]), **keys)

    assert [[cell]] == read_map(path, rules="nav2").cells.tolist()
    with pytest.raises(FormatError, match=message):
        read_map(path, rules="noetic")


@pytest.mark.parametrize(
    ("head", "data", "message"),
    [
        (b"P5 0 0 255\n", b"", "the picture .* cannot be read: expected a PPM, .* one pixel"),
        (b"P5 3 0 255\n", b"", "expected a PPM, PNG, .* of at least one pixel, got none"),
        (b"P5 1 1 100\n", b"\x64", "a greatest value of 255 or 65535 in its head, got 100"),
        (b"P2 1 1 254\n", b"100\n", "a greatest value of 255 or 65535 in its head, got 254"),
    ],
)
def test_pictures_that_are_no_map(tmp_path, head, data, message):
    """Nothing in it, or a scale that no two servers take for the same."""
    path = written(tmp_path, image="m.pgm")
    (tmp_path / "m.pgm").write_bytes(head + data)

    with pytest.raises(FormatError, match=message):
        read_map(path)


def test_pictures_that_sdl_does_not_read_as_others_do(tmp_path):
    """Sixteen bits of PGM, and formats whose surfaces depend on their packing."""
    path = written(tmp_path, image="m.pgm")
    (tmp_path / "m.pgm").write_bytes(b"P5 1 1 65535\n\0\0")

    assert [[100]] == read_map(path).cells.tolist()
    with pytest.raises(FormatError, match="PGM of 16 bits"):
        read_map(path, rules="noetic")
    grey([0]).save(tmp_path / "m.bmp")
    with pytest.raises(FormatError, match=r"PGM, PNG or JPEG"):
        read_map(written(tmp_path, image="m.bmp"), rules="noetic")


@pytest.mark.parametrize("rules", RULES)
def test_one_pixel(tmp_path, rules):
    """The smallest map there is."""
    assert [[0]] == read_map(written(tmp_path, grey([254])), rules=rules).cells.tolist()


@pytest.mark.parametrize("yaw", ["0", "-0.0", "1e-9", "6.283185307179586"])
def test_a_map_s_place_in_a_costmap(tmp_path, yaw):
    """Its float32 resolution and its corner; a whole turn and a rounding error are no turn."""
    path = written(tmp_path, grey([0, 0, 0], [0, 0, 0]), origin=f"[-1.0, 2.0, {yaw}]")

    found = GridGeometry.of_floor(read_map(path))

    assert GridGeometry(3, 2, float(np.float32(0.05)), -1.0, 2.0) == found


@pytest.mark.parametrize("yaw", ["0.5", "-0.01", "3.141592653589793"])
def test_a_turned_map_has_no_place_in_a_costmap(tmp_path, yaw):
    """The plan keeps its yaw; a costmap has none, and ROS would show walls where none are."""
    floor = read_map(written(tmp_path, grey([0] * 9), origin=f"[0, 0, {yaw}]"), level=2)

    assert float(yaw) == floor.origin_theta
    with pytest.raises(CostmapError, match=r"floor plan of level 2: expected .* yaw 0, got -?\d"):
        GridGeometry.of_floor(floor)


def test_strips_join_without_a_seam(tmp_path, monkeypatch):
    """A picture is read some rows at a time; the grid is the same."""
    path = written(tmp_path, Image.effect_noise((7, 50), 80))
    whole = read_map(path)

    monkeypatch.setattr(map_server, "PIXELS_A_STRIP", 21)

    assert whole == read_map(path)


@pytest.mark.slow
def test_a_hundred_megapixels_stay_in_bounds(tmp_path):
    """The picture, the grid, and little more."""
    path = written(tmp_path, image="m.pgm")
    with (tmp_path / "m.pgm").open("wb") as file:
        file.write(b"P5 10000 10000 255\n")
        file.truncate(file.tell() + 100_000_000)
    code = (
        "import re, sys; from pathlib import Path\n"
        "from semmap_log.interop.formats.files.map_server import read_map\n"
        "cells = read_map(Path(sys.argv[1])).cells\n"
        "assert cells.all() and cells.shape == (10000, 10000)\n"
        # Not ru_maxrss: that begins with what the process took that started this one.
        "status = Path('/proc/self/status').read_text()\n"
        "print(int(re.search(r'VmHWM:\\s+(\\d+) kB', status)[1]) // 1024)"
    )

    run = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, check=True)

    assert int(run.stdout) < 350


def test_the_depot_of_nav2(shared_data):
    """Every cell as a plain loop over the pixels has it."""
    folder = shared_data / "maps" / "nav2_depot"

    found = read_map(folder / "depot.yaml")

    pixels = np.asarray(Image.open(folder / "depot.pgm")).tolist()
    expected = [
        [100 if (255 - p) / 255 > 0.65 else 0 if (255 - p) / 255 < 0.25 else -1 for p in row]
        for row in reversed(pixels)
    ]
    assert (307, 604) == found.cells.shape
    assert expected == found.cells.tolist()
