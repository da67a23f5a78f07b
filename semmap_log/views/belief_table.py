"""Draw tables of door beliefs, for the terminal and for notebooks.

A row is a door; below the table stands what a reader must not overlook. Notebooks show logs, door
maps, timelines, differences and beliefs by the same tables that commands print. Times are in UTC
where a value does not know the building's time zone. Long tables are cut, with a note.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import singledispatch
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.analysis.beliefs.door_beliefs import DoorBelief, DoorBeliefs
from semmap_log.core.folds.explanation import Explanation
from semmap_log.core.folds.history import Diff, HistoryEntry
from semmap_log.core.folds.timeline import Timeline
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.doors import DoorId, DoorMap, DoorState
from semmap_log.core.model.moments import Time, format_local
from semmap_log.core.texts import counted
from semmap_log.log import Appended, DoorLog
from semmap_log.views import belief_words, column_table, tables
from semmap_log.views.column_table import Cell, CellValue, ColumnTable, TableColumn, add_pair, pairs
from semmap_log.views.event_words import printable
from semmap_log.views.timeline_table import explanation_table, timeline_pages, timeline_totals

UTC = "UTC"


def html_of(value: Any) -> str:
    """Return a value as HTML."""
    return column_table.html_of(_shown(value))


def plot_log(
    log: DoorLog,
    *,
    since: Time,
    until: Time,
    doors: Collection[DoorId | str] | None,
    progress: Progress | None,
) -> Any:
    """Return the figure of `DoorLog.plot`.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    from semmap_log.views.plots.lanes import Lanes, draw_lanes

    return draw_lanes(Lanes.of(log, doors, since, until, progress=progress))


