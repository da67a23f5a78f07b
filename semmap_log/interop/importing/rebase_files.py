"""A rebase described by files: the new map, pairs of points, and doors that were measured again.

Of doors that were measured in the new map only the places count. Doors of the thesis's YAML are
known by their ids, those of a building by their names.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from semmap_log.core.folds import rebasing
from semmap_log.core.folds.door_index import resolve_door
from semmap_log.core.folds.levels import resolve_level
from semmap_log.core.model.doors import Door, DoorId, DoorMap
from semmap_log.core.model.events import FloorMap
from semmap_log.core.model.rigid_transform import RigidTransform
from semmap_log.errors import FormatError, UnknownDoorError
from semmap_log.interop.formats.files.building import DoorStart, read_building, read_pairs
from semmap_log.interop.formats.files.door_table import DoorTable, TableDoor
from semmap_log.interop.formats.files.map_server import is_yaml, kind_of_yaml
from semmap_log.interop.formats.files.thesis_yaml import read_thesis_yaml
from semmap_log.log import DoorLog, Scope

READABLE = ".yaml: a building of Open-RMF, or the thesis's door database"


@dataclass(frozen=True, slots=True)
class MeasuredDoors:
    """What a file says of the doors of a level."""

    doors: Mapping[DoorId, rebasing.MeasuredDoor]
    strangers: tuple[str, ...]
    """Doors of the file that the level does not have, with their lines."""


def read_measured_doors(path: Path, door_map: DoorMap, *, level: int) -> MeasuredDoors:
    """Return where a file puts the doors that a level has.

    Args:
        path: The file; its keys determine its format.
        door_map: The doors of the log, at the moment of the change.
        level: The number of the level.

    Raises:
        FormatError: The file cannot be read, is of another format, names a door twice, or none
            that the level has.
    """
    here = [door for door in door_map.doors.values() if door.level == level]
    found: dict[DoorId, rebasing.MeasuredDoor] = {}
    strangers = []
    for told, door in _met(_table(path, door_map, level), here):
        if door is None:
            strangers.append(f"{path}:{told.line}: {_called(told)}")
        elif door.door_id in found:
            raise FormatError(path, [(told.line, f"door {door.label} is there twice")])
        else:
            found[door.door_id] = rebasing.MeasuredDoor(told.x, told.y, told.theta, told.width)
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


NONE_MEASURED = MeasuredDoors({}, ())


@dataclass(frozen=True, slots=True)
class RebaseMoment:
    """What the log holds when the new map comes."""

    log: DoorLog
    door_map: DoorMap
    level: int
    """Whose map it is."""
    at_ns: int | None
    """None: now."""
    event: int | None
    """Only events up to that number count; None: all."""

    @classmethod
    def of(
        cls, log: DoorLog, level: str | None, *, at_ns: int | None, before_event: int | None = None
    ) -> RebaseMoment:
        """Return it.

        Args:
            log: The log.
            level: Number or name; None: the only one.
            at_ns: When the new map comes; None: now.
            before_event: The first event of the commit, if it is there already: what it was made
                of is what was there before.

        Raises:
            UnknownLevelError: There is no such level, or there are several and no level is given.
        """
        event = None if before_event is None else before_event - 1
        door_map = log.state_in(Scope(at_ns=at_ns, event=event)).door_map()
        now = log.state_in(Scope(event=event)).door_map()
        return cls(log, door_map, resolve_level(level, now), at_ns, event)

    def fit(
        self, pairs: Path, *, most_residual_m: float = rebasing.MOST_RESIDUAL_M
    ) -> rebasing.MapFit:
        """Return the transform that fits the pairs of a file, and how well; see `check_fit`.

        Raises:
            FormatError: The file cannot be read.
            CommandError: Its pairs do not determine a transform.
        """
        return rebasing.fit_maps(
            read_pairs(pairs, self._start_of()), most_residual_m=most_residual_m
        )

    def measured(self, path: Path | None) -> MeasuredDoors:
        """Return where a file puts the level's doors; None: there is no file.

        Raises:
            FormatError: It cannot be read, or has no door of the level.
        """
        if path is None:
            return NONE_MEASURED
        return read_measured_doors(path, self.door_map, level=self.level)

    def plan(
        self, floor: FloorMap, by: RigidTransform, measured: MeasuredDoors
    ) -> rebasing.RebasePlan:
        """Return what the rebase does.

        Raises:
            CommandError: As for `plan_rebase`.
        """
        log = self.log
        now = log.state_in(Scope(event=self.event))
        then = now if self.at_ns is None else log.state_in(Scope(self.at_ns, event=self.event))
        floor_now = log.floor_of(then.door_map(), self.level)
        states = rebasing.MapStates(then, now, floor_now, log.path)
        return rebasing.plan_rebase(states, floor, by, measured.doors, level=self.level)

    def _start_of(self) -> DoorStart:
        def start_of(text: str) -> tuple[float, float]:
            door = self.door_map.doors.get(resolve_door(text, self.door_map))
            if door is None or door.level != self.level or not door.is_placed:
                raise UnknownDoorError(
                    f"door {text!r}: expected one with a place on level "
                    f"{self.door_map.level_name(self.level)} before the new map came"
                )
            return door.start

        return start_of
