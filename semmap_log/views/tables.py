"""Tables of doors and events, drawn for people and as lines for programs (`columns`).

Drawn they fit 80 columns. Nothing is cut off: what does not fit goes on in the next line, since
half a name is no name; in less than 80, columns are left out.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import islice
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from semmap_log.core.folds.levels import levels_of
from semmap_log.core.model.doors import DOOR, Door, DoorId, DoorMap, DoorState, ObjectClass
from semmap_log.core.model.events import DoorUpdated, Event, FloorMap, RobotPose, field_names
from semmap_log.core.model.meaning import PART_OF
from semmap_log.core.model.moments import format_local, format_short
from semmap_log.core.texts import command_line, counted
from semmap_log.views import column_table
from semmap_log.views.event_words import printable, words_of

if TYPE_CHECKING:
    from semmap_log.core.folds.history import Diff, FieldChange, HistoryEntry
    from semmap_log.log import LogSummary

ABSENT = "-"
"""Marks what is unknown or was not given."""

STATE_COLOURS = {DoorState.OPEN: "green", DoorState.CLOSED: "red"}
OTHER_STATE_COLOUR = "yellow"

SECOND_NS = 10**9
AGE_UNITS = ((365 * 86_400, "y"), (86_400, "d"), (3_600, "h"), (60, "min"), (1, "s"))
"""Seconds in a unit, and its name."""

LATE_NS = 60 * SECOND_NS
"""An event that was recorded at least so late shows its delay."""

MOST_EVENTS_OF_A_DIFF = 40
MOST_SUSPECTS = 20
MOST_NAMES = 8
PAGE_ROWS = 500
DATE_WIDTH, TIME_WIDTH = len("2026-03-02"), len("08:00:00")

Names = Mapping[DoorId, str]
Objects = Mapping[DoorId, ObjectClass]
"""The classes of all objects that are not doors."""
NO_OBJECTS: Objects = MappingProxyType({})
SHORTEST_NAME = 14


def door_table(door_map: DoorMap, *, tz: str) -> RenderableType:
    """Return the doors of a map, ids ascending; columns that no door fills are not drawn.

    The age of a state counts from the moment that the map is of.

    Args:
        door_map: The doors.
        tz: IANA zone of the times.
    """
    doors = list(door_map.doors.values())
    table, known = column_table.ColumnTable(_door_columns(door_map)), levels_of(door_map)
    for door in doors:
        table.add(
            str(door.door_id),
            _text(door.name or ABSENT),
            _text(door_map.level_name(door.level) if door.level in known else ABSENT),
            *(_number(getattr(door, name)) for name in ("x", "y", "theta", "width")),
            *([_text(door.object_class.name)] if door_map.classes else []),
            coloured_state(door.state, door.object_class),
            *(_number(getattr(door, name)) for name in ("prob_open", "prob_closed")),
            age(door.last_seen_ns, door_map.moment_ns),
            ABSENT if door.last_seen_ns is None else format_local(door.last_seen_ns, tz),
        )
    caption = Text(f"{counted(len(doors), 'door')}, {_moment(door_map, tz)}", style="dim")
    return Group(table, caption)


def _door_columns(door_map: DoorMap) -> list[column_table.TableColumn]:
    doors = door_map.doors.values()
    levels = any(level.name for level in door_map.levels.values())
    named, placed = any(door.name for door in doors), any(door.is_placed for door in doors)
    open_given, closed_given = (
        any(not math.isnan(getattr(door, name)) for door in doors)
        for name in ("prob_open", "prob_closed")
    )
    return [
        column_table.TableColumn("door_id", "id", right=True),
        column_table.TableColumn("name", "name" if named else None, least=SHORTEST_NAME),
        column_table.TableColumn("level", "level" if levels else None, least=3, yields=1),
        column_table.TableColumn("x", "x" if placed else None, right=True, yields=4),
        column_table.TableColumn("y", "y" if placed else None, right=True, yields=4),
        column_table.TableColumn("theta", "theta" if placed else None, right=True, yields=5),
        column_table.TableColumn("width", "width" if placed else None, right=True, yields=5),
        *([column_table.TableColumn("class", "class", yields=1)] if door_map.classes else []),
        column_table.TableColumn("state", "state"),
        column_table.TableColumn(
            "prob_open", "P of\nopen" if open_given else None, right=True, yields=2
        ),
        column_table.TableColumn(
            "prob_closed", "P of\nclosed" if closed_given else None, right=True, yields=3
        ),
        column_table.TableColumn("age", "age", right=True),
        column_table.TableColumn("last_seen"),
    ]


def history_table(
    entries: Iterable[HistoryEntry],
    *,
    tz: str,
    names: Names = MappingProxyType({}),
    objects: Objects = NO_OBJECTS,
) -> column_table.ColumnTable:
    """Return events with who and why, one a row; for many, print `history_pages` one by one."""
    return _history_page(list(entries), tz=tz, names=names, objects=objects, before=None)


def history_pages(
    entries: Iterable[HistoryEntry],
    *,
    tz: str,
    names: Names = MappingProxyType({}),
    objects: Objects = NO_OBJECTS,
) -> Iterator[column_table.ColumnTable]:
    """Yield the table of `history_table` in pieces whose columns line up; the first has the head.

    Args:
        entries: Events, in the order to show.
        tz: IANA zone of the times.
        names: The doors' names; a door without one is shown by its number.
        objects: The classes of objects that are not doors.
    """
    waiting = map(_without_cells, entries)
    page = list(islice(waiting, PAGE_ROWS))
    before: HistoryEntry | None = None
    while page or before is None:
        yield _history_page(page, tz=tz, names=names, objects=objects, before=before)
        if not page:
            return
        before, page = page[-1], list(islice(waiting, PAGE_ROWS))


def _without_cells(entry: HistoryEntry) -> HistoryEntry:
    """Return an entry as a table shows it: of a floor plan only its size."""
    if not isinstance(entry.event, FloorMap):
        return entry
    cells = np.broadcast_to(np.int8(0), entry.event.cells.shape)  # of one byte
    return replace(entry, event=replace(entry.event, cells=cells))


def diff_table(found: Diff, *, tz: str) -> RenderableType:
    """Return the differences between two door maps, and the last events between them.

    The robot's poses are left out.

    Args:
        found: The difference.
        tz: IANA zone of the times.
    """
    table = column_table.ColumnTable([
        column_table.TableColumn("door_id"),
        column_table.TableColumn("name"),
        column_table.TableColumn("", "door", least=SHORTEST_NAME),
        column_table.TableColumn("what", "what"),
        column_table.TableColumn("before", "before", least=SHORTEST_NAME),
        column_table.TableColumn("after", "after", least=SHORTEST_NAME),
    ])  # fmt: skip
    for door in found.added:
        table.add(*_who(door), "added", ABSENT, _door_in_short(door))
    for door in found.removed:
        table.add(*_who(door), "removed", _door_in_short(door), ABSENT)
    for change in found.changed:
        for before, after in _before_and_after(change):
            table.add(*_who(change.door), change.field, before, after)
    moments = Text(
        f"before: {_moment(found.before, tz)}\nafter:  {_moment(found.after, tz)}", style="dim"
    )
    told = [entry for entry in found.events if not isinstance(entry.event, RobotPose)]
    nothing = [] if found else [Text("No door is different.")]
    return Group(table, *nothing, moments, *_last_events(told, tz, _names(found), _objects(found)))


def _last_events(
    told: list[HistoryEntry], tz: str, names: Names, objects: Objects
) -> list[RenderableType]:
    """Return a table of events of which the last are drawn, and how many there are before."""
    if not told:
        return []
    of_log: dict[str, Any] = {"tz": tz, "names": names, "objects": objects}
    drawn = history_table(told[-MOST_EVENTS_OF_A_DIFF:], **of_log)
    parts: list[RenderableType] = [Text(), drawn]
    if len(told) > MOST_EVENTS_OF_A_DIFF:
        earlier = counted(len(told) - MOST_EVENTS_OF_A_DIFF, "event")
        parts.append(Text(f"… and {earlier} before these", style="dim"))
    return [column_table.TextPicture(lambda _: Group(*parts), history_table(told, **of_log))]


def entry_table(entry: HistoryEntry, *, tz: str, name: str = "") -> column_table.ColumnTable:
    """Return all about one event, a field a row; of an update only what it sets.

    Args:
        entry: The event.
        tz: IANA zone of the times.
        name: The door's name.
    """
    table = column_table.pairs([
        ("event", f"{entry.number}{taken_back(entry)}"),
        ("kind", entry.kind),
    ])  # fmt: skip
    if entry.door_id is not None:
        column_table.add_pair(
            table, "door", _text(f"{entry.door_id} ({name})" if name else str(entry.door_id))
        )
    for field in _given_fields(entry.event):
        column_table.add_pair(table, field, _value(getattr(entry.event, field)))
    for change in entry.changes:
        if not _is_absent(change.before):
            said = f"{change.field}: {_short(change.before)} -> {_short(change.after)}"
            column_table.add_pair(table, "changed", _text(said))
    column_table.add_pair(table, "happened", format_local(entry.happened_ns, tz))
    column_table.add_pair(table, "recorded", format_local(entry.recorded_ns, tz))
    for part in ("actor", "source", "reason", "correlation"):
        if said := getattr(entry, part):
            column_table.add_pair(table, part, _text(said))
    column_table.add_pair(table, "command id", entry.command_id.hex())
    return table


def _given_fields(event: Event) -> Iterator[str]:
    """Yield the fields of an event that have a value."""
    unset = PART_OF.keys() - event.values_set().keys() if isinstance(event, DoorUpdated) else set()
    for field in field_names(type(event)):
        if field not in {"door_id", "salt", "changed"} | unset:
            yield field


def summary_table(summary: LogSummary) -> RenderableType:
    """Return the contents of a log, a fact a row; then what looks wrong."""
    info, tz = summary.info, summary.info.timezone
    table = column_table.pairs()
    for name, text in (("building", info.building), ("robot", info.robot)):
        if text:
            column_table.add_pair(table, name, _text(text))
    column_table.add_pair(table, "log id", info.log_id)
    column_table.add_pair(table, "time zone", tz)
    column_table.add_pair(table, "sightings", f"hold {hold_setting(info.holds)}")
    for name, count in _counted_by_class(summary.door_map):
        column_table.add_pair(table, name, str(count))
    events = f"{summary.events:,} in {counted(summary.commits, 'commit')}"
    column_table.add_pair(table, "events", column_table.CellValue(events, str(summary.events)))
    for kind, count in summary.counts.items():
        column_table.add_pair(
            table,
            "",
            column_table.CellValue(f"{count:>9,} {kind}", str(count)),
            machine_name=f"events: {kind}",
        )
    for name, span in (("happened", summary.happened_ns), ("recorded", summary.recorded_ns)):
        if span is not None:
            column_table.add_pair(
                table, name, f"{format_local(span[0], tz)} to {format_local(span[1], tz)}"
            )
    if summary.durability:
        levels = (f"{level} {count:,}" for level, count in summary.durability.items())
        column_table.add_pair(table, "durability", ", ".join(levels))
    size = f"{_size(summary.bytes)} in {counted(len(summary.segments), 'file')}"
    column_table.add_pair(
        table, "size", column_table.CellValue(size, str(summary.bytes)), machine_name="bytes"
    )
    if summary.index is not None:
        column_table.add_pair(table, "index", _index_words(summary))
    for name, text in _personal_words(summary):
        column_table.add_pair(table, name, _text(text))
    column_table.add_pair(table, "head", summary.head.hex())
    wrong = [*summary.warnings, *_suspects(summary)]
    for text in wrong:
        column_table.add_pair(table, "warning", _text(text, style="yellow"))
    return Group(table, *[Text("nothing looks wrong", style="dim")] * (not wrong))


def hold_setting(holds: int) -> str:
    """Return how long a sighting holds, in words."""
    return f"for {counted(holds, 'median gap')} between looks" if holds else "until the next report"


def _counted_by_class(door_map: DoorMap) -> Iterator[tuple[str, int]]:
    """Yield the number of doors, and of objects of each class."""
    if not door_map.classes:
        yield "doors", len(door_map)
        return
    counts = Counter(door.object_class.name for door in door_map.doors.values())
    yield "doors", counts[DOOR.name]
    for name in door_map.classes:
        yield f"class {name}", counts[name]


def _personal_words(summary: LogSummary) -> Iterator[tuple[str, str]]:
    """Yield the parts of a log that are about persons, in words."""
    personal = summary.personal
    if personal.notes:
        said = f"{personal.notes:,}, {personal.reasons:,} of them with a reason"
        yield "notes", f"{said}; by {_most(personal.actors)}"
    if personal.annotations:
        yield "annotated", _most(personal.annotations)
    if personal.poses or personal.patrols:
        rounds = counted(personal.patrols, "round")
        yield "tracks", f"{counted(personal.poses, 'pose')}, {rounds}"


def _most(names: Counter[str]) -> str:
    """Return the most frequent names, with their counts."""
    told = [f"{name} {count:,}" for name, count in sorted(names.items(), key=_frequent)]
    if len(told) > MOST_NAMES:
        told[MOST_NAMES:] = [f"{len(told) - MOST_NAMES} others"]
    return ", ".join(told) or "nobody"


def _frequent(name_and_count: tuple[str, int]) -> tuple[int, str]:
    name, count = name_and_count
    return -count, name


def _index_words(summary: LogSummary) -> str:
    """Return the progress of the tables by door, and what to do if they are incomplete."""
    index = summary.index
    assert index is not None, "a log without one has no such line"
    said = f"{index.indexed:,} of {counted(index.segments, 'closed file')}, {_size(index.size)}"
    if index.indexed < index.segments:
        said += f"; `{command_line('index', summary.segments[0].path.parent)}` brings it up to date"
    return said


def _suspects(summary: LogSummary) -> list[str]:
    """Return the commits whose clock is suspect, in words."""
    tz = summary.info.timezone
    told = [
        f"suspect clock: event {one.event}, {format_local(one.wall_clock_ns, tz)}: {one.why}"
        for one in summary.suspects
    ]
    if len(told) > MOST_SUSPECTS:
        more = counted(len(told) - MOST_SUSPECTS, "commit")
        told[MOST_SUSPECTS:] = [f"suspect clock: {more} more (all: --json)"]
    return told


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
    entries: list[HistoryEntry],
    *,
    tz: str,
    names: Names,
    objects: Objects,
    before: HistoryEntry | None,
) -> column_table.ColumnTable:
    """Return one page; when drawn, a date appears once a day, who and why once a commit."""
    table = column_table.ColumnTable(HISTORY_COLUMNS, has_head=before is None)
    for entry in entries:
        day, clock = _day_and_clock(entry, tz)
        door_id = ABSENT if entry.door_id is None else str(entry.door_id)
        said = ": ".join(part for part in (entry.actor, entry.reason) if part)
        is_same_day = before and day == _day_and_clock(before, tz)[0]
        is_same_commit = before and entry.command_id == before.command_id
        table.add(
            str(entry.number),
            column_table.CellValue(
                clock if is_same_day else f"{day}\n{clock}", format_local(entry.happened_ns, tz)
            ),
            format_local(entry.recorded_ns, tz),
            entry.kind,
            door_id,
            _text(door_id if entry.door_id is None else names.get(entry.door_id, door_id)),
            words_of_entry(entry, class_in(objects, entry.door_id)),
            _text("" if is_same_commit else said),
            *(getattr(entry, part) or ABSENT for part in ("actor", "source", "reason")),
            style="dim" if entry.retracted else "",
        )
        before = entry
    return table


HISTORY_COLUMNS = [
    column_table.TableColumn("event", "event", right=True, width=6),
    column_table.TableColumn("happened", "happened", width=DATE_WIDTH),
    column_table.TableColumn("recorded"),
    column_table.TableColumn("kind"),
    column_table.TableColumn("door_id"),
    column_table.TableColumn("door", "door", width=16),
    column_table.TableColumn("what", "what", ratio=3, least=14),
    column_table.TableColumn("", "who: why", ratio=2, least=14, yields=1),
    column_table.TableColumn("actor"),
    column_table.TableColumn("source"),
    column_table.TableColumn("reason"),
]


def _day_and_clock(entry: HistoryEntry, tz: str) -> tuple[str, str]:
    """Return the date, and the time of day; an offset stands in a line of its own."""
    day, _, clock = format_short(entry.happened_ns, tz).partition(" ")
    return day, column_table.with_line_end(clock, TIME_WIDTH)


def _text(text: str, *, style: str = "") -> Text:
    """Return a text from outside with terminal control characters escaped."""
    return Text(printable(text), style=style)


def class_in(objects: Objects, door_id: DoorId | None) -> ObjectClass:
    """Return the class of an event's object."""
    return DOOR if door_id is None else objects.get(door_id, DOOR)


