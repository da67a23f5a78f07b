"""Intent against state: may this event be appended to the map as it stands?

Checking an intent is apart from applying a fact: what is in the log is never judged again.
"""

from __future__ import annotations

import math

from semmap_log.doors import MAX_DOOR_ID, DoorId, DoorMap
from semmap_log.errors import (
    CommandError,
    DoorExistsError,
    DoorRemovedError,
    UnknownDoorError,
    UnknownLevelError,
)
from semmap_log.events import (
    Changed,
    DoorAdded,
    DoorEvent,
    DoorRemoved,
    DoorUpdated,
    Event,
    FloorMap,
    LevelAdded,
    Retracted,
)
from semmap_log.projections.door_map import DoorMapState


class Gatekeeper:
    """Checks the events of one commit, each against the state and the events before it."""

    def __init__(self, state: DoorMapState, next_event: int, now_ns: int) -> None:
        self._state = state
        self._next_event = next_event
        self._now_ns = now_ns
        self._added: dict[int, DoorAdded] = {}
        self._removed: set[int] = set()
        self._levels = state.known_levels() | {0}

    def check(self, event: Event) -> None:
        """Let the event pass.

        Raises:
            CommandError: The map forbids it; the message says what is there instead.
        """
        if isinstance(event, DoorAdded):
            self._check_new(event)
            self._added[event.door_id] = event
        elif isinstance(event, DoorEvent):
            self._check_known(event)
            if isinstance(event, DoorUpdated):
                self._check_update(event)
            if isinstance(event, DoorRemoved):
                self._check_removal(event)
                self._removed.add(event.door_id)
        elif isinstance(event, Retracted):
            self._check_retraction(event)
        elif isinstance(event, (LevelAdded, FloorMap)):
            self._levels.add(event.level)
        self._next_event += 1

    def _check_new(self, event: DoorAdded) -> None:
        door_id = event.door_id
        if door_id in self._added or self._state.is_present(door_id):
            raise DoorExistsError(f"door {door_id} is in the map already; choose another id.")
        if door_id in self._state.used_door_ids:
            raise DoorRemovedError(
                f"door {door_id} was removed, and an id is never used twice; "
                f"the next free id is {next_free_id(self._state)}."
            )
        self._check_level(event.level)

    def _check_known(self, event: DoorEvent) -> None:
        door_id = event.door_id
        if door_id in self._removed:
            raise DoorRemovedError(f"door {door_id} was removed just before.")
        if door_id in self._added or self._state.is_present(door_id):
            return
        removed = self._state.stamp(door_id, "removed")
        if removed is None:
            raise UnknownDoorError(f"door {door_id} is not in the map.")
        if event.happened_ns is None or event.happened_ns > removed[0]:
            raise DoorRemovedError(
                f"door {door_id} was removed; only what happened before that can be added to it."
            )

    def _check_update(self, event: DoorUpdated) -> None:
        if event.changed & Changed.POSE:
            self._check_level(event.level)
        geometry = event.changed & (Changed.POSE | Changed.WIDTH)
        if geometry and geometry != Changed.POSE | Changed.WIDTH and not self._is_placed(event):
            raise CommandError(
                f"door {event.door_id} has no place yet; to place it, give pose and width together."
            )

    def _check_removal(self, event: DoorRemoved) -> None:
        added = self._added.get(event.door_id)
        if added is not None:
            added_ns = self._now_ns if added.happened_ns is None else added.happened_ns
        else:
            stamp = self._state.stamp(event.door_id, "added")
            added_ns = stamp[0] if stamp else 0
        if event.happened_ns is not None and event.happened_ns < added_ns:
            raise CommandError(
                f"door {event.door_id} cannot have been removed before it was added."
            )

    def _check_retraction(self, event: Retracted) -> None:
        if event.last_event >= self._next_event:
            raise CommandError(
                f"cannot retract events {event.first_event}..{event.last_event}: "
                f"the last event is {self._next_event - 1}."
            )

    def _check_level(self, level: int) -> None:
        if level not in self._levels:
            known = ", ".join(str(number) for number in sorted(self._levels))
            raise UnknownLevelError(f"no level {level}; there are: {known}.")

    def _is_placed(self, event: DoorUpdated) -> bool:
        added = self._added.get(event.door_id)
        if added is not None:
            return not math.isnan(added.x)
        return self._state.is_placed(event.door_id)


MOST_ID_DIGITS = len(str(MAX_DOOR_ID))


def next_free_id(state: DoorMapState) -> DoorId:
    """Return the id after the greatest that was ever given."""
    return DoorId(max(state.used_door_ids, default=0) + 1)


def resolve_door(text: str | int, door_map: DoorMap) -> DoorId:
    """Return the door that a person means by an id, a name, or level/name.

    Raises:
        UnknownDoorError: None, or more than one.
    """
    if isinstance(text, int) or (text.isdecimal() and len(text) <= MOST_ID_DIGITS):
        door_id = DoorId(int(text))
        if door_id not in door_map.doors:
            raise UnknownDoorError(f"door {door_id} is not in the map.")
        return door_id
    doors = [door for door in door_map.doors.values() if door.name == text]
    if not doors and "/" in text:
        doors = [
            door
            for door in door_map.doors.values()
            if door.name and f"{door_map.level_name(door.level)}/{door.name}" == text
        ]
    if len(doors) == 1:
        return doors[0].door_id
    if doors:
        which = ", ".join(
            f"{door_map.level_name(door.level)}/{door.name} (door {door.door_id})" for door in doors
        )
        raise UnknownDoorError(f"{text!r} is the name of {len(doors)} doors: {which}.")
    raise UnknownDoorError(f"no door is called {text!r}.{_similar(text, door_map)}")


def resolve_level(text: str | int | None, door_map: DoorMap) -> int:
    """Return the level that a person means by a number or a name.

    Args:
        text: None means the only level there is, or level 0 where there is none.
        door_map: The map as it is.

    Raises:
        UnknownLevelError: No such level, or several and none was named.
    """
    levels = door_map.levels
    known = ", ".join(
        f"{n} ({level.name})" if level.name else str(n) for n, level in levels.items()
    )
    if text is None:
        if len(levels) > 1:
            raise UnknownLevelError(f"there are several levels; say which: {known}.")
        return next(iter(levels), 0)
    for number, level in levels.items():
        if text in (number, level.name, str(number)):
            return number
    if text in (0, "0"):
        return 0
    raise UnknownLevelError(f"no level {text!r}; there are: {known or '0'}.")


def _similar(text: str, door_map: DoorMap) -> str:
    from difflib import get_close_matches

    names = [door.name for door in door_map.doors.values() if door.name]
    close = get_close_matches(text, names, n=3)
    return f" Did you mean {' or '.join(close)}?" if close else ""
