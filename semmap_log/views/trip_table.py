"""A planned trip, for people: the doors on the way, and what to do if one is shut."""

from __future__ import annotations

import math

from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.analysis.planning.door_trip import DoorTrip, TripStop
from semmap_log.analysis.planning.patrol_round import EXPECTED_P
from semmap_log.analysis.planning.trip_policy import AtShutDoor, ShutDoorChoice
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.moments import SECOND_NS, format_local, format_short
from semmap_log.views.belief_words import named, with_interval
from semmap_log.views.column_table import Cell, CellValue, ColumnTable, TableColumn
from semmap_log.views.event_words import printable
from semmap_log.views.tables import ABSENT, OTHER_STATE_COLOUR, SHORTEST_NAME, STATE_COLOURS
from semmap_log.views.timeline_table import duration


def trip_table(trip: DoorTrip) -> RenderableType:
    """Return a row a door on the way, the expected time, and what it rests on."""
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
        _in_words(stop, choice),
        *(_time(seconds) for seconds in (choice.wait_s, choice.ask_s, choice.round_s)),
    )


def _in_words(stop: TripStop, choice: ShutDoorChoice) -> str:
    if choice.best is AtShutDoor.WAIT and stop.wait_s is not None:
        return f"wait: {_duration(stop.wait_s)}"
    return choice.best.value


def _time(seconds: float) -> Cell:
    """Return the time to the goal; one that is none is absent."""
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
