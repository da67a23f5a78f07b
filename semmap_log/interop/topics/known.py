"""What the log knows, as far as messages are compared with it, and as it is after each event."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.doors import Door, DoorId, DoorMap, next_door_id
from semmap_log.core.model.events import (
    ClassDefined,
    DoorAnnotated,
    DoorEvent,
    Event,
    FloorMap,
    PatrolFinished,
    PatrolStarted,
)
from semmap_log.core.model.meaning import Presence
from semmap_log.errors import UnknownDoorError
from semmap_log.log.door_log.door_log import DoorLog


class Known:
    """The doors that are there, and what else messages are measured by."""

    def __init__(self, state: DoorMapState | None = None) -> None:
        """Begin with a state, which is changed from here on."""
        self._state = state or DoorMapState()
        self.floor_maps: dict[int, FloorMap] = {}
        """By the level; those that are looked up."""
        self.last_started = 0
        """The greatest number of a round that began."""
        self.last_finished = 0
        self._doors: dict[int, Door] = {
            door.door_id: door for door in self._state.door_map().doors.values()
        }
        self._stale: set[int] = set()
        """Doors that an event was about since they were made."""
        self._named: dict[str, set[int]] = {}
        for door in self._doors.values():
            self._call(door.door_id, None, door.name)

    @classmethod
    def of(cls, log: DoorLog) -> Known:
        """Return what a log knows now."""
        state = log.state_in()
        known = cls(state)
        for level in state.door_map().levels.values():
            if level.floor_map_event is not None:
                drawn = log.event(level.floor_map_event).event
                assert isinstance(drawn, FloorMap)
                known.floor_maps[level.level] = drawn
        known.last_started = log.last_patrol(PatrolStarted)
        known.last_finished = log.last_patrol(PatrolFinished)
        return known

    @property
    def doors(self) -> Mapping[int, Door]:
        """Those in the map."""
        for door_id in self._stale:
            door = self._state.door(door_id)
            if door is None:
                self._doors.pop(door_id, None)
            else:
                self._doors[door_id] = door
        self._stale.clear()
        return self._doors

    @property
    def used_ids(self) -> Collection[int]:
        """Every id that was ever given."""
        return self._state.used_door_ids

    def added_ns(self, door_id: int) -> int:
        """Return when a door came into the map; 0: that is not known."""
        stamp = self._state.stamp(door_id, "added")
        return stamp[0] if stamp else 0

    @property
    def next_id(self) -> DoorId:
        """The id after the greatest that was ever given: see `next_door_id`."""
        return self.next_id_but(frozenset())

    def next_id_but(self, others: Collection[int]) -> DoorId:
        """Return a new id that is none of some others that want to stay free."""
        return next_door_id({*self.used_ids, *others}, max(self.used_ids, default=0))

    def called(self, text: str, *, or_id: bool = True, level: str | None = None) -> DoorId | None:
        """Return the door of that name, level/name or id; None: there is none.

        Args:
            text: What it is called.
            or_id: People write an id, too; a robot's own names are names, even if they are digits.
            level: Number or name of the level that is meant where several have the name.

        Raises:
            UnknownDoorError: It can mean several.
        """
        found = set(self._named.get(text, ()))
        if len(found) > 1 and level is not None:
            found = {i for i in found if level in self._names_of_level(i)}
        if not found and "/" in text:
            level, _, name = text.partition("/")
            found = {i for i in self._named.get(name, ()) if level in self._names_of_level(i)}
        if not found and or_id and text.isdecimal() and self._state.is_present(int(text)):
            found = {int(text)}
        if len(found) > 1:
            ids = ", ".join(map(str, sorted(found)))
            raise UnknownDoorError(f"can mean doors {ids}; write level/name, or the id")
        return DoorId(next(iter(found))) if found else None

    def door_map(self) -> DoorMap:
        """Return the map as it is now, whatever is applied later."""
        return self._state.door_map()

    def apply(self, event: Event) -> None:
        """Take in what an event changes; one without a time happens last of all."""
        if event.happened_ns is None:
            event = replace(event, happened_ns=self._state.latest_happened_ns)
        before = self._name_of(event)
        self._state.apply_one(event, self._state.event + 1)
        if isinstance(event, DoorEvent):
            self._stale.add(event.door_id)
            self._call(event.door_id, before, self._name_of(event))
        elif isinstance(event, ClassDefined):
            self._stale.update(self._doors)
        elif isinstance(event, FloorMap):
            self.floor_maps[event.level] = event
        elif isinstance(event, PatrolStarted):
            self.last_started = max(self.last_started, event.patrol)
        elif isinstance(event, PatrolFinished):
            self.last_finished = max(self.last_finished, event.patrol)

    def _name_of(self, event: Event) -> str | None:
        """Return what the door is called that an event may call otherwise."""
        if isinstance(event, DoorAnnotated) or event.effect.presence is not Presence.STAYS:
            door = self._state.door(event.door_id)  # type: ignore[attr-defined]
            return door.name if door else None
        return None

    def _call(self, door_id: int, before: str | None, name: str | None) -> None:
        if before != name:
            self._named.get(before or "", set()).discard(door_id)
            if name:
                self._named.setdefault(name, set()).add(door_id)

    def _names_of_level(self, door_id: int) -> tuple[str, str]:
        level = self._state.level_of(door_id)
        return str(level), self._state.level_names().get(level) or str(level)
