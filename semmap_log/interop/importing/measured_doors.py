"""Doors of a file as somebody measured them in a new map: their places, and nothing else of them.

Doors of the thesis's YAML are known by their ids, those of a building by their names.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from semmap_log.core.model.doors import Door, DoorId, DoorMap
from semmap_log.errors import FormatError
from semmap_log.interop.formats.files.building import read_building
from semmap_log.interop.formats.files.door_table import DoorTable, TableDoor
from semmap_log.interop.formats.files.thesis_yaml import read_thesis_yaml
from semmap_log.interop.formats.files.yaml_kinds import is_yaml, kind_of_yaml
from semmap_log.log.door_log.rebasing import MeasuredDoor

READABLE = ".yaml: a building of Open-RMF, or the thesis's door database"


@dataclass(frozen=True, slots=True)
class MeasuredDoors:
    """What a file says of the doors of a level."""

    doors: Mapping[DoorId, MeasuredDoor]
    strangers: tuple[str, ...]
    """Doors of the file that the level does not have, with their lines."""


def read_measured_doors(path: Path, door_map: DoorMap, *, level: int) -> MeasuredDoors:
    """Return where a file puts the doors that a level has.

    Args:
        path: The file; its keys tell its format.
        door_map: The doors of the log, at the moment of the change.
        level: The number of the level.

    Raises:
        FormatError: The file cannot be read, is of another format, names a door twice, or none
            that the level has.
    """
    here = [door for door in door_map.doors.values() if door.level == level]
    found: dict[DoorId, MeasuredDoor] = {}
    strangers = []
    for told, door in _met(_table(path, door_map, level), here):
        if door is None:
            strangers.append(f"{path}:{told.line}: {_called(told)}")
        elif door.door_id in found:
            raise FormatError(path, [(told.line, f"door {door.label} is there twice")])
        else:
            found[door.door_id] = MeasuredDoor(told.x, told.y, told.theta, told.width)
    if not found:
        name = door_map.level_name(level)
        raise FormatError(path, f"expected doors of level {name} of the log, found none of them.")
    return MeasuredDoors(found, tuple(strangers))


def _table(path: Path, door_map: DoorMap, level: int) -> DoorTable:
    kind = kind_of_yaml(path) if is_yaml(path) else None
    if kind == "building":
        known = door_map.levels.get(level)
        return read_building(path, level=known.name if known else None)
    if kind == "doors":
        return read_thesis_yaml(path)
    raise FormatError(path, f"expected measured doors as {READABLE}.")


def _met(table: DoorTable, here: list[Door]) -> Iterator[tuple[TableDoor, Door | None]]:
    by_id = {door.door_id: door for door in here}
    by_name = {door.name: door for door in here if door.name}
    for told in table.doors:
        if math.isnan(told.x):
            continue
        door_id = told.door_id
        name = told.annotations.get("name", "")
        yield told, by_name.get(name) if door_id is None else by_id.get(door_id)


def _called(told: TableDoor) -> str:
    return f"door {told.door_id}" if told.door_id is not None else told.annotations.get("name", "")
