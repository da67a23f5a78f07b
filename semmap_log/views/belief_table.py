"""How likely doors are open, for people: a row a door, and beneath what must not be overlooked."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from semmap_log.beliefs.beliefs import DoorBelief
from semmap_log.doors import DoorState
from semmap_log.views.belief_words import (
    CARRIED_OVER,
    moment_in_words,
    named,
    never_seen_lines,
    short_number,
    with_interval,
)
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
    if not beliefs:
        return Text("No door is in the map then.")
    named_doors = any(belief.door.name for belief in beliefs)
    levels = not all(_names_its_level(belief) for belief in beliefs)
    levels = levels and len({belief.level_name for belief in beliefs}) > 1
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("id", justify="right")
    if named_doors:
        table.add_column("name", overflow="fold", min_width=SHORTEST_NAME)
    if levels:
        table.add_column("level", overflow="fold", max_width=8)
    table.add_column("P(open)", no_wrap=True)
    for head in ("P of\nclosed", "days\nseen", "events", "visits", "last\nseen", "hours\nunseen"):
        table.add_column(head, justify="right", no_wrap=True)
    for belief in beliefs:
        table.add_row(
            str(belief.door.door_id),
            *[Text(printable(belief.door.name or ABSENT))] * named_doors,
            *[Text(printable(belief.level_name))] * levels,
            *_numbers(belief),
            *_evidence(belief),
        )
    return Group(table, *(Text(line, style="dim") for line in _notes(beliefs, tz)))


def _names_its_level(belief: DoorBelief) -> bool:
    return bool(belief.level_name) and (belief.door.name or "").startswith(belief.level_name)


def _numbers(belief: DoorBelief) -> tuple[Text, str]:
    if not belief.is_known:
        return Text("UNKNOWN", style=OTHER_STATE_COLOUR), ABSENT
    state = DoorState.OPEN if belief.p_open >= LIKELY else DoorState.CLOSED
    said = with_interval(belief.p_open, belief.low, belief.high)
    return Text(said, style=STATE_COLOURS[state]), short_number(belief.p_closed)


def _evidence(belief: DoorBelief) -> tuple[str, ...]:
    """Return days seen, events, visits, how long ago the last was, hours of the week unseen."""
    seen = belief.evidence
    return (
        f"{seen.coverage.days:.1f}",
        f"{seen.counts.words:,}",
        f"{seen.counts.visits:,}",
        age(seen.counts.last_seen_ns, belief.known_ns),
        str(seen.coverage.hours_never_seen or ABSENT),
    )


def _notes(beliefs: Sequence[DoorBelief], tz: str) -> list[str]:
    first = beliefs[0]
    moment, known = (moment_in_words(ns, tz) for ns in (first.time_ns, first.known_ns))
    when = moment if moment == known else f"{moment}, as known at {known}"
    key = "in brackets the 90 % interval; hours unseen: of the 168 of a week"
    notes = [f"at {when} ({tz}), by {first.estimator}; {key}"]
    reasons: dict[str, list[DoorBelief]] = {}
    for belief in beliefs:
        if not belief.is_known:
            empty = belief.evidence.is_empty
            reason = "never seen" if empty else LITTLE_SEEN
            reasons.setdefault(reason, []).append(belief)
    for reason, unknown in reasons.items():
        notes.append(f"UNKNOWN, {reason}: {named([belief.door for belief in unknown])}")
    unseen = never_seen_lines((belief.door, belief.evidence) for belief in beliefs)
    carried_over = unseen and any(belief.is_known for belief in beliefs)
    return [*notes, *unseen, *[CARRIED_OVER] * bool(carried_over)]
