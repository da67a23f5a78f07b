"""What a new map does to the doors, for people: how well points fit, and where doors go."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rich.text import Text

from semmap_log.core.model.doors import Door, DoorId
from semmap_log.core.texts import counted
from semmap_log.log.door_log.map_fit import MapFit
from semmap_log.log.door_log.rebasing import MovedDoor, RebasePlan
from semmap_log.views.column_table import ColumnTable, TableColumn
from semmap_log.views.event_words import printable
from semmap_log.views.tables import ABSENT, SHORTEST_NAME

MOST_NAMED = 10


def pairs_table(fit: MapFit) -> ColumnTable:
    """Return a row for each pair, in the order of the file: how far the fit leaves it off."""
    table = ColumnTable([
        TableColumn("pair", "pair", least=SHORTEST_NAME),
        TableColumn("old_x", "old x", right=True, yields=1),
        TableColumn("old_y", "old y", right=True, yields=1),
        TableColumn("new_x", "new x", right=True, yields=1),
        TableColumn("new_y", "new y", right=True, yields=1),
        TableColumn("residual_m", "residual, m", right=True),
        TableColumn("says", ""),
    ])  # fmt: skip
    for pair, residual in zip(fit.pairs, fit.residuals_m, strict=True):
        at = (pair.old_x, pair.old_y, pair.new_x, pair.new_y)
        said = "does not fit the others" if pair.name in fit.misfits else ""
        numbers = (f"{value:.2f}" for value in at)
        table.add(Text(printable(pair.name)), *numbers, f"{residual:.3f}", said)
    return table


def moved_doors_table(plan: RebasePlan) -> ColumnTable:
    """Return a row for each door that gets a place in the new map, ids ascending."""
    table = ColumnTable([
        TableColumn("door_id", "id", right=True),
        TableColumn("door", "door", least=SHORTEST_NAME),
        TableColumn("old", "x, y, theta before", right=True, yields=1),
        TableColumn("new", "and after", right=True),
        TableColumn("by", "by"),
        TableColumn("off_m", "off, m", right=True),
    ])  # fmt: skip
    for door in plan.doors:
        table.add(
            str(door.after.door_id), Text(printable(door.after.label)), _pose(door.before),
            _pose(door.after), "measured" if door.is_measured else "transform", _off(door),
        )  # fmt: skip
    return table


def rebase_notes(plan: RebasePlan) -> Iterator[str]:
    """Yield what is to be said of doors that stay, and of those that were measured."""
    measured = [door for door in plan.doors if door.is_measured]
    if measured:
        worst = max(measured, key=lambda door: -1 if math.isnan(door.off_m) else door.off_m)
        far = "" if math.isnan(worst.off_m) else (
            f"; at most {worst.off_m:.2f} m from where the transform puts them "
            f"({printable(worst.after.label)})"
        )  # fmt: skip
        yield f"measured again: {counted(len(measured), 'door')}{far}"
    for doors, said in (
        (plan.unplaced, "without a place, before and after"),
        (plan.elsewhere, "of other levels, left alone"),
        (plan.placed_later, "put in place after that moment, taken to be in the new map already"),
    ):
        if doors:
            yield f"{said}: {_named(doors)}"


def rebase_warnings(plan: RebasePlan) -> Iterator[str]:
    """Yield what looks wrong."""
    off = [door.after.door_id for door in plan.doors if not door.is_on_map]
    if off:
        yield f"doors that lie off the new map: {_named(off)}; look at the map, or the transform"


def _named(doors: Sequence[DoorId]) -> str:
    more = f" and {len(doors) - MOST_NAMED} more" if len(doors) > MOST_NAMED else ""
    return "door " + ", ".join(map(str, doors[:MOST_NAMED])) + more


def _pose(door: Door) -> str:
    if not door.is_placed:
        return ABSENT
    return f"{door.x:.2f}, {door.y:.2f}, {door.theta:.3f}"


def _off(door: MovedDoor) -> str:
    return ABSENT if math.isnan(door.off_m) else f"{door.off_m:.2f}"