def plot_timeline(timeline: Timeline, *, name: str, tz: str) -> Any:
    """Return the figure of `Timeline.plot`.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    from semmap_log.views.plots.lanes import Lanes, draw_lanes

    return draw_lanes(Lanes.of_timeline(timeline, name=name, tz=tz))


@singledispatch
def _shown(value: Any) -> RenderableType:
    raise TypeError(f"no table of a {type(value).__name__}")


@_shown.register
def _(log: DoorLog) -> RenderableType:
    """Return what is known without reading the log: `summary()` reads it."""
    info = log.info
    table = pairs()
    for name, text in (("building", info.building), ("robot", info.robot)):
        if text:
            add_pair(table, name, printable(text))
    span = log.happened_span()
    if span is not None:
        first, last = (format_local(ns, info.timezone) for ns in span)
        add_pair(table, "happened", f"{first} to {last}")
    add_pair(table, "time zone", info.timezone)
    add_pair(table, "sightings", f"hold {tables.hold_setting(info.holds)}")
    add_pair(table, "log id", info.log_id)
    return Group(Text(repr(log)), table)


@_shown.register
def _(door_map: DoorMap) -> RenderableType:
    return tables.door_table(door_map, tz=UTC)


@_shown.register
def _(timeline: Timeline) -> RenderableType:
    if not len(timeline):
        return Text(f"door {timeline.door_id}: never there in that time")
    first = next(timeline_pages(timeline, tz=UTC))
    left_out = len(timeline) - len(first.rows)
    more = [Text(f"… and {counted(left_out, 'interval')} more")] if left_out else []
    return Group(first, *more, timeline_totals(timeline, tz=UTC))


@_shown.register
def _(found: Diff) -> RenderableType:
    return tables.diff_table(found, tz=UTC)


@_shown.register
def _(entry: HistoryEntry) -> RenderableType:
    return tables.entry_table(entry, tz=UTC)


@_shown.register
def _(told: Explanation) -> RenderableType:
    return explanation_table(told, tz=UTC)


@_shown.register
def _(appended: Appended) -> RenderableType:
    commit, note = appended.commit, appended.commit.note
    last = appended.first_event + appended.count - 1
    table = pairs([
        ("events", f"{appended.first_event} to {last}"),
        ("recorded", format_local(commit.recorded_ns, UTC)),
        ("durability", commit.durability.name.lower()),
    ])  # fmt: skip
    for name in ("actor", "source", "reason", "correlation"):
        if getattr(note, name):
            add_pair(table, name, printable(getattr(note, name)))
    if appended.repeated:
        add_pair(table, "repeated", "it was stored before; nothing was written now")
    add_pair(table, "command id", commit.command_id.hex())
    return table


@_shown.register
def _(beliefs: DoorBeliefs) -> RenderableType:
    return belief_table(beliefs, tz=beliefs.tz)


@_shown.register
def _(belief: DoorBelief) -> RenderableType:
    return belief_table([belief], tz=UTC)


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
            Text(printable(belief.door.name or tables.ABSENT)),
            Text(printable(belief.level_name or tables.ABSENT)),
            *_numbers(belief),
            *_evidence(belief, tz),
        )
    notes = _notes(beliefs, tz) if beliefs else ["No door is in the map then."]
    return Group(table, *(Text(line, style="dim") for line in notes))


def _columns(*, names: bool, levels: bool) -> list[TableColumn]:
    return [
        TableColumn("door_id", "id", right=True),
        TableColumn("name", "name" if names else None, least=tables.SHORTEST_NAME),
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
    """Return P(open) as drawn, then alone and with its interval, and P(closed)."""
    if not belief.is_known:
        return Text("UNKNOWN", style=tables.OTHER_STATE_COLOUR), *[tables.ABSENT] * 4
    state = DoorState.OPEN if belief.p_open >= LIKELY else DoorState.CLOSED
    said = belief_words.with_interval(belief.p_open, belief.low, belief.high)
    exact = (f"{p:.4f}" for p in (belief.p_open, belief.low, belief.high))
    p_closed = CellValue(belief_words.short_number(belief.p_closed), f"{belief.p_closed:.4f}")
    return Text(said, style=tables.STATE_COLOURS[state]), *exact, p_closed


def _evidence(belief: DoorBelief, tz: str) -> tuple[Cell, ...]:
    """Return days seen, events, visits, how long ago the last was, hours of the week unseen."""
    seen, unseen = belief.evidence, belief.evidence.coverage.hours_never_seen
    last_ns = seen.counts.last_seen_ns
    return (
        f"{seen.coverage.days:.1f}",
        CellValue(f"{seen.counts.words:,}", str(seen.counts.words)),
        CellValue(f"{seen.counts.visits:,}", str(seen.counts.visits)),
        tables.age(last_ns, belief.known_ns),
        tables.ABSENT if last_ns is None else format_local(last_ns, tz),
        CellValue(str(unseen or tables.ABSENT), str(unseen)),
    )


def _notes(beliefs: Sequence[DoorBelief], tz: str) -> list[str]:
    first = beliefs[0]
    moment, known = (belief_words.moment_text(ns, tz) for ns in (first.time_ns, first.known_ns))
    when = moment if moment == known else f"{moment}, as known at {known}"
    key = "in brackets the 90 % interval; hours unseen: of the 168 of a week"
    notes = [f"at {when} ({tz}), by {first.estimator}; {key}"]
    reasons: dict[str, list[str]] = {}
    for belief, label in zip(beliefs, belief_words.labels_in(beliefs), strict=True):
        if not belief.is_known:
            empty = belief.evidence.is_empty
            reason = "never seen" if empty else LITTLE_SEEN
            reasons.setdefault(reason, []).append(label)
    for reason, unknown in reasons.items():
        notes.append(f"UNKNOWN, {reason}: {belief_words.named(unknown)}")
    unseen = belief_words.never_seen_lines(beliefs)
    carried_over = unseen and any(belief.is_known for belief in beliefs)
    return [*notes, *unseen, *[belief_words.CARRIED_OVER] * bool(carried_over)]
