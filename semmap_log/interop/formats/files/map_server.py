"""ROS maps (`map.yaml` with its picture), read cell for cell as ROS's own servers read them.

The servers differ, so their rules go by name: `nav2`, the default, is Nav2 as it is today;
`nav2_humble` Nav2 before 2025; `noetic` the map_server of ROS 1. What each makes of a pixel is in
`costmap_2d/map_rules.py`. Of the header, noetic knows `negate` as a number and `mode` in small
letters only; Nav2 also takes true, false, capitals.

The servers also see different pixels, since each reads the picture with its own library. noetic's
map_server sees what SDL_image 1.2 makes of a file: eight bits a channel, and of a picture with a
palette the numbers of the colours instead of the colours, which is rarely what was meant. Nav2 sees
what GraphicsMagick makes of it: colours, and up to 16 bits of grey.

More is refused here than there: thresholds that are not 0 <= free <= occupied <= 1 (the servers
serve a grid of nonsense), a resolution that is not above 0, a number that is not finite. An
origin's yaw is kept in the floor plan; a costmap has none (`GridGeometry.of_floor`). A YAML file
is recognised as a map by its keys, whatever its name.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.map_rules import MODES, MapRules, Mode, Pixels, RulesName
from semmap_log.core.model.events import FloorMap
from semmap_log.errors import FormatError
from semmap_log.interop.formats.parsing import strict_yaml
from semmap_log.interop.formats.parsing.foreign_file import decode_utf8, open_regular, read_capped
from semmap_log.interop.formats.parsing.problems import Problems
from semmap_log.interop.formats.parsing.yaml_values import Fields, mapping_of

if TYPE_CHECKING:
    from PIL.Image import Image


DEFAULT_RULES: RulesName = "nav2"


def read_map(path: Path, *, level: int = 0, rules: RulesName = DEFAULT_RULES) -> FloorMap:
    """Return the map as a floor plan of that level.

    Args:
        path: The `.yaml` file; its picture is expected next to it.
        level: The number of the level it shows.
        rules: Whose reading: "nav2", "nav2_humble" or "noetic".

    Raises:
        FormatError: The file or its picture cannot be read, or is not such a map.
    """
    header = _read_header(path, rules)
    cells = _cells(_open_picture(header, path), header.meaning)
    x, y, theta = header.origin
    return FloorMap(
        level=level,
        # The log stores float32, as nav_msgs/MapMetaData does.
        resolution=float(np.float32(header.resolution)),
        origin_x=x, origin_y=y, origin_theta=theta,
        cells=cells,
    )  # fmt: skip


def is_map(path: Path) -> bool:
    """Return whether a file is the `.yaml` of a map, by its keys.

    What cannot be read is none: who reads it as something else says why.
    """
    try:
        return is_yaml(path) and kind_of_yaml(path) == "map"
    except FormatError:
        return False


def picture_of(path: Path) -> Path:
    """Return where a map's picture is.

    Raises:
        FormatError: The file is not such a map.
    """
    return path.parent / _read_header(path, DEFAULT_RULES).image


def _cells(picture: DecodedPicture, meaning: MapRules) -> NDArray[np.int8]:
    """Return the grid: its first row is the lowest y, a picture's first row is its top."""
    cells = np.empty((picture.height, picture.width), np.int8)
    from_the_top = cells[::-1]
    for top, pixels in picture.strips():
        from_the_top[top : top + len(pixels)] = meaning.cells(pixels, alpha=picture.alpha)
    return cells


@dataclass(frozen=True, slots=True)
class _Header:
    """What the .yaml says."""

    image: str
    image_line: int
    resolution: float
    origin: tuple[float, ...]
    meaning: MapRules


def _read_header(path: Path, rules: RulesName) -> _Header:
    problems = Problems(path)
    root = mapping_of(strict_yaml.load_yaml(path, takes_nan=True), "a map", problems)
    problems.raise_any()
    assert root is not None
    fields = Fields("a map", root, problems)
    image = fields.text("image")
    resolution = fields.number("resolution")
    origin = fields.numbers("origin", "x y yaw")
    negate = _negate(fields, rules)
    occupied, free = (_threshold(fields, key) for key in ("occupied_thresh", "free_thresh"))
    mode = _mode(fields, rules)
    if not (math.isnan(resolution) or 1e-6 <= resolution <= 1e6):
        fields.refuse("resolution", "a number of metres a cell, above 0")
    if free > occupied:
        fields.refuse("free_thresh", f"at most occupied_thresh ({occupied:g})")
    if mode == "scale" and free == occupied:
        fields.refuse("free_thresh", f"less than occupied_thresh ({occupied:g}) in mode scale")
    problems.raise_any()
    meaning = MapRules(rules, mode, negate, occupied_thresh=occupied, free_thresh=free)
    return _Header(image, root.key_lines["image"], resolution, origin, meaning)