def words_of_entry(entry: HistoryEntry, of: ObjectClass = DOOR) -> Text:
    """Return an event in words: its content, its delay, the value before, and its retraction."""
    said = words_of(entry.event, of)
    late_ns = entry.recorded_ns - entry.happened_ns
    if late_ns > LATE_NS:
        said += f" (told {age(0, late_ns)} later)"
    return _text(said + _before(entry, of) + taken_back(entry))


def taken_back(entry: HistoryEntry) -> str:
    """Return that an event was retracted, and by which other if known."""
    if not entry.retracted:
        return ""
    by = "" if entry.retracted_by is None else f" by event {entry.retracted_by}"
    return f" (retracted{by})"


def _before(entry: HistoryEntry, of: ObjectClass) -> str:
    """Return the previous values of the fields that an event changed, such as `, was CLOSED`."""
    known = values_before(entry, of)
    if len(known) == 1:
        return f", was {known[0][1]}"
    said = ", ".join(f"{field} {value}" for field, value in known)
    return f"; was: {said}" if said else ""


def values_before(entry: HistoryEntry, of: ObjectClass) -> list[tuple[str, str]]:
    """Return (field, value before) of the fields that an event changed and that had a value."""
    known = [change for change in entry.changes if not _is_absent(change.before)]
    return [(change.field, _short(change.before, of)) for change in known]


