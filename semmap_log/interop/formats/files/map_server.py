"""ROS maps (`map.yaml` with its picture), read cell for cell as ROS's own servers read them.

The servers differ, so their rules go by name: `nav2`, the default, is Nav2 as it is today;
`nav2_humble` Nav2 before 2025; `noetic` the map_server of ROS 1. What each makes of a pixel is in
`costmap_2d/map_rules.py`, what each sees of a picture in `map_picture.py`. Of the header, noetic
knows `negate` as a number and `mode` in small letters only; Nav2 also takes true, false, capitals.

More is refused here than there: thresholds that are not 0 <= free <= occupied <= 1 (the servers
serve a grid of nonsense), a resolution that is not above 0, a number that is not finite. An
origin's yaw is kept in the floor plan; a costmap has none (`GridGeometry.of_floor`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.map_rules import MODES, MapRules, Mode, RulesName
from semmap_log.core.model.events import FloorMap
from semmap_log.errors import FormatError
from semmap_log.interop.formats.files.map_picture import DecodedPicture, read_picture
from semmap_log.interop.formats.files.yaml_kinds import is_yaml, kind_of_yaml
from semmap_log.interop.formats.parsing.foreign_file import open_regular
from semmap_log.interop.formats.parsing.problems import Problems
from semmap_log.interop.formats.parsing.strict_yaml import Scalar, load_yaml
from semmap_log.interop.formats.parsing.yaml_values import Fields, mapping_of

DEFAULT_RULES: RulesName = "nav2"


def read_map(path: Path, *, level: int = 0, rules: RulesName = DEFAULT_RULES) -> FloorMap:
    """Return the map as a floor plan of that level.

    Args:
        path: The `.yaml` file; its picture is looked for beside it.
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
    """Tell whether a file is the `.yaml` of a map, by its keys.

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
    root = mapping_of(load_yaml(path, takes_nan=True), "a map", problems)
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
    value = node.value if isinstance(node, Scalar) else None
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