def _threshold(fields: Fields, key: str) -> float:
    value = fields.number(key)
    if value < 0 or value > 1:
        fields.refuse(key, "a share from 0 to 1")
    return value


def _negate(fields: Fields, rules: RulesName) -> bool:
    node = fields.node("negate")
    value = node.value if isinstance(node, strict_yaml.Scalar) else None
    if node is not None and value not in (0, 1):
        fields.refuse("negate", "0 or 1")
    if rules == "noetic" and isinstance(value, bool):
        fields.refuse("negate", "0 or 1, which is all that map_server of noetic reads")
    return bool(value)


def _mode(fields: Fields, rules: RulesName) -> Mode:
    if "mode" not in fields.mapping.entries:
        return "trinary"
    said = fields.text("mode")
    for mode in MODES:
        if mode == (said if rules == "noetic" else said.lower()):
            return mode
    fields.refuse("mode", f"one of {', '.join(MODES)}")
    return "trinary"


def _open_picture(header: _Header, path: Path) -> DecodedPicture:
    """Return the picture, decoded."""
    place = path.parent / header.image
    try:
        with open_regular(place) as file:
            return read_picture(file, header.meaning.rules)
    except FormatError as error:
        problem = str(error)
    except Exception as error:  # noqa: BLE001 - a broken picture makes Pillow raise anything
        problem = f"the picture {place} cannot be read: {error}"
    raise FormatError(path, [(header.image_line, f"image: {problem}")])


PICTURE_FORMATS = ("PPM", "PNG", "BMP", "JPEG", "TIFF", "GIF")
"""Pillow knows more, some of which start other programs."""
NOETIC_FORMATS = ("PPM", "PNG", "JPEG")
"""Of the others SDL makes surfaces that depend on how they were packed."""
MOST_PIXELS = 100_000_000
PIXELS_A_STRIP = 2_000_000
"""So that temporary arrays stay small compared to a large picture."""


