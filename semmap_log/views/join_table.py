"""Tables of joins, proposed doors and rooms, for people.

A join: which doors are one, which are not, and where logs differ. Proposed doors: a row each,
numbered as in their picture. Rooms: a row each, with its doors and where they lead, and what is odd
about a level's rooms.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import degrees
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from semmap_log.analysis.rooms.level_rooms import OCCUPIED_FROM, RoomPlan
from semmap_log.analysis.rooms.room_graph import OUTSIDE, Doorway, Room, RoomId
from semmap_log.analysis.scans.proposing.proposals import Proposal
from semmap_log.core.folds.door_index import labels_of
from semmap_log.core.folds.levels import told
from semmap_log.core.model.events import FloorMap
from semmap_log.core.texts import command_line, counted
from semmap_log.fleet.join.door_plan import BuildingDoor
from semmap_log.fleet.join.join_building import DoorConflict, DoorProposal
from semmap_log.fleet.join.joined_logs import JoinedLogs
from semmap_log.views.column_table import CellValue, ColumnTable, TableColumn


def joined_logs_table(joined: JoinedLogs, here: Path) -> ColumnTable:
    """Return a row for each log: its name, and whether its geometry counts.

    Args:
        joined: The logs.
        here: Paths below this folder are shown relative to it.
    """
    table = ColumnTable(
        [
            TableColumn("log", "log", least=8),
            TableColumn("events", "events", right=True),
            TableColumn("frame", "frame"),
            TableColumn("place", "at", least=12),
        ]
    )
    for log in sorted(joined.logs, key=lambda log: log.name):
        frame = "none: no geometry" if log.frame is None else ",".join(
            f"{number:g}" for number in log.frame.as_list()
        )  # fmt: skip
        told = "reference" if log is joined.reference else frame
        table.add(log.name, str(log.last_event + 1), told, str(_from(log.place, here)))
    return table


def _from(place: PurePath, here: Path) -> PurePath:
    return place.relative_to(here) if place.is_relative_to(here) else place


def joined_doors_table(doors: Iterable[BuildingDoor]) -> ColumnTable:
    """Return a row for each door of the building, with its name in each log."""
    table = ColumnTable(
        [
            TableColumn("door", "door", right=True),
            TableColumn("name", "name", least=12),
            TableColumn("of", "of", least=16),
        ]
    )
    for door in doors:
        of = sorted(f"{each.log} {each.door_id}" for each in door.doors)
        table.add(str(door.door_id), door.name, ", ".join(of))
    return table


def door_conflicts_table(conflicts: Iterable[DoorConflict]) -> ColumnTable:
    """Return a row for each difference between two logs."""
    table = ColumnTable(
        [
            TableColumn("door", "door", right=True),
            TableColumn("name", "name", least=8),
            TableColumn("differs", "differs"),
            TableColumn("one", "one says", least=12),
            TableColumn("other", "other says", least=12),
        ]
    )
    for conflict in conflicts:
        table.add(str(conflict.door.door_id), conflict.door.name, conflict.what, *conflict.says)
    return table


def door_proposals_table(proposals: Iterable[DoorProposal]) -> ColumnTable:
    """Return a row for each pair of doors at one place."""
    table = ColumnTable(
        [
            TableColumn("first", "door", least=10),
            TableColumn("second", "may be", least=10),
            TableColumn("apart_m", "apart, m", right=True),
        ]
    )
    for each in proposals:
        first, second = (f"{one.log} {one.door.label}" for one in (each.first, each.second))
        table.add(first, second, f"{each.apart_m:.2f}")
    return table


UNKNOWN_KIND = "unknown"


def proposal_table(proposals: Sequence[Proposal], *, show_level: bool = False) -> ColumnTable:
    """Return the table, best first; angles in degrees for people."""
    numbers = ("x", "y", "degrees", "width", "score")
    columns = [
        TableColumn("number", "no", right=True),
        *([TableColumn("level", "level", right=True)] if show_level else []),
        *(TableColumn(name, name, right=True) for name in numbers),
        TableColumn("kind", "kind"),
        TableColumn("evidence", "evidence", least=24),
    ]
    table = ColumnTable(columns)
    for number, each in enumerate(proposals, start=1):
        level = [str(each.level)] if show_level else []
        table.add(
            str(number), *level, f"{each.x:.2f}", f"{each.y:.2f}", f"{degrees(each.theta):.0f}",
            f"{each.width:.2f}", f"{each.score:.2f}", each.kind or UNKNOWN_KIND, evidence_of(each),
        )  # fmt: skip
    return table


def evidence_of(proposal: Proposal) -> str:
    """Return the evidence for a proposal, in words."""
    seen = [
        f"{count} {word}"
        for count, word in (
            (proposal.seen_open, "open"),
            (proposal.seen_closed, "shut"),
            (proposal.seen_ajar, "ajar"),
        )
        if count
    ]
    leaf = ["leaf seen at (x, y)"] if proposal.kind else []
    parts = [f"visits: {proposal.visits}" + (f" ({', '.join(seen)})" if seen else "")]
    if proposal.passed:
        parts.insert(0, f"driven through: {proposal.passed}")
    parts.append(f"wall on {proposal.along:.0%} of 3 m beside it")
    return ", ".join([*parts, *leaf])


def proposal_to_json(number: int, proposal: Proposal, name: str) -> dict[str, Any]:
    """Return a proposal for machines; lengths m, angles rad; a hinged one hangs at x, y."""
    return {
        "number": number, "name": name, "level": proposal.level, "x": proposal.x,
        "y": proposal.y, "theta": proposal.theta, "width": proposal.width,
        "kind": proposal.kind or UNKNOWN_KIND, "score": proposal.score,
        "evidence": {
            "scans": proposal.scans, "visits": proposal.visits, "open": proposal.seen_open,
            "closed": proposal.seen_closed, "ajar": proposal.seen_ajar,
            "passed": proposal.passed, "walls": proposal.walls, "along": proposal.along,
            "free": proposal.free, "opens": proposal.opens,
        },
    }  # fmt: skip


MOST_DOORS, MOST_ROOMS = 2, 3
"""So many are drawn by name; programs get all of them."""


def room_table(plan: RoomPlan, words: RoomWords) -> ColumnTable:
    """Return the table of the rooms that `words` is about, by number."""
    table = ColumnTable(COLUMNS)
    for room in words.rooms:
        _add(table, plan, room, words)
    return table


def _add(table: ColumnTable, plan: RoomPlan, room: Room, words: RoomWords) -> None:
    doors = [words.door(door_id) for door_id in plan.graph.doors_of(room.room_id)]
    beyond = [words.room(other) for other in plan.graph.neighbours(room.room_id)]
    table.add(
        str(room.room_id),
        plan.door_map.level_name(room.level),
        room.name or "",
        f"{room.area_m2:.1f}",
        str(len(doors)),
        CellValue(first_of(doors, MOST_DOORS), ", ".join(doors)),
        CellValue(first_of(beyond, MOST_ROOMS), ", ".join(beyond)),
    )


COLUMNS = [
    TableColumn("room", "room", right=True),
    TableColumn("level", "level"),
    TableColumn("name", "name", least=12),
    TableColumn("area", "m²", right=True),
    TableColumn("count", "doors", right=True),
    TableColumn("doors", "by", least=16, yields=2),
    TableColumn("leads_to", "leads to", least=16, yields=1),
]


MOST_NAMED = 5
"""So many of one kind are listed by name; --json has all."""


class RoomWords:
    """Describes the rooms of a plan, of all its levels or of one."""

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
        """Return a room's name, or its number."""
        if room_id is None:
            return "nothing"
        if room_id == OUTSIDE:
            return "outside"
        return self._names.get(room_id, f"room {room_id}")

    def door(self, door_id: int) -> str:
        """Return a door's label."""
        door = self._plan.door_map.doors[door_id]  # type: ignore[index]
        return self._labels.get(door.door_id, door.label)

    def notes(self) -> Iterator[str]:
        """Yield a summary line, and a line for each remark."""
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
        """Yield a line for each level whose known floor is mostly outside."""
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
    """Return the area of a plan that is known to be floor, square metres."""
    cells = (floor.cells >= 0) & (floor.cells < OCCUPIED_FROM)
    return float(np.count_nonzero(cells)) * floor.resolution**2


def first_of(names: Sequence[str], most: int) -> str:
    """Return the first of some names, and the number of the others."""
    most = most if len(names) > most + 1 else len(names)
    more = f", and {len(names) - most:,} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def _labels(plan: RoomPlan) -> dict[RoomId, str]:
    """Return the names of rooms, with their level where several levels have the name."""
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
