"""Tables of a rebase and of a planned trip, for people.

A rebase: how well the points fit the new map, and where doors go. A trip: the doors on the way,
and what to do if one is shut.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.analysis.planning.door_trip import DoorTrip, TripStop
from semmap_log.analysis.planning.patrol_round import EXPECTED_P
from semmap_log.analysis.planning.round_task import AtShutDoor, ShutDoorChoice
from semmap_log.core.folds.rebasing import MapFit, MovedDoor, RebasePlan
from semmap_log.core.model.doors import Door, DoorId, DoorState
from semmap_log.core.model.moments import SECOND_NS, duration, format_local, format_short
from semmap_log.core.texts import counted
from semmap_log.views.belief_words import named, with_interval
from semmap_log.views.column_table import Cell, CellValue, ColumnTable, TableColumn
from semmap_log.views.event_words import printable
from semmap_log.views.tables import ABSENT, OTHER_STATE_COLOUR, SHORTEST_NAME, STATE_COLOURS

MOST_NAMED = 10


def pairs_table(fit: MapFit) -> ColumnTable:
    """Return a row for each pair, in the order of the file: its residual after the fit."""
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
    """Yield notes on doors that stay, and on those that were measured."""
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


def trip_table(trip: DoorTrip) -> RenderableType:
    """Return a row a door on the way, the expected time, and its basis."""
    table = ColumnTable([
        TableColumn("door_id", "id", right=True),
        TableColumn("door", "door", least=SHORTEST_NAME),
        TableColumn("", "arrive"),
        TableColumn("arrives"),
        TableColumn("", "P (90 %)"),
        TableColumn("p_open"),
        TableColumn("low"),
        TableColumn("high"),
        TableColumn("if_shut", "if shut", least=8),
        TableColumn("wait_s", "by a wait", right=True, yields=1),
        TableColumn("ask_s", "by asking", right=True, yields=2),
        TableColumn("round_s", "by a detour", right=True, yields=1),
    ])  # fmt: skip
    for stop in trip.stops:
        table.add(*_row(stop, trip.tz))
    tables = [table] if trip.stops else []
    return Group(*tables, *(Text(line, style="dim") for line in _notes(trip)))


def _row(stop: TripStop, tz: str) -> tuple[Cell, ...]:
    chance, numbers = Text("UNKNOWN", style=OTHER_STATE_COLOUR), [ABSENT] * 3
    if stop.is_known:
        likely = DoorState.OPEN if stop.p_open >= EXPECTED_P else DoorState.CLOSED
        said = with_interval(stop.p_open, stop.low, stop.high)
        chance = Text(said, style=STATE_COLOURS[likely])
        numbers = [f"{each:.4f}" for each in (stop.p_open, stop.low, stop.high)]
    choice = stop.if_shut
    return (
        str(stop.door.door_id),
        Text(printable(stop.door.label)),
        format_short(stop.arrives_ns, tz).rpartition(" ")[2],
        format_local(stop.arrives_ns, tz),
        chance,
        *numbers,
        _phrase(stop, choice),
        *(_time(seconds) for seconds in (choice.wait_s, choice.ask_s, choice.round_s)),
    )


def _phrase(stop: TripStop, choice: ShutDoorChoice) -> str:
    if choice.best is AtShutDoor.WAIT and stop.wait_s is not None:
        return f"wait: {_duration(stop.wait_s)}"
    return choice.best.value


def _time(seconds: float) -> Cell:
    """Return the time to the goal; an infinite one is absent."""
    if not math.isfinite(seconds):
        return ABSENT
    return CellValue(_duration(seconds), f"{seconds:.0f}")


def _duration(seconds: float) -> str:
    return duration(round(seconds) * SECOND_NS)


def _notes(trip: DoorTrip) -> list[str]:
    depart, known = (format_short(ns, trip.tz) for ns in (trip.depart_ns, trip.known_ns))
    when = depart if depart == known else f"{depart}, as known at {known}"
    expected = "not known" if math.isinf(trip.expected_s) else _duration(trip.expected_s)
    notes = [
        f"from {when} ({trip.tz}), by {trip.estimator}",
        f"expected time to the goal: {expected}; {_duration(trip.walk_s)} if no door is shut",
    ]
    if trip.stops:
        notes.append("by a wait, by asking, by a detour: from that door to the goal, if it is shut")
    if trip.others:
        which = "doors of other ways" if math.isfinite(trip.expected_s) else "doors on the ways"
        notes.append(f"{which}: {named([door.label for door in trip.others])}")
    return [*notes, *trip.notes]