@dataclass(frozen=True, slots=True)
class DecodedPicture:
    """A decoded picture, handed out as its rows of pixels, the top row first."""

    width: int
    height: int
    alpha: bool
    """The last channel says how opaque a pixel is."""
    _rows: Callable[[int, int], Pixels]

    def strips(self) -> Iterator[tuple[int, Pixels]]:
        """Yield (first row, pixels of some rows): see `MapRules.cells`."""
        rows = max(1, PIXELS_A_STRIP // self.width)
        for top in range(0, self.height, rows):
            yield top, self._rows(top, min(self.height, top + rows))


def read_picture(file: BinaryIO, rules: RulesName) -> DecodedPicture:
    """Return the picture in a file as a server with those rules sees it.

    Raises:
        ValueError: It is no picture, too large, or of a kind that the server cannot read or that
            means something else to each; the message says which.
        Exception: Whatever Pillow raises of a broken file.
    """
    picture = _decoded(file)
    return (_as_sdl if rules == "noetic" else _as_magick)(picture, rules)


def _decoded(file: BinaryIO) -> Image:
    from PIL import Image, UnidentifiedImageError

    with warnings.catch_warnings():
        # Pillow warns a little below our limit and raises far above it.
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        try:
            picture = Image.open(file, formats=PICTURE_FORMATS)
        except UnidentifiedImageError as error:
            known = ", ".join(PICTURE_FORMATS)
            raise ValueError(f"expected a {known} of at least one pixel, got none") from error
        if picture.width * picture.height > MOST_PIXELS:
            raise ValueError(
                f"expected at most {MOST_PIXELS:,} pixels, "
                f"got {picture.width:,} x {picture.height:,}"
            )
        _check_scale(picture)
        picture.load()
    return picture


def _check_scale(picture: Image) -> None:
    """Raise for a PGM that does not count to 255 or 65535: no two servers take it for the same."""
    from PIL.ImageFile import ImageFile

    assert isinstance(picture, ImageFile)
    for _decoder, _box, _offset, args in picture.tile:
        most = args[-1] if picture.format == "PPM" and isinstance(args, tuple) else 255
        if isinstance(most, int) and most not in (255, 65535):
            raise ValueError(
                f"expected a greatest value of 255 or 65535 in its head, got {most}; "
                "the servers differ in how they spread it: save the picture with 255"
            )


def _as_sdl(picture: Image, _rules: RulesName) -> DecodedPicture:
    if picture.format not in NOETIC_FORMATS:
        raise ValueError(
            f"expected PGM, PNG or JPEG for the rules of noetic, got {picture.format}; "
            "save it as PGM"
        )
    if _is_deep(picture):
        if picture.format == "PPM":
            raise ValueError(
                "map_server of noetic reads no PGM of 16 bits; save it with 8, or as PNG"
            )
        return _of(picture, lambda rows: (_deep(rows) >> 8).astype(np.uint8))
    transparency = picture.info.get("transparency")
    if picture.format == "JPEG":
        return _of(picture, _as("RGB"))
    if picture.mode == "1":
        # A PBM's 1 is black, and SDL hands out the bit; a PNG's single bit is spread to 0 and 255.
        bit = picture.format == "PPM"
        return _of(picture, _pbm_bits if bit else _as("L"))
    if picture.mode == "P" and not isinstance(transparency, bytes):
        return _of(picture, np.asarray)
    if picture.mode == "L":
        return _of(picture, _as("L" if transparency is None else "LA"))
    if picture.mode == "RGB":
        return _of(picture, np.asarray)
    return _of(picture, _as("RGBA"), alpha=True)


def _as_magick(picture: Image, rules: RulesName) -> DecodedPicture:
    if _is_deep(picture):
        return _of(picture, _deep)
    if picture.mode not in ("1", "L", "LA", "P", "PA", "RGB", "RGBA", "CMYK", "YCbCr"):
        raise ValueError(f"expected 8 or 16 bits a channel, got Pillow's mode {picture.mode}")
    transparent = "A" in picture.getbands() or "transparency" in picture.info
    if not transparent:
        return _of(picture, _as("L" if picture.mode in ("1", "L") else "RGB"))
    if rules == "nav2_humble" and picture.mode == "LA":
        # It asks single pixels for their colour, and those of grey do not know how opaque they are.
        return _of(picture, _opaque, alpha=True)
    return _of(picture, _as("RGBA"), alpha=True)


def _of(
    picture: Image, converted: Callable[[Image], NDArray[Any]], *, alpha: bool = False
) -> DecodedPicture:
    def rows(top: int, bottom: int) -> Pixels:
        strip: Pixels = converted(picture.crop((0, top, picture.width, bottom)))
        return strip

    return DecodedPicture(picture.width, picture.height, alpha, rows)


def _as(mode: str) -> Callable[[Image], NDArray[np.uint8]]:
    return lambda strip: np.asarray(strip.convert(mode))


def _opaque(strip: Image) -> NDArray[np.uint8]:
    pixels = np.array(strip.convert("RGBA"))
    pixels[:, :, 3] = 255
    return pixels


def _pbm_bits(strip: Image) -> NDArray[np.uint8]:
    black: NDArray[np.bool_] = np.asarray(strip.convert("L")) == 0
    return black.astype(np.uint8)


def _is_deep(picture: Image) -> bool:
    """Return whether it has 16 bits of grey."""
    return picture.mode.startswith("I;16") or (
        picture.mode == "I" and picture.format in ("PPM", "PNG")
    )


def _deep(strip: Image) -> NDArray[np.uint16]:
    return np.asarray(strip).astype(np.uint16)


YamlKind = Literal["building", "map", "doors"]
MAP_KEYS = frozenset({"image", "resolution", "origin", "occupied_thresh", "free_thresh"})
"""Of map_server's header: any of them makes it a map, so that errors name what a map lacks."""
_TOP_KEY = re.compile(r"""^["']?(\w{1,31})["']?[ \t]{0,20}:(?=\s|$)""", re.MULTILINE)


def is_yaml(path: Path) -> bool:
    """Return whether a name is that of a YAML file."""
    return path.suffix.lower() in {".yaml", ".yml"}


def kind_of_yaml(path: Path) -> YamlKind:
    """Return what a file is: a building, a map, or else a door database.

    Only its uppermost keys are looked at; who reads the file says what is wrong with the rest.

    Raises:
        FormatError: It cannot be read; or it is a nav graph, which has keys of a building.
    """
    keys = _top_keys(path)
    if any(key.isdecimal() for key in keys):  # the ids of doors
        return "doors"
    if {"levels", "doors", "building_name"} <= keys:
        raise FormatError(
            path, "this is a nav graph, which Open-RMF made of a building; import the building, "
            "*.building.yaml: it has the walls, too",
        )  # fmt: skip
    if "levels" in keys:
        return "building"
    return "map" if keys & MAP_KEYS else "doors"


def _top_keys(path: Path) -> set[str]:
    """Return the keys of a file's outermost mapping.

    In block style they are those that begin a line: then nothing has to be parsed.
    """
    text = decode_utf8(read_capped(path, most_bytes=strict_yaml.MOST_BYTES), path)
    if not text.lstrip().startswith("{"):
        return set(_TOP_KEY.findall(text))
    root = strict_yaml.parse_yaml(text.encode(), path, takes_nan=True)
    return set(root.entries) if isinstance(root, strict_yaml.Mapping) else set()