def _is_absent(value: object) -> bool:
    return value is None or value == "" or (isinstance(value, float) and math.isnan(value))


def _short(value: object, of: ObjectClass = DOOR) -> str:
    if isinstance(value, DoorState):
        return of.word(value)
    return f"{value:.2f}" if isinstance(value, float) else str(value)


def coloured_state(state: DoorState, of: ObjectClass = DOOR) -> Text:
    """Return a state's name, in its colour."""
    return Text(printable(of.word(state)), style=STATE_COLOURS.get(state, OTHER_STATE_COLOUR))


def _number(value: float) -> str:
    return ABSENT if math.isnan(value) else f"{value:.3f}"


def _value(value: object, of: ObjectClass = DOOR) -> column_table.Cell:
    if isinstance(value, DoorState):
        return coloured_state(value, of)
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, bytes):
        return f"{len(value):,} bytes"
    shape = getattr(value, "shape", None)
    if shape is not None:
        return f"{shape[1]} x {shape[0]} cells"
    return _text(str(value))


def _who(door: Door) -> tuple[column_table.Cell, column_table.Cell, column_table.Cell]:
    """Return the id and the name, and both as they are drawn."""
    number = str(door.door_id)
    drawn = number if door.name is None else f"{number} {door.name}"
    return number, _text(door.name or ABSENT), _text(drawn)


