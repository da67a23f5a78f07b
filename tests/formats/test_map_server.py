"""map.yaml with its picture, read as map_server and Nav2 read it."""

import numpy as np
import pytest
from PIL import Image

from semmap_log.errors import FormatError
from semmap_log.formats.map_server import read_map

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
    """
    Black is a wall, white is free, what lies between is unknown.
    """
    found = read_map(written(tmp_path, grey([0, 255], [205, 254])), level=3)

    assert [[-1, 0], [100, 0]] == found.cells.tolist()
    assert np.int8 == found.cells.dtype
    assert (3, -1.0, 2.0, 0.5) == (
        found.level, found.origin_x, found.origin_y, found.origin_theta
    )  # fmt: skip
    assert float(np.float32(0.05)) == found.resolution


def test_thresholds_are_strict(tmp_path):
    """
    An occupancy equal to a threshold is unknown: 51 of 255 is exactly 0.8.
    """
    path = written(tmp_path, grey([51, 50, 204, 205]), occupied_thresh="0.8", free_thresh="0.2")

    assert [[-1, 100, -1, 0]] == read_map(path).cells.tolist()


def test_negate_takes_white_for_walls(tmp_path):
    """
    0 and 1, and true, which Nav2 knows.
    """
    picture = grey([0, 255])

    assert [[0, 100]] == read_map(written(tmp_path, picture, negate="1")).cells.tolist()
    assert [[0, 100]] == read_map(written(tmp_path, picture, negate="true")).cells.tolist()


def test_scale_spreads_what_lies_between(tmp_path):
    """
    From free_thresh to occupied_thresh as 0 to 100; transparent is unknown.
    """
    pixels = [(255, 255, 255, 255), (128, 128, 128, 255), (0, 0, 0, 255), (0, 0, 0, 254)]
    picture = Image.fromarray(np.array([pixels], np.uint8))
    path = written(tmp_path, picture, mode="scale", occupied_thresh="0.9", free_thresh="0.1")

    ratio = round(((255 - 128) / 255 - 0.1) / 0.8 * 100)
    assert [[0, ratio, 100, -1]] == read_map(path).cells.tolist()


def test_raw_takes_the_bytes(tmp_path):
    """
    0..100 as they are, all else unknown; negate means nothing.
    """
    path = written(tmp_path, grey([0, 1, 100, 101, 255]), mode="raw", negate="1")

    assert [[0, 1, 100, -1, -1]] == read_map(path).cells.tolist()


def test_trinary_counts_transparency_as_a_channel(tmp_path):
    """
    As the servers do: black but opaque is (0 + 0 + 0 + 255) / 4.
    """
    picture = Image.fromarray(np.array([[(0, 0, 0, 255), (0, 0, 0, 0)]], np.uint8))
    path = written(tmp_path, picture, occupied_thresh="0.8")

    assert [[-1, 100]] == read_map(path).cells.tolist()


def test_colours_count_by_their_mean(tmp_path):
    """
    Pure red is a third of white; a palette is looked up.
    """
    picture = Image.fromarray(np.array([[(255, 0, 0), (255, 255, 255)]], np.uint8))

    assert [[100, 0]] == read_map(written(tmp_path, picture)).cells.tolist()
    palette = picture.convert("P", palette=Image.Palette.ADAPTIVE)
    assert [[100, 0]] == read_map(written(tmp_path, palette)).cells.tolist()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_every_depth_of_grey_reads_alike(tmp_path, dtype):
    """
    Sixteen bits, eight and one.
    """
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
        ({"origin": "[0, 0, .nan]"}, "m.yaml:3: expected a finite number"),
        ({"mode": "ternary"}, "mode: expected one of trinary, scale, raw, got 'ternary'"),
        ({"negate": "maybe"}, "negate: expected 0 or 1, got 'maybe'"),
        ({"free_thresh": "0.7"}, r"free_thresh: expected at most occupied_thresh \(0.65\)"),
        ({"image": "none.png"}, "m.yaml:1: image: .*none.png: cannot be read: No such file"),
        ({"image": "m.yaml"}, "m.yaml:1: image: the picture .*m.yaml cannot be read"),
        ({"image": "."}, "expected a regular file, got a folder"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(tmp_path, keys, message):
    """
    One wrong key each.
    """
    with pytest.raises(FormatError, match=message):
        read_map(written(tmp_path, grey([0]), **keys))


def test_a_torn_picture_is_said(tmp_path):
    """
    Half a file is no map.
    """
    path = written(tmp_path, Image.effect_noise((200, 200), 80))
    picture = tmp_path / "m.png"
    picture.write_bytes(picture.read_bytes()[:2000])

    with pytest.raises(FormatError, match=r"image: the picture .* cannot be read: "):
        read_map(path)


@pytest.mark.parametrize("side", [10_001, 60_000])
def test_a_picture_too_large_is_not_unpacked(tmp_path, side):
    """
    Its header says how large it is; both below and above the size at which Pillow itself refuses.
    """
    path = written(tmp_path, image="m.pgm")
    (tmp_path / "m.pgm").write_bytes(b"P5 %d %d 255\n" % (side, side) + b"\0" * 1000)

    with pytest.raises(FormatError, match=r"expected at most 100,000,000 pixels|exceeds limit"):
        read_map(path)


def test_the_depot_of_nav2(shared_data):
    """
    Every cell as a plain loop over the pixels has it.
    """
    folder = shared_data / "maps" / "nav2_depot"

    found = read_map(folder / "depot.yaml")

    pixels = np.asarray(Image.open(folder / "depot.pgm")).tolist()
    expected = [
        [100 if (255 - p) / 255 > 0.65 else 0 if (255 - p) / 255 < 0.25 else -1 for p in row]
        for row in reversed(pixels)
    ]
    assert (307, 604) == found.cells.shape
    assert expected == found.cells.tolist()
