"""A building was mapped anew: where each door of a level lies in the new map.

Everything in a log is in the frame `map`. A new map has another origin, and is turned against the
old one. From the moment of the change on, the level has the new floor plan, and its doors lie where
the transform puts them, or where they were measured again. What is told of earlier times stays as
it is, and belongs to the old plan. What is told of later times is in the new frame already.

Whether events that are given again are those that are stored.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import NamedTuple

import numpy as np

from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.messages import encode
from semmap_log.core.model.doors import NAN, Door, DoorId, DoorMap, is_given
from semmap_log.core.model.events import DoorAnnotated, DoorUpdated, Event, FloorMap
from semmap_log.core.model.meaning import PLACING, Changed
from semmap_log.core.model.rigid_transform import RigidTransform
from semmap_log.core.texts import command_line
from semmap_log.errors import CommandError


class MeasuredDoor(NamedTuple):
    """Where a door lies, as somebody measured it in the new map."""

    x: float
    y: float
    theta: float
    width: float = NAN
    """NaN: as it was."""


@dataclass(frozen=True, slots=True)
class MovedDoor:
    """A door, and where it lies in the new map."""

    before: Door
    """In the old one; unplaced, if it had no place."""
    after: Door
    is_measured: bool
    """It was measured again; else the transform puts it there."""
    off_m: float
    """How far a measured door starts from where the transform puts it; NaN: the transform did."""
    is_on_map: bool
    """Both ends of its line lie on the new map's cells."""


@dataclass(frozen=True, slots=True)
class RebasePlan:
    """What a rebase does, and what it leaves alone."""

    level: int
    floor: FloorMap
    """The new map."""
    by: RigidTransform
    """From the old map's frame to the new one's."""
    doors: tuple[MovedDoor, ...]
    """Ids ascending."""
    unplaced: tuple[DoorId, ...]
    """Doors of the level without a place, before and after."""
    elsewhere: tuple[DoorId, ...]
    """Doors of other levels."""
    placed_later: tuple[DoorId, ...]
    """Doors that were put in their places after that moment: they lie in the new map already."""

    def events(self, happened_ns: int | None) -> Iterator[Event]:
        """Yield the events of the one commit: the map, then each door's place."""
        yield replace(self.floor, level=self.level, happened_ns=happened_ns)
        for door in self.doors:
            after = door.after
            sets = Changed.POSE if after.width == door.before.width else PLACING
            yield DoorUpdated(
                door_id=after.door_id, changed=sets, level=self.level, x=after.x, y=after.y,
                theta=after.theta, width=after.width, happened_ns=happened_ns,
            )  # fmt: skip


@dataclass(frozen=True, slots=True)
class MapStates:
    """The door map at the moment of the change, and with all that is told of later times."""

    then: DoorMapState
    now: DoorMapState
    there: FloorMap | None
    """The floor plan of the level at that moment."""
    log: PurePath
    """Where the log is, for messages."""


def plan_rebase(
    states: MapStates,
    floor: FloorMap,
    by: RigidTransform,
    measured: Mapping[DoorId, MeasuredDoor],
    *,
    level: int,
) -> RebasePlan:
    """Return where the doors of a level lie in a new map.

    Args:
        states: The doors, before and after.
        floor: The new map.
        by: From the old map's frame to the new one's.
        measured: Doors that were measured again, in the new map's frame.
        level: The number of the level.

    Raises:
        CommandError: The level has that very map already, or another from a later time; or a
            measured door is not on it then.
    """
    then = states.then.door_map()
    _check_map(states, then, floor, level)
    here = {i: door for i, door in then.doors.items() if door.level == level}
    _check_measured(measured, here, then, level)
    moved = [_moved(door, by, measured.get(i), floor) for i, door in here.items()]
    later = {i for i in states.now.door_map().doors if _is_placed_later(states, i)}
    return RebasePlan(
        level=level, floor=floor, by=by,
        doors=tuple(door for door in moved if door.after.is_placed),
        unplaced=tuple(door.after.door_id for door in moved if not door.after.is_placed),
        elsewhere=tuple(i for i, door in then.doors.items() if door.level != level),
        placed_later=tuple(sorted(i for i in later if states.now.door_map()[i].level == level)),
    )  # fmt: skip


