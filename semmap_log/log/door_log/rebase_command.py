"""The command by which a level has a new map, and the same asked without writing."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass

from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import Event, FloorMap
from semmap_log.core.model.rigid_transform import RigidTransform
from semmap_log.log.door_log.current_map import CurrentMap
from semmap_log.log.door_log.door_commands import WordedCommand
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.door_log.rebasing import MapStates, MeasuredDoor, RebasePlan, plan_rebase
from semmap_log.log.replay.replay import Scope, replay
from semmap_log.store.reading.reader import LogReader

DIGITS = 6
"""A fit gives other last bits on another processor: the command is the same by micrometres."""


@dataclass(frozen=True, slots=True)
class RebaseMap(WordedCommand):
    """A level is to have a new map, and its doors their places in it."""

    floor: FloorMap
    by: RigidTransform
    measured: Mapping[DoorId | str, MeasuredDoor]
    level: int | str | None

    def words(self) -> tuple[object, ...]:
        """Return the verb, and what it was given; of the map a digest of its cells."""
        floor = self.floor
        cells = (floor.cells.shape, hashlib.sha256(floor.cells.tobytes()).hexdigest())
        lies = (floor.resolution, floor.origin_x, floor.origin_y, floor.origin_theta)
        doors = sorted((str(door), tuple(at)) for door, at in self.measured.items())
        by = [round(number, DIGITS) for number in self.by.as_list()]
        return ("rebase", self.level or 0, lies, cells, by, doors)

    def events(self, now: CurrentMap) -> list[Event]:
        """Return the map, and each door's new place.

        Raises:
            CommandError: As for `plan_rebase`.
            UnknownDoorError: A measured door is not known.
        """
        at_ns = happened_ns = self._happened(now)
        if at_ns is None and now.state.latest_happened_ns > now.now_ns():
            happened_ns = now.state.latest_happened_ns  # the clock went back: all comes before it
        level = now.level_meant(self.level)
        then = now.state if at_ns is None else replay(now.reader, Scope(at_ns=at_ns))
        measured = {now.resolve(door): at for door, at in self.measured.items()}
        event = _floor_event(then, level)
        there = None if event is None else _floor(now.reader, event)
        states = MapStates(then, now.state, there, now.path)
        plan = plan_rebase(states, self.floor, self.by, measured, level=level)
        return list(plan.events(happened_ns))


def rebase_plan(
    log: DoorLog,
    floor: FloorMap,
    by: RigidTransform,
    measured: Mapping[DoorId, MeasuredDoor],
    *,
    level: int,
    at_ns: int | None = None,
    event: int | None = None,
) -> RebasePlan:
    """Return what `DoorLogWriter.rebase` would do to a log as it stands; nothing is written.

    Args:
        log: The log.
        floor: The new map.
        by: From the old map's frame to the new one's.
        measured: Doors that were measured again, in the new map's frame.
        level: The number of the level.
        at_ns: When the new map comes; None: now.
        event: Only events up to that number count; None: all.

    Raises:
        CommandError: As for `plan_rebase`.
    """
    now = log.state_in(Scope(event=event))
    then = now if at_ns is None else log.state_in(Scope(at_ns=at_ns, event=event))
    states = MapStates(then, now, log.floor_of(then.door_map(), level), log.path)
    return plan_rebase(states, floor, by, measured, level=level)


def _floor_event(state: DoorMapState, level: int) -> int | None:
    known = state.door_map().levels.get(level)
    return None if known is None else known.floor_map_event


def _floor(reader: LogReader, number: int) -> FloorMap:
    """Return the floor plan that an event carries."""
    event = reader.event(number).event
    assert isinstance(event, FloorMap)
    return event
