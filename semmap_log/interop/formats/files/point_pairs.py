"""Points that were measured in two maps, as CSV: `old_x,old_y,new_x,new_y[,name]`, metres.

In place of the old point a row may name a door, whose line starts there: `door,new_x,new_y`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path

from semmap_log.errors import UnknownDoorError
from semmap_log.interop.formats.files.csv_blocks import read_rows
from semmap_log.interop.formats.files.csv_rows import Row
from semmap_log.interop.formats.parsing.csv_text import meant
from semmap_log.interop.formats.parsing.foreign_file import numbered_lines
from semmap_log.interop.formats.parsing.problems import Problems, shown
from semmap_log.log.door_log.map_fit import PointPair

OLD, NEW = ("old_x", "old_y"), ("new_x", "new_y")
MOST_LINE_BYTES = 65_536

DoorStart = Callable[[str], tuple[float, float]]
"""Gives where the line of a door starts in the old map, by its id or name."""


def read_pairs(path: Path, start_of: DoorStart) -> list[PointPair]:
    """Return the pairs of a file, in its order; one without a name is called by its line.

    Args:
        path: The CSV file.
        start_of: Where doors are in the old map; may raise `UnknownDoorError`.

    Raises:
        FormatError: The file cannot be read, or a row is wrong; names the lines.
    """
    problems = Problems(path)
    _, header = next(numbered_lines(path, most_bytes=MOST_LINE_BYTES), (1, ""))
    if "door" in [name.strip().lower() for name in header.split(",")]:
        pairs = list(_of_doors(path, problems, start_of))
    else:
        pairs = list(_of_points(path, problems))
    problems.raise_any()
    return pairs


def _of_points(path: Path, problems: Problems) -> Iterator[PointPair]:
    for row in _rows(path, problems, required=(*OLD, *NEW), optional=("name",)):
        numbers = [_metres(row, at, problems, (*OLD, *NEW)[at]) for at in range(4)]
        yield PointPair(meant(row.texts[4]) or f"line {row.line}", *numbers)


def _of_doors(path: Path, problems: Problems, start_of: DoorStart) -> Iterator[PointPair]:
    for row in _rows(path, problems, required=("door", *NEW), optional=()):
        new = [_metres(row, at, problems, ("door", *NEW)[at]) for at in (1, 2)]
        door = meant(row.texts[0].strip())
        try:
            yield PointPair(door, *start_of(door), *new)
        except UnknownDoorError as error:
            problems.add(row.line, str(error))


def _rows(
    path: Path, problems: Problems, *, required: tuple[str, ...], optional: tuple[str, ...]
) -> Iterator[Row]:
    for rows in read_rows(path, problems, required=required, optional=optional):
        yield from rows


def _metres(row: Row, at: int, problems: Problems, name: str) -> float:
    try:
        value = float(row.texts[at])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        problems.add(row.line, f"{name}: expected metres, got {shown(row.texts[at])}")
    return value