def _door_in_short(door: Door) -> Text:
    place = f" at {door.x:.3f}, {door.y:.3f}" if door.is_placed else ""
    return coloured_state(door.state, door.object_class).append(place, style="default")


def _names(found: Diff) -> Names:
    """Return the names that doors have, or had, at the two moments of a diff."""
    doors = {**found.before.doors, **found.after.doors}
    return {door_id: door.name for door_id, door in doors.items() if door.name}


def _objects(found: Diff) -> Objects:
    """Return the classes of other objects at the two moments of a diff."""
    doors = {**found.before.doors, **found.after.doors}
    return {i: door.object_class for i, door in doors.items() if not door.object_class.is_door}


def _before_and_after(change: FieldChange) -> Iterator[tuple[column_table.Cell, column_table.Cell]]:
    """Yield a field's old and new value; of annotations, for each that changed."""
    if change.field != "annotations":
        of = change.door.object_class
        yield _value(change.before, of), _value(change.after, of)
        return
    for key in sorted({**change.before, **change.after}):
        before, after = change.before.get(key), change.after.get(key)
        if before != after:
            yield _text(f"{key} = {before or ABSENT}"), _text(f"{key} = {after or ABSENT}")


def _moment(door_map: DoorMap, tz: str) -> str:
    """Return the moment of the map, in words."""
    said = []
    if door_map.at_ns is not None:
        said.append(f"at {format_local(door_map.at_ns, tz)}")
    if door_map.known_at_ns is not None:
        said.append(f"as known at {format_local(door_map.known_at_ns, tz)}")
    said.append(f"up to event {door_map.event}" if door_map.event >= 0 else "no events")
    return ", ".join(said)
