"""How likely doors are open, for people: a row a door, and beneath what must not be overlooked."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.analysis.beliefs.door_beliefs import DoorBelief
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.moments import format_local
from semmap_log.views.belief_words import (
    CARRIED_OVER,
    labels_in,
    moment_in_words,
    named,
    never_seen_lines,
    short_number,
    with_interval,
)
from semmap_log.views.column_table import Cell, CellValue, ColumnTable, TableColumn
from semmap_log.views.event_words import printable
from semmap_log.views.tables import ABSENT, OTHER_STATE_COLOUR, SHORTEST_NAME, STATE_COLOURS, age

LIKELY = 0.5
LITTLE_SEEN = "too little seen at that time of day"


def belief_table(beliefs: Sequence[DoorBelief], *, tz: str) -> RenderableType:
    """Return P(open) with its interval, P(closed), and the evidence, a row a door.

    Args:
        beliefs: Of one moment, one a door.
        tz: IANA zone of the caption's times.
    """
    named_doors = any(belief.door.name for belief in beliefs)
    levels = not all(_names_its_level(belief) for belief in beliefs)
    levels = levels and len({belief.level_name for belief in beliefs}) > 1
    table = ColumnTable(_columns(names=named_doors, levels=levels))
    for belief in beliefs:
        table.add(
            str(belief.door.door_id),
            Text(printable(belief.door.name or ABSENT)),
            Text(printable(belief.level_name or ABSENT)),
            *_numbers(belief),
            *_evidence(belief, tz),
        )
    notes = _notes(beliefs, tz) if beliefs else ["No door is in the map then."]
    return Group(table, *(Text(line, style="dim") for line in notes))


def _columns(*, names: bool, levels: bool) -> list[TableColumn]:
    return [
        TableColumn("door_id", "id", right=True),
        TableColumn("name", "name" if names else None, least=SHORTEST_NAME),
        TableColumn("level", "level" if levels else None, least=8, yields=1),
        TableColumn("", "P(open)"),
        TableColumn("p_open"),
        TableColumn("low"),
        TableColumn("high"),
        TableColumn("p_closed", "P of\nclosed", right=True, yields=2),
        TableColumn("days_seen", "days\nseen", right=True, yields=5),
        TableColumn("events", "events", right=True, yields=4),
        TableColumn("visits", "visits", right=True, yields=4),
        TableColumn("age", "last\nseen", right=True, yields=3),
        TableColumn("last_seen"),
        TableColumn("hours_unseen", "hours\nunseen", right=True, yields=5),
    ]


def _names_its_level(belief: DoorBelief) -> bool:
    return bool(belief.level_name) and (belief.door.name or "").startswith(belief.level_name)


def _numbers(belief: DoorBelief) -> tuple[Cell, ...]:
    """Return P(open) as it is drawn, then alone and with its interval, and P(closed)."""
    if not belief.is_known:
        return Text("UNKNOWN", style=OTHER_STATE_COLOUR), *[ABSENT] * 4
    state = DoorState.OPEN if belief.p_open >= LIKELY else DoorState.CLOSED
    said = with_interval(belief.p_open, belief.low, belief.high)
    exact = (f"{p:.4f}" for p in (belief.p_open, belief.low, belief.high))
    p_closed = CellValue(short_number(belief.p_closed), f"{belief.p_closed:.4f}")
    return Text(said, style=STATE_COLOURS[state]), *exact, p_closed


def _evidence(belief: DoorBelief, tz: str) -> tuple[Cell, ...]:
    """Return days seen, events, visits, how long ago the last was, hours of the week unseen."""
    seen, unseen = belief.evidence, belief.evidence.coverage.hours_never_seen
    last_ns = seen.counts.last_seen_ns
    return (
        f"{seen.coverage.days:.1f}",
        CellValue(f"{seen.counts.words:,}", str(seen.counts.words)),
        CellValue(f"{seen.counts.visits:,}", str(seen.counts.visits)),
        age(last_ns, belief.known_ns),
        ABSENT if last_ns is None else format_local(last_ns, tz),
        CellValue(str(unseen or ABSENT), str(unseen)),
    )


def _notes(beliefs: Sequence[DoorBelief], tz: str) -> list[str]:
    first = beliefs[0]
    moment, known = (moment_in_words(ns, tz) for ns in (first.time_ns, first.known_ns))
    when = moment if moment == known else f"{moment}, as known at {known}"
    key = "in brackets the 90 % interval; hours unseen: of the 168 of a week"
    notes = [f"at {when} ({tz}), by {first.estimator}; {key}"]
    reasons: dict[str, list[str]] = {}
    for belief, label in zip(beliefs, labels_in(beliefs), strict=True):
        if not belief.is_known:
            empty = belief.evidence.is_empty
            reason = "never seen" if empty else LITTLE_SEEN
            reasons.setdefault(reason, []).append(label)
    for reason, unknown in reasons.items():
        notes.append(f"UNKNOWN, {reason}: {named(unknown)}")
    unseen = never_seen_lines(beliefs)
    carried_over = unseen and any(belief.is_known for belief in beliefs)
    return [*notes, *unseen, *[CARRIED_OVER] * bool(carried_over)]
