"""What a notebook shows of a log, of door maps, timelines, differences and beliefs.

The tables are those that commands print. Where a value does not know the building's time zone,
times are in UTC; long ones are cut, and say so.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import singledispatch
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.analysis.beliefs.door_beliefs import DoorBelief, DoorBeliefs
from semmap_log.core.folds.diff import Diff
from semmap_log.core.folds.history import HistoryEntry
from semmap_log.core.folds.timeline import Timeline
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.doors import DoorId, DoorMap
from semmap_log.core.model.moments import format_local
from semmap_log.core.texts import counted
from semmap_log.log.door_log.appended import Appended
from semmap_log.log.door_log.door_log import DoorLog, Time
from semmap_log.log.door_log.explanation import Explanation
from semmap_log.views import html_table
from semmap_log.views.belief_table import belief_table
from semmap_log.views.event_words import printable
from semmap_log.views.explanation_table import explanation_table
from semmap_log.views.pairs import add_pair, pairs
from semmap_log.views.tables import diff_table, door_table, entry_table, hold_setting
from semmap_log.views.timeline_table import timeline_pages, timeline_totals

UTC = "UTC"


def html_of(value: Any) -> str:
    """Return a value as HTML."""
    return html_table.html_of(_shown(value))


def plot_log(
    log: DoorLog,
    *,
    since: Time,
    until: Time,
    doors: Collection[DoorId | str] | None,
    progress: Progress | None,
) -> Any:
    """Return what `DoorLog.plot` does.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    from semmap_log.views.plots.lanes import Lanes, draw_lanes

    return draw_lanes(Lanes.of(log, doors, since, until, progress=progress))


def plot_timeline(timeline: Timeline, *, name: str, tz: str) -> Any:
    """Return what `Timeline.plot` does.

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
    add_pair(table, "sightings", f"hold {hold_setting(info.holds)}")
    add_pair(table, "log id", info.log_id)
    return Group(Text(repr(log)), table)


@_shown.register
def _(door_map: DoorMap) -> RenderableType:
    return door_table(door_map, tz=UTC)


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
    return diff_table(found, tz=UTC)


@_shown.register
def _(entry: HistoryEntry) -> RenderableType:
    return entry_table(entry, tz=UTC)


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
