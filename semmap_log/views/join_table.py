"""What a join is, for people: which doors are one, which are not, and where logs differ."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path, PurePath

from semmap_log.fleet.join.door_conflicts import DoorConflict, DoorProposal
from semmap_log.fleet.join.door_plan import BuildingDoor
from semmap_log.fleet.join.joined_logs import JoinedLogs
from semmap_log.views.column_table import ColumnTable, TableColumn


def joined_logs_table(joined: JoinedLogs, here: Path) -> ColumnTable:
    """Return a row for each log: what it is called, and whether its geometry counts.

    Args:
        joined: The logs.
        here: What lies below this folder is named from there.
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
    """Return a row for each door of the building, and what it is in which log."""
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
    """Return a row for each two doors that lie at one place."""
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
