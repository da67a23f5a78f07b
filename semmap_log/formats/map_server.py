"""ROS maps (`map.yaml` with its picture), read as map_server and Nav2 read them.

A pixel's shade is the mean of its channels; its occupancy is 1 - shade, or the shade with
`negate`. Above `occupied_thresh` a cell is 100, below `free_thresh` 0; what lies between is -1 in
mode trinary (the default) and 0..100 in mode scale. In mode raw the pixel's byte is the cell,
-1 where it is above 100. Transparency counts as one more channel in mode trinary and makes a cell
-1 in mode scale. The two servers differ in details; where they do, this follows Nav2.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.typing import NDArray

from semmap_log.errors import FormatError
from semmap_log.events import FloorMap
from semmap_log.formats.files import open_regular
from semmap_log.formats.problems import Problems
from semmap_log.formats.strict_yaml import Scalar, load_yaml
from semmap_log.formats.yaml_values import Fields, mapping_of

if TYPE_CHECKING:
    from PIL.Image import Image

MODES = ("trinary", "scale", "raw")
PICTURE_FORMATS = ("PPM", "PNG", "BMP", "JPEG", "TIFF", "GIF")
"""Pillow knows more, some of which start other programs."""
MOST_PIXELS = 100_000_000


def read_map(path: Path, *, level: int = 0) -> FloorMap:
    """Return the map as a floor plan of that level.

    Args:
        path: The `.yaml` file; its picture is looked for beside it.
        level: The number of the level it shows.

    Raises:
        FormatError: The file or its picture cannot be read, or is not such a map.
    """
    header = _read_header(path)
    picture = _open_picture(header, path)
    cells = _cells(picture, header)
    x, y, theta = header.origin
    return FloorMap(
        level=level,
        # The log stores float32, as nav_msgs/MapMetaData does.
        resolution=float(np.float32(header.resolution)),
        origin_x=x, origin_y=y, origin_theta=theta,
        # A picture's first row is its top; the grid's first row is its lowest y.
        cells=np.ascontiguousarray(cells[::-1]),
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Header:
    """What the .yaml says."""

    image: str
    image_line: int
    resolution: float
    origin: tuple[float, ...]
    negate: bool
    occupied_thresh: float
    free_thresh: float
    mode: str


def _read_header(path: Path) -> _Header:
    problems = Problems(path)
    root = mapping_of(load_yaml(path), "a map", problems)
    problems.raise_any()
    assert root is not None
    fields = Fields("a map", root, problems)
    header = _Header(
        image=fields.text("image"),
        image_line=root.key_lines.get("image", root.line),
        resolution=fields.number("resolution"),
        origin=fields.numbers("origin", "x y yaw"),
        negate=_negate(fields),
        occupied_thresh=fields.number("occupied_thresh"),
        free_thresh=fields.number("free_thresh"),
        mode=_mode(fields),
    )
    if not (math.isnan(header.resolution) or 1e-6 <= header.resolution <= 1e6):
        fields.refuse("resolution", "a number of metres a cell, above 0")
    if header.free_thresh > header.occupied_thresh:
        fields.refuse("free_thresh", f"at most occupied_thresh ({header.occupied_thresh:g})")
    problems.raise_any()
    return header


def _negate(fields: Fields) -> bool:
    node = fields.node("negate")
    value = node.value if isinstance(node, Scalar) else None
    if node is not None and value not in (0, 1):
        fields.refuse("negate", "0 or 1")
    return bool(value)


def _mode(fields: Fields) -> str:
    if "mode" not in fields.mapping.entries:
        return "trinary"
    mode = fields.text("mode").lower()
    if mode not in MODES:
        fields.refuse("mode", f"one of {', '.join(MODES)}")
    return mode


def _open_picture(header: _Header, path: Path) -> Image:
    """Return the picture, decoded."""
    place = path.parent / header.image
    try:
        with open_regular(place) as file:
            return _decoded(file)
    except FormatError as error:
        problem = str(error)
    except Exception as error:  # noqa: BLE001 - a broken picture makes Pillow raise anything
        problem = f"the picture {place} cannot be read: {error}"
    raise FormatError(path, [(header.image_line, f"image: {problem}")])


def _decoded(file: BinaryIO) -> Image:
    from PIL import Image

    with warnings.catch_warnings():
        # Pillow warns a little below our limit and raises far above it.
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        picture = Image.open(file, formats=PICTURE_FORMATS)
        if picture.width * picture.height > MOST_PIXELS:
            raise ValueError(
                f"expected at most {MOST_PIXELS:,} pixels, "
                f"got {picture.width:,} x {picture.height:,}"
            )
        picture.load()
    return picture


def _cells(picture: Image, header: _Header) -> NDArray[np.int8]:
    """Return the cells, int8, the picture's top row first.

    All channels of a pixel are summed, and what a sum means is looked up: there are few sums.
    """
    sums, highest, opaque = _sums(picture, header)
    shade = np.arange(highest + 1) / highest
    if header.mode == "raw":
        byte = np.rint(shade * 255)
        return np.where(byte <= 100, byte, -1).astype(np.int8)[sums]
    occupancy = shade if header.negate else shade[::-1]  # 1 - shade, without rounding
    meaning = np.full(highest + 1, -1.0)
    if header.mode == "scale":
        span = header.occupied_thresh - header.free_thresh
        meaning = np.rint((occupancy - header.free_thresh) / (span or 1.0) * 100)
    meaning[occupancy > header.occupied_thresh] = 100
    meaning[occupancy < header.free_thresh] = 0
    cells = meaning.astype(np.int8)[sums]
    if header.mode == "scale" and opaque is not None:
        cells[~opaque] = -1
    return cells


def _sums(
    picture: Image, header: _Header
) -> tuple[NDArray[np.uint16], int, NDArray[np.bool_] | None]:
    """Return each pixel's sum of channels, the highest sum there can be, and which are opaque."""
    if picture.mode.startswith("I"):  # 16 bits of grey
        return np.clip(np.asarray(picture), 0, 65535).astype(np.uint16), 65535, None
    if picture.mode in ("1", "L"):
        return np.asarray(picture.convert("L")).astype(np.uint16), 255, None
    transparent = "A" in picture.getbands() or "transparency" in picture.info
    if not transparent:
        return np.asarray(picture.convert("RGB")).sum(axis=2, dtype=np.uint16), 3 * 255, None
    channels = np.asarray(picture.convert("RGBA"))
    opaque = channels[:, :, 3] == 255
    if header.mode == "trinary":
        return channels.sum(axis=2, dtype=np.uint16), 4 * 255, opaque
    return channels[:, :, :3].sum(axis=2, dtype=np.uint16), 3 * 255, opaque
