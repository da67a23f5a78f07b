"""What the log knows, as far as messages are compared with it, and as it is after each event."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from semmap_log.appendable_log import AppendableLog
from semmap_log.door_log import DoorLog
from semmap_log.doors import Door, DoorId, DoorMap, DoorState, Level, next_door_id
from semmap_log.errors import UnknownDoorError
from semmap_log.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorUpdated,
    Event,
    FloorMap,
    LevelAdded,
    PatrolFinished,
    PatrolStarted,
)
from semmap_log.levels import resolve_level
from semmap_log.replay import replay


@dataclass(slots=True)
class Known:
    """The doors that are there, and what else messages are measured by."""

    doors: dict[int, Door] = field(default_factory=dict)
    """Those in the map."""
    used_ids: set[int] = field(default_factory=set)
    """Every id that was ever given."""
    added_ns: dict[int, int] = field(default_factory=dict)
    """When a door came into the map."""
    level_names: dict[int, str] = field(default_factory=dict)
    floor_maps: dict[int, FloorMap] = field(default_factory=dict)
    """By the level; those that are looked up."""
    last_started: int = 0
    """The greatest number of a round that began."""
    last_finished: int = 0
    _named: dict[str, set[int]] = field(default_factory=dict)
    greatest_id: int = 0

    @classmethod
    def of(cls, log: DoorLog) -> Known:
        """Return what a log knows now."""
        state = log.state if isinstance(log, AppendableLog) else replay(log.reader)
        known = cls.of_map(state.door_map())
        known.used_ids |= state.used_door_ids
        known.greatest_id = max(known.used_ids, default=0)
        for door_id in known.doors:
            stamp = state.stamp(door_id, "added")
            known.added_ns[door_id] = stamp[0] if stamp else 0
        for level in state.door_map().levels.values():
            if level.floor_map_event is not None:
                drawn = log.event(level.floor_map_event).event
                assert isinstance(drawn, FloorMap)
                known.floor_maps[level.level] = drawn
        known.last_started = _last_patrol(log, PatrolStarted)
        known.last_finished = _last_patrol(log, PatrolFinished)
        return known

    @classmethod
    def of_map(cls, door_map: DoorMap) -> Known:
        """Return what is known of doors as values."""
        known = cls()
        for level in door_map.levels.values():
            known.level_names[level.level] = level.name or ""
        for door in door_map.doors.values():
            known._put(door)
        return known

    @classmethod
    def of_levels(cls, other: Known) -> Known:
        """Return what is known of levels, to stay as it is now."""
        doors = {i: door for i, door in other.doors.items() if door.is_placed}
        return cls(doors=doors, level_names=dict(other.level_names))

    @property
    def next_id(self) -> DoorId:
        """The id after the greatest that was ever given: see `next_door_id`."""
        return self.next_id_but(frozenset())

    def next_id_but(self, others: Collection[int]) -> DoorId:
        """Return a new id that is none of some others that want to stay free."""
        return next_door_id(self.used_ids | {*map(DoorId, others)}, self.greatest_id)

    def called(self, text: str, *, or_id: bool = True) -> DoorId | None:
        """Return the door of that name, level/name or id; None: there is none.

        Args:
            text: What it is called.
            or_id: People write an id, too; a robot's own names are names, even if they are digits.

        Raises:
            UnknownDoorError: It can mean several.
        """
        found = set(self._named.get(text, ()))
        if not found and "/" in text:
            level, _, name = text.partition("/")
            found = {
                i for i in self._named.get(name, ()) if level in self._names_of(self.doors[i].level)
            }
        if not found and or_id and text.isdecimal() and int(text) in self.doors:
            found = {int(text)}
        if len(found) > 1:
            ids = ", ".join(map(str, sorted(found)))
            raise UnknownDoorError(f"can mean doors {ids}; write level/name, or the id")
        return DoorId(next(iter(found))) if found else None

    def level(self, text: str | None) -> int:
        """Return the level of that number or name; None: the only one there is.

        Raises:
            UnknownLevelError: There is none, or there are several.
        """
        levels = {n: Level(n, name or None) for n, name in sorted(self.level_names.items())}
        doors = {DoorId(door_id): door for door_id, door in self.doors.items()}
        return resolve_level(text, DoorMap(doors, levels))

    def apply(self, event: Event) -> None:
        """Take in what an event changes."""
        match event:
            case DoorAdded():
                self._add(event)
            case DoorUpdated() if event.door_id in self.doors:
                self._put(_updated(self.doors[event.door_id], event))
            case DoorObserved() | DoorPassed() if event.door_id in self.doors:
                self._see(event)
            case DoorAnnotated() if event.door_id in self.doors:
                door = self.doors[event.door_id]
                self._put(replace(door, annotations={**door.annotations, event.key: event.value}))
            case DoorRemoved():
                self._forget(event.door_id)
            case LevelAdded():
                self.level_names[event.level] = event.name
            case FloorMap():
                self.level_names.setdefault(event.level, "")
                self.floor_maps[event.level] = event
            case PatrolStarted():
                self.last_started = max(self.last_started, event.patrol)
            case PatrolFinished():
                self.last_finished = max(self.last_finished, event.patrol)

    def _add(self, event: DoorAdded) -> None:
        self.used_ids.add(event.door_id)
        self.greatest_id = max(self.greatest_id, event.door_id)
        self.added_ns[event.door_id] = event.happened_ns or 0
        self._put(
            Door(
                event.door_id, event.level, event.x, event.y, event.theta, event.width,
                event.state, event.prob_open, event.prob_closed, event.happened_ns,
            )
        )  # fmt: skip

    def _see(self, event: DoorObserved | DoorPassed) -> None:
        door = self.doors[event.door_id]
        happened_ns = event.happened_ns or 0
        if (door.last_seen_ns or 0) > happened_ns:
            return  # something later is known
        if isinstance(event, DoorObserved):
            self._put(replace(door, state=event.state, last_seen_ns=happened_ns))
        elif event.passed:
            self._put(replace(door, state=DoorState.OPEN, last_seen_ns=happened_ns))

    def _put(self, door: Door) -> None:
        before = self.doors.get(door.door_id)
        if before is None or before.name != door.name:
            if before is not None and before.name:
                self._named[before.name].discard(door.door_id)
            if door.name:
                self._named.setdefault(door.name, set()).add(door.door_id)
        self.doors[door.door_id] = door

    def _forget(self, door_id: DoorId) -> None:
        door = self.doors.pop(door_id, None)
        if door is not None and door.name:
            self._named[door.name].discard(door_id)

    def _names_of(self, level: int) -> tuple[str, str]:
        return str(level), self.level_names.get(level) or str(level)


def _updated(door: Door, event: DoorUpdated) -> Door:
    """Return the door with the fields that an update sets."""
    values: dict[str, object] = {}
    for bit, names in _FIELDS.items():
        if bit in event.changed:
            values |= {name: getattr(event, name) for name in names}
    if Changed.STATE in event.changed:
        values["last_seen_ns"] = event.happened_ns
    return replace(door, **values)  # type: ignore[arg-type]


_FIELDS: Mapping[Changed, tuple[str, ...]] = {
    Changed.POSE: ("x", "y", "theta", "level"),
    Changed.WIDTH: ("width",),
    Changed.STATE: ("state",),
    Changed.PROB_OPEN: ("prob_open",),
    Changed.PROB_CLOSED: ("prob_closed",),
}


def _last_patrol(log: DoorLog, kind: type[PatrolStarted | PatrolFinished]) -> int:
    numbers = [batch[kind]["patrol"] for batch in log.batches(kinds=[kind])]
    return int(np.concatenate(numbers).max()) if numbers else 0
