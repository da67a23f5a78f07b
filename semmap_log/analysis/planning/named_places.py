"""Places as people name them: `2.5,1.5`, `2.5,1.5,L1`, a door, or a room."""

from __future__ import annotations

import re
from collections.abc import Sequence

from semmap_log.analysis.planning.ways_between import WaysBetween
from semmap_log.analysis.rooms import Place, Room, RoomId, RoomPlan
from semmap_log.core.folds.levels import resolve_level
from semmap_log.core.model.doors import Door, DoorId
from semmap_log.errors import PlanError, UnknownDoorError, UnknownLevelError
from semmap_log.log.door_log.door_log import DoorLog, Time

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
_POINT = re.compile(rf"({_NUMBER})\s*,\s*({_NUMBER})(?:\s*,\s*(.+))?", re.ASCII)
_ROOM_ID = re.compile(r"(?:room[ :])?(\d+)", re.ASCII | re.IGNORECASE)


class NamedPlaces:
    """Reads them, as of a moment."""

    def __init__(self, log: DoorLog, ways: WaysBetween, at: Time = None) -> None:
        """Take a log, and the moment of the names; None: its end."""
        self._log = log
        self._ways = ways
        self._scope = log.scope(at)

    @property
    def _plan(self) -> RoomPlan:
        return self._ways.plan

    def door(self, called: str) -> Door:
        """Return the door of that id, name, or level/name.

        Raises:
            UnknownDoorError: There is none, or more than one.
        """
        door_map = self._plan.door_map
        found: DoorId = self._log.resolve_in(called.strip(), self._scope, door_map)
        return door_map[found]

    def room(self, called: str) -> Room:
        """Return the room of that number or name.

        Raises:
            PlanError: There is none, or several bear the name.
        """
        rooms = self._plan.graph.rooms
        called = called.strip()
        named = [room for room in rooms.values() if room.name == called]
        if len(named) == 1:
            return named[0]
        if named:
            numbers = ", ".join(str(room.room_id) for room in named)
            raise PlanError(f"room {called!r}: rooms {numbers} bear that name; give the number.")
        number = _ROOM_ID.fullmatch(called)
        if number and int(number[1]) in rooms:
            return rooms[int(number[1])]
        if not rooms:
            raise PlanError(f"room {called!r}: the log {self._plan.why_no_plan()}: no rooms.")
        raise PlanError(
            f"room {called!r}: expected a name, or a number of 1..{max(rooms)}; "
            "`semmap-log rooms` lists them."
        )

    def place(self, called: str, option: str, *, seen_from: Place | None = None) -> Place:
        """Return the place that is meant: a point, the middle of a room, or before a door.

        Args:
            called: As it was typed.
            option: Which argument it was, for messages.
            seen_from: Of a door, the side that is reached first from there; None: its left.

        Raises:
            PlanError: There is no such place, or no robot can stand there.
        """
        if found := _POINT.fullmatch(called.strip()):
            place = Place(self._level(found[3], option), float(found[1]), float(found[2]))
            self._ways.check_start(place, option)
            return place
        if (room := self._room_or_none(called)) is not None:
            return Place(room.level, room.x, room.y)
        try:
            door = self.door(called)
        except UnknownDoorError as error:
            raise PlanError(
                f"{option} {called!r}: expected X,Y or X,Y,LEVEL in metres, a room, or a door. "
                f"{error}"
            ) from None
        if not door.is_placed:
            raise PlanError(f"{option} {called!r}: the door has no place in the map.")
        before = self._ways.before(door)
        if not before:
            raise PlanError(f"{option} {called!r}: there is no floor on either side of the door.")
        return self._ways.nearest(before, seen_from)

    def _room_or_none(self, called: str) -> Room | None:
        """Return the room that is meant; a bare number is a door's."""
        if called.strip().isdigit():
            return None
        try:
            return self.room(called)
        except PlanError:
            if called.strip().lower().startswith("room"):
                raise
            return None

    def _level(self, called: str | None, option: str) -> int:
        try:
            return resolve_level(called, self._plan.door_map)
        except UnknownLevelError as error:
            raise PlanError(f"{option}: expected X,Y or X,Y,LEVEL; {error}") from None


def room_label(plan: RoomPlan, room: RoomId) -> str:
    """Return what a room is called: its name, or its number."""
    known = plan.graph.rooms.get(room)
    return (known.name if known else None) or f"room {room}"


def listed(texts: Sequence[str]) -> list[str]:
    """Return the names in `a,b` and in options that were given several times."""
    return [name.strip() for text in texts for name in text.split(",") if name.strip()]