def _check_map(states: MapStates, then: DoorMap, floor: FloorMap, level: int) -> None:
    """Return if the new map can come: rebasing to the same one again would move doors twice."""
    name = then.level_name(level)
    if states.there is not None and are_same([replace(floor, level=level)], [states.there]):
        number = then.levels[level].floor_map_event
        back = command_line("retract", states.log, str(number))
        raise CommandError(
            f"level {name} has this very map already, by event {number}: its doors would be moved "
            f"twice. If the map came without its doors, take it back, and call again: {back}"
        )
    known = states.now.door_map().levels.get(level)
    before = then.levels.get(level)
    later = None if known is None else known.floor_map_event
    if later is not None and (before is None or before.floor_map_event != later):
        raise CommandError(
            f"level {name} has another floor map from a later time, by event {later}; expected a "
            "moment behind it: leave --at out, or give a later one."
        )


def _check_measured(
    measured: Mapping[DoorId, MeasuredDoor], here: Mapping[DoorId, Door], then: DoorMap, level: int
) -> None:
    for door_id, at in measured.items():
        if door_id not in here:
            what = f"is on level {then.doors[door_id].level}" if door_id in then.doors else "is not"
            raise CommandError(
                f"door {door_id} {what} in the map at that moment; expected measured doors of "
                f"level {then.level_name(level)} alone."
            )
        if not all(map(math.isfinite, at[:3])) or (
            math.isnan(at.width) and not here[door_id].is_placed
        ):
            raise CommandError(
                f"door {door_id}: expected a measured door with finite x, y and theta, and with a "
                f"width where it had no place, got {tuple(at)}."
            )


def _is_placed_later(states: MapStates, door_id: DoorId) -> bool:
    """Tell whether what put a door in its place happened after the moment of the change."""
    placed = states.now.stamp(door_id, "pose")
    return placed is not None and placed != states.then.stamp(door_id, "pose")


def _moved(
    door: Door, by: RigidTransform, measured: MeasuredDoor | None, floor: FloorMap
) -> MovedDoor:
    x, y, theta = by.moved(door.x, door.y, door.theta)
    after = replace(door, x=float(x), y=float(y), theta=float(theta))
    off_m = NAN
    if measured is not None:
        off_m = math.hypot(measured.x - after.x, measured.y - after.y)
        width = door.width if math.isnan(measured.width) else measured.width
        after = replace(door, x=measured.x, y=measured.y, theta=measured.theta, width=width)
    is_on_map = all(_is_on(floor, *end) for end in (after.start, after.end))
    return MovedDoor(door, after, measured is not None, off_m, is_on_map)


def _is_on(floor: FloorMap, x: float, y: float) -> bool:
    """Tell whether a point lies on a floor map's cells, which may be turned about their corner."""
    cos, sin = math.cos(floor.origin_theta), math.sin(floor.origin_theta)
    right, up = x - floor.origin_x, y - floor.origin_y
    rows, columns = floor.cells.shape
    along, across = cos * right + sin * up, cos * up - sin * right
    is_on: bool = 0 <= along < columns * floor.resolution and 0 <= across < rows * floor.resolution
    return is_on


SAME_ANGLE = 1e-6
"""Radians: what going through a quaternion may change."""


def are_same(given: Sequence[Event], stored: Sequence[Event]) -> bool:
    """Tell whether events that are given are those that are stored.

    Salts do not count, nor when it happened, or on which level, where that was not given: the log
    said it.
    """
    return len(given) == len(stored) and all(map(_is_same, given, stored))


def _is_same(given: Event, stored: Event) -> bool:
    if type(given) is not type(stored):
        return False
    if given.happened_ns not in (None, stored.happened_ns):
        return False
    if not is_given(getattr(given, "level", 0)):  # the log said it
        given = replace(given, level=stored.level)  # type: ignore[call-arg,attr-defined]
    if isinstance(given, FloorMap) and isinstance(stored, FloorMap):
        return _is_same_map(given, stored)
    return encode(_unsalted(given), 0) == encode(_unsalted(stored), 0)


def _is_same_map(given: FloorMap, stored: FloorMap) -> bool:
    """Compare two floor plans; the angle of one that is stored went through a quaternion."""
    return (
        given.level == stored.level
        and np.float32(given.resolution) == np.float32(stored.resolution)
        and (given.origin_x, given.origin_y) == (stored.origin_x, stored.origin_y)
        and abs(math.remainder(given.origin_theta - stored.origin_theta, math.tau)) < SAME_ANGLE
        and np.array_equal(given.cells, stored.cells)
    )


def _unsalted(event: Event) -> Event:
    return replace(event, salt=b"") if isinstance(event, DoorAnnotated) else event
