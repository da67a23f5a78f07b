"""A grid as a ROS map: `name.pgm` and `name.yaml`, which every server loads to the same cells.

Two modes can do that. `trinary` carries -1, 0 and 100 in the shades that map_saver writes (205, 254
and 0). `raw` carries every value, -1 as byte 255: noetic reads it as a signed byte, Nav2 takes all
above 100 for unknown. Mode `scale` cannot: for most values there is no shade that the servers grade
alike, and none of them means -1 in a picture without transparency.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import to_occupancy
from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.core.io.disk import (
    check_not_special,
    new_sibling,
    output_errors,
    sibling_name,
    sync_file,
    sync_folder,
)
from semmap_log.errors import CostmapError, OutputError

WrittenMode = Literal["trinary", "raw"]

_TRINARY_SHADES = {-1: 205, 0: 254, 100: 0}
_PLAIN_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")


def write_map(
    path: Path,
    occupancy: NDArray[np.int8],
    geometry: GridGeometry,
    *,
    mode: WrittenMode | None = None,
    comment: str = "",
) -> WrittenMode:
    """Write a map, both files or none; old ones of these names are replaced.

    Args:
        path: `name.pgm` or `name.yaml`; the other is written next to it.
        occupancy: int8, (height, width), row 0 at the lowest y; -1 unknown, 0 free .. 100 occupied.
        geometry: Where the cells lie.
        mode: Default: trinary where it can hold the values, else raw.
        comment: Written at the head of the .yaml, such as the moment shown.

    Returns:
        The mode it was written in.

    Raises:
        CostmapError: The mode cannot hold a value, or the grid has another shape than its geometry.
        OutputError: The files cannot be written; what was there before is as it was.
    """
    _check(occupancy, geometry)
    values = set(np.unique(occupancy).tolist())
    mode = mode or ("trinary" if values <= _TRINARY_SHADES.keys() else "raw")
    shades = _shades(mode, values)
    picture, header = path.with_suffix(".pgm"), path.with_suffix(".yaml")
    if path not in (picture, header):
        raise OutputError(f"{path}: expected a name that ends in .pgm or .yaml.")
    text = _header(picture.name, geometry, mode, comment)
    head = f"P5\n{geometry.width} {geometry.height}\n255\n".encode()
    with _both(picture, header) as (new_picture, new_header):
        with new_picture.open("wb") as file:
            file.write(head)
            # A picture's first row is its top.
            file.write(np.ascontiguousarray(shades[occupancy.view(np.uint8)][::-1]).data)
        new_header.write_text(text, encoding="utf-8")
    return mode


def write_costs(
    path: Path,
    costs: NDArray[np.uint8],
    geometry: GridGeometry,
    *,
    mode: WrittenMode | None = None,
    comment: str = "",
) -> WrittenMode:
    """Write a costmap as the map that costmap_2d publishes of it; see `write_map`.

    Args:
        path: `name.pgm` or `name.yaml`.
        costs: uint8, (height, width), row 0 at the lowest y.
        geometry: Where the cells lie.
        mode: Default: trinary where it can hold the values, else raw.
        comment: Written at the head of the .yaml.

    Raises:
        CostmapError: As `write_map`.
        OutputError: As `write_map`.
    """
    return write_map(path, to_occupancy(costs), geometry, mode=mode, comment=comment)


def _check(occupancy: NDArray[np.int8], geometry: GridGeometry) -> None:
    expected = (geometry.height, geometry.width)
    if occupancy.dtype != np.int8 or occupancy.shape != expected:
        raise CostmapError(
            f"a map's values: expected int8 {expected}, got {occupancy.dtype} {occupancy.shape}"
        )
    if not 1e-6 <= geometry.resolution <= 1e6:
        raise CostmapError(
            f"a map's resolution: expected 1e-6 to 1e6 metres, got {geometry.resolution}"
        )


def _shades(mode: str, values: set[int]) -> NDArray[np.uint8]:
    """Return the byte of each value, at the value's index as an unsigned byte."""
    known = {"trinary": _TRINARY_SHADES, "raw": {value: value & 0xFF for value in range(-1, 101)}}
    if mode not in known:
        raise CostmapError(
            f"a map's mode: expected trinary or raw, got {mode!r}; scale means other values in "
            "each server"
        )
    if strange := sorted(values - known[mode].keys()):
        instead = "; write it in mode raw" if mode == "trinary" else ""
        expected = "-1, 0 and 100" if mode == "trinary" else "-1 to 100"
        raise CostmapError(f"a map in mode {mode}: expected {expected}, got {strange[0]}{instead}")
    shades = np.zeros(256, np.uint8)
    for value, shade in known[mode].items():
        shades[value & 0xFF] = shade
    return shades


def _header(picture: str, geometry: GridGeometry, mode: str, comment: str) -> str:
    """Return the .yaml's text; every key that noetic asks for, and numbers without exponents."""
    if not picture.isprintable():
        raise OutputError(f"{picture!r}: expected a name of printable characters.")
    said = "".join(f"# {line}\n" for line in comment.splitlines() if line.isprintable())
    name = picture if _PLAIN_NAME.fullmatch(picture) else json.dumps(picture, ensure_ascii=False)
    origin = f"[{_number(geometry.origin_x)}, {_number(geometry.origin_y)}, 0.0]"
    return (
        f"{said}image: {name}\nmode: {mode}\nresolution: {_resolution(geometry.resolution)}\n"
        f"origin: {origin}\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def _number(value: float | np.float32) -> str:
    """Return the shortest text that reads back as the same number.

    Without an exponent: YAML 1.1 takes 1e-05 for a text.
    """
    return np.format_float_positional(value, unique=True, trim="0")


def _resolution(value: float) -> str:
    """Return a resolution's text: 0.05 also for the float32 next to it, which is what ROS keeps."""
    short = np.float32(value)
    return _number(short if float(short) == value else value)


@contextmanager
def _both(picture: Path, header: Path) -> Iterator[tuple[Path, Path]]:
    """Hand out temporary names for both; on success they take the real ones, else nothing changes.

    A header is never next to a picture that is not its own: the old header is removed first,
    and the new one is written last.
    """
    folder = picture.parent
    new: list[Path] = []
    with output_errors(header):
        try:
            for path in (picture, header):
                check_not_special(path)
                new.append(new_sibling(path))
            yield new[0], new[1]
            for path in new:
                sync_file(path)
            _swap([header, picture], [(new[0], picture), (new[1], header)])
            sync_folder(folder)
        finally:
            for path in new:
                with suppress(OSError):
                    path.unlink()


def _swap(old: list[Path], new: list[tuple[Path, Path]]) -> None:
    """Put the old files aside, the new ones in place; undo it all where one step fails."""
    for path in old:
        if path.is_dir():
            raise IsADirectoryError(0, "there is a folder of that name")
    done: list[tuple[Path, Path]] = []
    aside = [(path, sibling_name(path, ".old")) for path in old if os.path.lexists(path)]
    try:
        for source, target in aside + new:
            source.rename(target)
            done.append((source, target))
    except BaseException:
        for source, target in reversed(done):
            with suppress(OSError):
                target.rename(source)
        raise
    for _, target in aside:
        with suppress(OSError):
            target.unlink()
