"""Tables for people. They fit 80 columns; colours only where there is a terminal (rich sees to it).

Nothing is cut off: what does not fit goes on in the next line, since half a name is no name.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from types import MappingProxyType
from typing import TYPE_CHECKING

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from semmap_log.doors import Door, DoorId, DoorMap, DoorState
from semmap_log.events import DoorUpdated, Event, RobotPose, field_names
from semmap_log.formats.event_json import CHANGED_FIELDS
from semmap_log.levels import levels_of
from semmap_log.moments import format_local
from semmap_log.views.event_words import printable, words_of

if TYPE_CHECKING:
    from semmap_log.log.suspicion import Suspect
    from semmap_log.projections.diff import Diff, FieldChange
    from semmap_log.projections.history import HistoryEntry
    from semmap_log.summary import LogSummary

ABSENT = "-"
"""Stands for what is not known or was not given."""

STATE_COLOURS = {DoorState.OPEN: "green", DoorState.CLOSED: "red"}
OTHER_STATE_COLOUR = "yellow"

SECOND_NS = 10**9
AGE_UNITS = ((365 * 86_400, "y"), (86_400, "d"), (3_600, "h"), (60, "min"), (1, "s"))
"""Seconds in a unit, and its name."""

LATE_NS = 60 * SECOND_NS
"""An event that was recorded so much later than it happened says so."""

MOST_EVENTS_OF_A_DIFF = 40
MOST_SUSPECTS = 20
PAGE_ROWS = 500
DATE_WIDTH = len("2026-03-02")

Names = Mapping[DoorId, str]
SHORTEST_NAME = 14


def door_table(door_map: DoorMap, *, tz: str, width: int | None = None) -> RenderableType:
    """Return the doors of a map, ids ascending; columns that no door fills are left out.

    The age of a state counts from the moment that the map is of.

    Args:
        door_map: The doors.
        tz: IANA zone of the caption's time.
        width: Columns of text; None: what the doors need.
    """
    doors = list(door_map.doors.values())
    levels = any(level.name for level in door_map.levels.values())
    known = levels_of(door_map)
    named, placed = any(door.name for door in doors), any(door.is_placed for door in doors)
    open_given, closed_given = (
        any(not math.isnan(getattr(door, name)) for door in doors)
        for name in ("prob_open", "prob_closed")
    )
    table = _plain_table(width=width)
    table.add_column("id", justify="right")
    if named:
        table.add_column("name", overflow="fold", min_width=SHORTEST_NAME)
    if levels:
        table.add_column("level", overflow="fold")
    for name in ("x", "y", "theta", "width") if placed else ():
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("state", no_wrap=True)
    for name, given in (("P of\nopen", open_given), ("P of\nclosed", closed_given)):
        if given:
            table.add_column(name, justify="right", no_wrap=True)
    table.add_column("age", justify="right", no_wrap=True)
    for door in doors:
        cells: list[RenderableType] = [str(door.door_id)]
        cells += [_text(door.name or ABSENT)] * named
        level = door_map.level_name(door.level) if door.level in known else ABSENT
        cells += [_text(level)] * levels
        cells += [_number(getattr(door, n)) for n in ("x", "y", "theta", "width")] * placed
        cells.append(_state(door.state))
        cells += [_number(door.prob_open)] * open_given + [_number(door.prob_closed)] * closed_given
        table.add_row(*cells, age(door.last_seen_ns, door_map.moment_ns))
    caption = Text(f"{_count(len(doors), 'door')}, {_moment(door_map, tz)}", style="dim")
    return Group(table, caption) if doors else caption


def history_table(
    entries: Iterable[HistoryEntry], *, tz: str, names: Names = MappingProxyType({})
) -> RenderableType:
    """Return events with who and why, one a row; for many, print `history_pages` one by one."""
    return Group(*history_pages(entries, tz=tz, names=names))


def history_pages(
    entries: Iterable[HistoryEntry], *, tz: str, names: Names = MappingProxyType({})
) -> Iterator[Table]:
    """Yield the table of `history_table` in pieces whose columns line up; the first has the head.

    Args:
        entries: Events, in the order to show.
        tz: IANA zone of the times.
        names: What the doors are called; one without a name is its number.
    """
    waiting = iter(entries)
    page = list(islice(waiting, PAGE_ROWS))
    before: HistoryEntry | None = None
    while page or before is None:
        yield _history_page(page, tz=tz, names=names, before=before)
        if not page:
            return
        before, page = page[-1], list(islice(waiting, PAGE_ROWS))


def diff_table(found: Diff, *, tz: str) -> RenderableType:
    """Return what is different between two door maps, and the last events between them.

    The robot's poses are left out.

    Args:
        found: The difference.
        tz: IANA zone of the times.
    """
    table = _plain_table()
    table.add_column("door", overflow="fold")
    table.add_column("what", no_wrap=True)
    table.add_column("before", overflow="fold")
    table.add_column("after", overflow="fold")
    for door in found.added:
        table.add_row(_who(door), "added", ABSENT, _door_in_short(door))
    for door in found.removed:
        table.add_row(_who(door), "removed", _door_in_short(door), ABSENT)
    for change in found.changed:
        table.add_row(_who(change.door), change.field, *_before_and_after(change))
    moments = Text(
        f"before: {_moment(found.before, tz)}\nafter:  {_moment(found.after, tz)}", style="dim"
    )
    told = [entry for entry in found.events if not isinstance(entry.event, RobotPose)]
    parts: list[RenderableType] = [table if found else Text("No door is different."), moments]
    if told:
        parts += [Text(), history_table(told[-MOST_EVENTS_OF_A_DIFF:], tz=tz, names=_names(found))]
    if len(told) > MOST_EVENTS_OF_A_DIFF:
        earlier = _count(len(told) - MOST_EVENTS_OF_A_DIFF, "event")
        parts.append(Text(f"… and {earlier} before these", style="dim"))
    return Group(*parts)


def entry_table(entry: HistoryEntry, *, tz: str, name: str = "") -> Table:
    """Return all that is known about one event, a field a row; an update: only what it sets.

    Args:
        entry: The event.
        tz: IANA zone of the times.
        name: What the door is called.
    """
    table = _pairs()
    table.add_row("event", f"{entry.number}{_taken_back(entry)}")
    table.add_row("kind", entry.kind)
    if entry.door_id is not None:
        table.add_row("door", _text(f"{entry.door_id} ({name})" if name else str(entry.door_id)))
    for field in _telling_fields(entry.event):
        table.add_row(field, _value(getattr(entry.event, field)))
    for change in entry.changes:
        if not _is_absent(change.before):
            table.add_row("changed", _text(f"{change.field}: {_short(change.before)} -> "
                                           f"{_short(change.after)}"))  # fmt: skip
    table.add_row("happened", format_local(entry.happened_ns, tz))
    table.add_row("recorded", format_local(entry.recorded_ns, tz))
    for part in ("actor", "source", "reason", "correlation"):
        if said := getattr(entry, part):
            table.add_row(part, _text(said))
    table.add_row("command id", entry.command_id.hex())
    return table


def _telling_fields(event: Event) -> Iterator[str]:
    """Yield the fields of an event that say something."""
    unset = {
        field
        for bit, fields in CHANGED_FIELDS.items()
        if isinstance(event, DoorUpdated) and bit not in event.changed
        for field in fields
    }
    for field in field_names(type(event)):
        if field not in {"door_id", "salt", "changed"} | unset:
            yield field


def summary_table(summary: LogSummary) -> RenderableType:
    """Return what a log holds, a fact a row; then what looks wrong."""
    info, tz = summary.info, summary.info.timezone
    table = _pairs()
    for name, text in (("building", info.building), ("robot", info.robot)):
        if text:
            table.add_row(name, _text(text))
    table.add_row("log id", info.log_id)
    table.add_row("time zone", tz)
    table.add_row("doors", str(len(summary.door_map)))
    table.add_row("events", f"{summary.events:,} in {_count(summary.commits, 'commit')}")
    for kind, count in summary.counts.items():
        table.add_row("", f"{count:>9,} {kind}")
    for name, span in (("happened", summary.happened_ns), ("recorded", summary.recorded_ns)):
        if span is not None:
            table.add_row(name, f"{format_local(span[0], tz)} to {format_local(span[1], tz)}")
    if summary.durability:
        levels = (f"{level} {count:,}" for level, count in summary.durability.items())
        table.add_row("durability", ", ".join(levels))
    files = _count(len(summary.segments), "file")
    table.add_row("size", f"{_size(summary.bytes)} in {files}")
    table.add_row("head", summary.head.hex())
    suspects = [f"suspect clock: {_suspect(suspect, tz)}" for suspect in summary.suspects]
    if len(suspects) > MOST_SUSPECTS:
        more = _count(len(suspects) - MOST_SUSPECTS, "commit")
        suspects[MOST_SUSPECTS:] = [f"suspect clock: {more} more (all: --json)"]
    wrong = [*(f"warning: {warning}" for warning in summary.warnings), *suspects]
    if not wrong:
        return Group(table, Text("nothing looks wrong", style="dim"))
    return Group(table, *(_text(text, style="yellow") for text in wrong))


def _suspect(suspect: Suspect, tz: str) -> str:
    return f"event {suspect.event}, {format_local(suspect.wall_clock_ns, tz)}: {suspect.why}"


def _size(size: int) -> str:
    return f"{size / 1e6:,.1f} MB" if size >= 1e6 else f"{size / 1e3:,.0f} kB"


def age(then_ns: int | None, now_ns: int) -> str:
    """Return how long ago something was: `3 min`, `2 d`; in the largest unit that fits twice."""
    if then_ns is None:
        return ABSENT
    seconds = max(0, now_ns - then_ns) // SECOND_NS
    for unit_s, name in AGE_UNITS:
        if seconds >= 2 * unit_s or unit_s == 1:
            return f"{seconds // unit_s} {name}"
    raise AssertionError


def _history_page(
    entries: list[HistoryEntry], *, tz: str, names: Names, before: HistoryEntry | None
) -> Table:
    """Return one page: a date stands once a day, who and why once a commit."""
    table = _plain_table(show_header=before is None, expand=True)
    table.add_column("event", justify="right", width=6, overflow="fold")
    table.add_column("happened", width=DATE_WIDTH, overflow="fold")
    table.add_column("door", width=16, overflow="fold")
    table.add_column("what", ratio=3, overflow="fold")
    table.add_column("who: why", ratio=2, overflow="fold")
    for entry in entries:
        day, clock = _day_and_clock(entry, tz)
        door = ABSENT if entry.door_id is None else names.get(entry.door_id, str(entry.door_id))
        said = ": ".join(part for part in (entry.actor, entry.reason) if part)
        table.add_row(
            str(entry.number),
            clock if before and day == _day_and_clock(before, tz)[0] else f"{day}\n{clock}",
            _text(door),
            _what(entry),
            _text("" if before and entry.command_id == before.command_id else said),
            style="dim" if entry.retracted else "",
        )
        before = entry
    return table


def _day_and_clock(entry: HistoryEntry, tz: str) -> tuple[str, str]:
    happened = format_local(entry.happened_ns, tz)
    return happened[:DATE_WIDTH], happened[DATE_WIDTH + 1 : 19]


def _text(text: str, *, style: str = "") -> Text:
    """Return a text that comes from outside: characters that steer a terminal are spelt out."""
    return Text(printable(text), style=style)


def _what(entry: HistoryEntry) -> Text:
    said = words_of(entry.event)
    late_ns = entry.recorded_ns - entry.happened_ns
    if late_ns > LATE_NS:
        said += f" (told {age(0, late_ns)} later)"
    return _text(said + _before(entry) + _taken_back(entry))


def _taken_back(entry: HistoryEntry) -> str:
    """Return that an event was retracted; by which other, where that is known."""
    if not entry.retracted:
        return ""
    by = "" if entry.retracted_by is None else f" by event {entry.retracted_by}"
    return f" (retracted{by})"


def _before(entry: HistoryEntry) -> str:
    """Return what the fields that an event changed had been, such as `, was CLOSED`."""
    known = [change for change in entry.changes if not _is_absent(change.before)]
    if len(known) == 1:
        return f", was {_short(known[0].before)}"
    said = ", ".join(f"{change.field} {_short(change.before)}" for change in known)
    return f"; was: {said}" if said else ""


def _is_absent(value: object) -> bool:
    return value is None or value == "" or (isinstance(value, float) and math.isnan(value))


def _short(value: object) -> str:
    if isinstance(value, DoorState):
        return value.name
    return f"{value:.2f}" if isinstance(value, float) else str(value)


def _plain_table(
    *, width: int | None = None, show_header: bool = True, expand: bool = False
) -> Table:
    return Table(
        box=None,
        pad_edge=False,
        padding=(0, 1, 0, 0),
        width=width,
        show_header=show_header,
        expand=expand,
        caption_justify="left",
        caption_style="dim",
    )


def _pairs() -> Table:
    """Return a table of names and values."""
    table = Table.grid(padding=(0, 2, 0, 0))
    table.add_column(style="dim")
    table.add_column(overflow="fold")
    return table


def _state(state: DoorState) -> Text:
    return Text(state.name, style=STATE_COLOURS.get(state, OTHER_STATE_COLOUR))


def _number(value: float) -> str:
    return ABSENT if math.isnan(value) else f"{value:.3f}"


def _value(value: object) -> RenderableType:
    if isinstance(value, DoorState):
        return _state(value)
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, bytes):
        return f"{len(value):,} bytes"
    shape = getattr(value, "shape", None)
    if shape is not None:
        return f"{shape[1]} x {shape[0]} cells"
    return _text(str(value))


def _who(door: Door) -> Text:
    return _text(str(door.door_id) if door.name is None else f"{door.door_id} {door.name}")


def _door_in_short(door: Door) -> Text:
    place = f" at {door.x:.3f}, {door.y:.3f}" if door.is_placed else ""
    return _state(door.state).append(place, style="default")


def _names(found: Diff) -> Names:
    """Return the names that doors have, or had, at the two moments of a diff."""
    doors = {**found.before.doors, **found.after.doors}
    return {door_id: door.name for door_id, door in doors.items() if door.name}


def _before_and_after(change: FieldChange) -> tuple[RenderableType, RenderableType]:
    if change.field != "annotations":
        return _value(change.before), _value(change.after)
    keys = sorted(k for k in {**change.before, **change.after}
                  if change.before.get(k) != change.after.get(k))  # fmt: skip
    before, after = (
        Text("\n").join(_text(f"{key} = {said.get(key, ABSENT)}") for key in keys)
        for said in (change.before, change.after)
    )
    return before, after


def _moment(door_map: DoorMap, tz: str) -> str:
    """Return which moment the map is of, in words."""
    said = []
    if door_map.at_ns is not None:
        said.append(f"at {format_local(door_map.at_ns, tz)}")
    if door_map.known_at_ns is not None:
        said.append(f"as known at {format_local(door_map.known_at_ns, tz)}")
    said.append(f"up to event {door_map.event}" if door_map.event >= 0 else "no events")
    return ", ".join(said)


def _count(number: int, what: str) -> str:
    return f"{number:,} {what}{'' if number == 1 else 's'}"
