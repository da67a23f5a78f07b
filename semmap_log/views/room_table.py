"""The rooms of a log for people: a row a room, its doors and where they lead."""

from __future__ import annotations

from semmap_log.analysis.rooms import Room, RoomPlan
from semmap_log.views.column_table import CellValue, ColumnTable, TableColumn
from semmap_log.views.room_words import RoomWords, first_of

MOST_DOORS, MOST_ROOMS = 2, 3
"""So many are drawn by name; programs are told all."""


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
