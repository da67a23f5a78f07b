"""The table that says which doors of which logs are one: `--doors matches.csv`."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from semmap_log.errors import FormatError, OutputError

COLUMNS = ("log", "door", "building door")


@dataclass(frozen=True, slots=True)
class DoorRow:
    """A door of a log, and what it is called in the building."""

    log: str
    """The log's name in the join."""
    door: str
    """Its id, name, or level/name in its own log."""
    building_door: str
    line: int = 0
    """Of the file; 0: from elsewhere."""


def read_door_rows(path: Path) -> list[DoorRow]:
    """Return the rows of a table.

    Raises:
        FormatError: It cannot be read, lacks a column, or has a cell that is empty.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file, strict=True)
            missing = [name for name in COLUMNS if name not in (reader.fieldnames or ())]
            if missing:
                expected = f"expected the columns {', '.join(COLUMNS)}"
                raise FormatError(path, [(1, f"{expected}; {', '.join(missing)} is not there")])
            return [_row(path, reader.line_num, cells) for cells in reader]
    except (OSError, csv.Error, UnicodeDecodeError) as error:
        said = error.strerror if isinstance(error, OSError) else str(error)
        raise FormatError(path, f"cannot be read: {said}") from None


def _row(path: Path, line: int, cells: dict[str, str | None]) -> DoorRow:
    log, door, building_door = ((cells[name] or "").strip() for name in COLUMNS)
    if not (log and door and building_door):
        got = {name: cells[name] for name in COLUMNS}
        raise FormatError(path, [(line, f"expected a log, a door and a building door, got {got}")])
    return DoorRow(log, door, building_door, line)


def write_door_rows(path: Path, rows: Iterable[DoorRow]) -> None:
    """Write a table.

    Raises:
        OutputError: It cannot be written, or something is there already.
    """
    try:
        with path.open("x", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows(_cells(rows))
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}.") from error


def _cells(rows: Iterable[DoorRow]) -> Iterator[tuple[str, ...]]:
    yield COLUMNS
    for row in rows:
        yield row.log, row.door, row.building_door
