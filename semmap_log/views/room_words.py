"""Rooms in words: what a room and a door are called, and what is odd about a level's rooms."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from semmap_log.analysis.rooms import OUTSIDE, Doorway, RoomId, RoomPlan
from semmap_log.analysis.rooms.level_rooms import OCCUPIED_FROM
from semmap_log.core.folds.levels import told
from semmap_log.core.model.events import FloorMap
from semmap_log.core.texts import command_line, counted
from semmap_log.log.door_log.door_labels import labels_of

MOST_NAMED = 5
"""So many of one kind are named; --json has all."""


class RoomWords:
    """Says what the rooms of a plan are, and of all of its levels or of one."""

    def __init__(self, plan: RoomPlan, *, level: int | None = None) -> None:
        self._plan = plan
        self._labels = labels_of(plan.door_map)
        graph = plan.graph
        self.rooms = [room for room in graph.rooms.values() if level in (None, room.level)]
        self._doorways = [each for each in graph.doorways.values() if level in (None, each.level)]
        self._levels = [n for n in graph.levels_without_plan if level in (None, n)]
        self._level = level
        self._names = _labels(plan)

    def room(self, room_id: RoomId | None) -> str:
        """Return what a room is called, or its number."""
        if room_id is None:
            return "nothing"
        if room_id == OUTSIDE:
            return "outside"
        return self._names.get(room_id, f"room {room_id}")

    def door(self, door_id: int) -> str:
        """Return what a door is called."""
        door = self._plan.door_map.doors[door_id]  # type: ignore[index]
        return self._labels.get(door.door_id, door.label)

    def notes(self) -> Iterator[str]:
        """Yield a line for the whole, and one for each thing to know of it."""
        two = [each for each in self._doorways if each.joins_two]
        bare = sum(not self._plan.graph.doors_of(room.room_id) for room in self.rooms)
        yield (
            f"{counted(len(self.rooms), 'room')}, {counted(len(self._doorways), 'door')}: "
            f"{len(two)} join two rooms"
        )
        if bare:
            yield f"{counted(bare, 'room')} without a door: a shaft, a pillar, or a door is missing"
        yield from self._open_levels()
        loops = [each for each in self._doorways if each.is_loop]
        if loops:
            yield (
                f"the same room on both sides of {counted(len(loops), 'door')}, since it has "
                f"another, open end: {self._named(loops, with_room=True)}"
            )
        lost = [each for each in self._doorways if not (each.joins_two or each.is_loop)]
        if lost:
            yield f"no room found on a side of {counted(len(lost), 'door')}: {self._named(lost)}"
        free = [each for each in self._doorways if not each.in_wall]
        if free:
            yield (
                f"{counted(len(free), 'door')} in no wall, which cannot part rooms: "
                f"{self._named(free)}"
            )
        for lift in self._plan.graph.lifts:
            if self._level is None or any(each.door_id in lift.doors for each in self._doorways):
                yield f"lift {lift.name}: {self._first([self.door(i) for i in lift.doors])}"
        if self._levels:
            names = {n: self._known_name(n) for n in self._levels}
            how = command_line("import", "LOG", "map.yaml", "--level", "LEVEL")
            yield f"without a floor plan, so without rooms: level {told(names)}; to give one: {how}"

    def _open_levels(self) -> Iterator[str]:
        """Yield a line for each level whose known floor lies outside for the most part."""
        for level, floor in self._plan.floors.items():
            known_m2 = floor_m2(floor)
            rooms_m2 = sum(room.area_m2 for room in self.rooms if room.level == level)
            if self._level in (None, level) and rooms_m2 < known_m2 / 2:
                name = self._plan.door_map.level_name(level)
                yield (
                    f"level {name}: rooms have {rooms_m2:,.0f} of {known_m2:,.0f} m² of known "
                    "floor, the rest is outside: is there a gap in the walls? Add the door in it"
                )

    def _known_name(self, level: int) -> str | None:
        known = self._plan.door_map.levels.get(level)
        return known.name if known else None

    def _named(self, doorways: Sequence[Doorway], *, with_room: bool = False) -> str:
        return self._first(
            f"{self.door(each.door_id)} ({self.room(each.left)})" if with_room
            else self.door(each.door_id)
            for each in doorways
        )  # fmt: skip

    @staticmethod
    def _first(names: Iterable[str]) -> str:
        return first_of(list(names), MOST_NAMED)


def floor_m2(floor: FloorMap) -> float:
    """Return how much of a plan is known to be floor, square metres."""
    cells = (floor.cells >= 0) & (floor.cells < OCCUPIED_FROM)
    return float(np.count_nonzero(cells)) * floor.resolution**2


def first_of(names: Sequence[str], most: int) -> str:
    """Return the first of some names, and how many more there are."""
    most = most if len(names) > most + 1 else len(names)
    more = f", and {len(names) - most:,} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def _labels(plan: RoomPlan) -> dict[RoomId, str]:
    """Return the names of rooms; with their level where rooms on several bear the same."""
    rooms = plan.graph.rooms.values()
    levels: dict[str, set[int]] = {}
    for room in rooms:
        levels.setdefault(room.name or "", set()).add(room.level)
    return {
        room.room_id: room.name
        if len(levels[room.name]) == 1
        else f"{plan.door_map.level_name(room.level)}/{room.name}"
        for room in rooms
        if room.name
    }
