"""Door maps, histories, diffs and single events as JSON: the verbs' `--json`, and JSON lines.

An event is one object, both for `record`, which reads it, and for `history --json`. A line of an
exported log also has what the log knows about the event: `line_to_json`.

    {"kind": "DoorObserved", "door_id": 1, "state": "OPEN", "accuracy": 0.9,
     "happened": "2026-03-01T12:00:00.000000000Z"}

Keys are the event's fields; states and changed fields by name, absent numbers null, times ISO-8601
UTC with nanoseconds (`happened_ns` is `happened`). A salt is never shown. An event of a kind that a
later version has added has `newer` and its bytes, `cdr_base64`, instead of fields; such a line is
not read.
"""

from __future__ import annotations

import base64
import math
import zlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import RecordedEvent
from semmap_log.core.folds.history import Diff, FieldChange, HistoryEntry
from semmap_log.core.io.inflating import inflated
from semmap_log.core.model.commits import NO_CONTENT, Commit
from semmap_log.core.model.doors import Door, DoorMap, DoorState, Level, ObjectClass, is_given
from semmap_log.core.model.events import (
    KINDS,
    DoorObserved,
    DoorUpdated,
    Event,
    FloorMap,
    UnknownEvent,
    public_fields,
)
from semmap_log.core.model.meaning import FIELDS, PARTS
from semmap_log.core.model.moments import SECOND_NS, format_utc
from semmap_log.core.model.rules import Nanoseconds, Rule

if TYPE_CHECKING:
    from semmap_log.analysis.day import Day
    from semmap_log.core.folds.timeline import Hold, Interval, Timeline


def door_map_to_json(door_map: DoorMap) -> dict[str, Any]:
    """Return a door map: the moment, the levels, and the doors with ids ascending.

    Where classes of other objects are defined, these, and of each door what it is.
    """
    return {
        "event": door_map.event if door_map.event >= 0 else None,
        "at": _time(door_map.at_ns),
        "known_at": _time(door_map.known_at_ns),
        "levels": [_level(level) for level in door_map.levels.values()],
        **({"classes": list(map(_class, door_map.classes.values()))} if door_map.classes else {}),
        "doors": [door_to_json(door, door_map) for door in door_map.doors.values()],
    }


def door_to_json(door: Door, door_map: DoorMap) -> dict[str, Any]:
    """Return a door; `door_map` has its level's name."""
    level = door_map.levels.get(door.level)
    return {
        "door_id": door.door_id,
        "name": door.name,
        "level": door.level,
        "level_name": level.name if level else None,
        **{name: _value(getattr(door, name)) for name in FIELDS},
        "last_seen": _time(door.last_seen_ns),
        "last_event": door.last_event,
        "annotations": dict(door.annotations),
        **(_what(door) if door_map.classes else {}),
    }


def _what(door: Door) -> dict[str, Any]:
    """Return what an object is, and what that calls its state."""
    return {"class": door.object_class.name, "state_word": door.state_word}


def _class(one: ObjectClass) -> dict[str, Any]:
    return {
        "name": one.name,
        "geometry": one.geometry.value,
        "states": list(one.words),
        "blocks": [one.word(state) for state in sorted(one.blocks)],
    }


def entry_to_json(entry: HistoryEntry) -> dict[str, Any]:
    """Return an event of a history, with who and why."""
    shown = event_to_json(entry.recorded)
    return {
        "event": shown.pop("event"),
        "kind": shown.pop("kind"),
        "door_id": shown.pop("door_id", None),
        "happened": shown.pop("happened"),
        "recorded": shown.pop("recorded"),
        **shown,
        "actor": entry.actor or None,
        "source": entry.source or None,
        "reason": entry.reason or None,
        "correlation": entry.correlation or None,
        "command_id": entry.command_id.hex(),
        "retracted": entry.retracted,
        "changes": [
            {"field": c.field, "before": _value(c.before), "after": _value(c.after)}
            for c in entry.changes
        ],
    }


def diff_to_json(found: Diff) -> dict[str, Any]:
    """Return the difference of two moments, and the events that made it.

    What `door_map_to_json` gives of the first, changed by this, is what it gives of the second:
    `added`, `removed`, `changed`, `heard` (when and by which event doors were last heard of) and
    `levels` name all that differs.
    """
    return {
        "from": _time(found.before.at_ns),
        "from_event": found.before.event if found.before.event >= 0 else None,
        "to": _time(found.after.at_ns),
        "to_event": found.after.event if found.after.event >= 0 else None,
        "added": [door_to_json(door, found.after) for door in found.added],
        "removed": [door_to_json(door, found.before) for door in found.removed],
        "changed": [_change(change) for change in found.changed],
        "heard": [_change(change) for change in found.heard],
        "levels": [
            {
                "level": change.number,
                "before": None if change.before is None else _level(change.before),
                "after": None if change.after is None else _level(change.after),
            }
            for change in found.levels
        ],
        "events": [entry_to_json(entry) for entry in found.events],
    }


def _change(change: FieldChange) -> dict[str, Any]:
    """Return a field's change; times are called as in `door_to_json`."""
    is_time = change.field == "last_seen_ns"
    before, after = (
        _time(value) if is_time else _value(value) for value in (change.before, change.after)
    )
    return {
        "door_id": change.door.door_id,
        "name": change.door.name,
        "field": change.field.removesuffix("_ns").removeprefix("object_"),
        "before": before,
        "after": after,
    }


def _level(level: Level) -> dict[str, Any]:
    return {
        "level": level.level,
        "name": level.name,
        "elevation": _number(level.elevation),
        "floor_map_event": level.floor_map_event,
    }


def _value(value: Any) -> Any:
    if isinstance(value, DoorState):
        return value.name
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, ObjectClass):
        return _class(value)
    return _number(value) if isinstance(value, float) else value


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value


def _time(ns: int | None) -> str | None:
    return None if ns is None else format_utc(ns)


def day_to_json(day: Day) -> dict[str, Any]:
    """Return the half hours' edges, and of each door how much of each it was open.

    `open` is the share of the time known to be open or closed (null: none was), `known` is that
    time's share of the half hour.
    """
    return {
        "date": day.date,
        "edges": [format_utc(edge) for edge in day.edges_ns.tolist()],
        "doors": [
            {
                "door_id": door.door_id,
                "name": door.label,
                "changes": door.changes,
                "open": _rounded(door.shares.opened),
                "known": _rounded(door.shares.known),
            }
            for door in day.doors
        ],
    }


def _rounded(shares: NDArray[np.float64]) -> list[float | None]:
    return [None if np.isnan(share) else round(share, 4) for share in shares.tolist()]


def timeline_to_json(timeline: Timeline, *, name: str | None = None) -> dict[str, Any]:
    """Return the intervals, the earliest first, and how many seconds each state lasted in all.

    `seen_seconds` leaves out the lapses: the times in which no sighting held.

    Args:
        timeline: A door's.
        name: What it is called.
    """
    return {
        "door_id": timeline.door_id,
        "name": name,
        "removed": timeline.removed,
        "intervals": [_interval(interval) for interval in timeline],
        "seconds": {
            state.name: int(timeline.duration_ns[timeline.state == state].sum()) / SECOND_NS
            for state in DoorState
            if (timeline.state == state).any()
        },
        "seen_seconds": {
            state.name: timeline.total_ns(state) / SECOND_NS
            for state in DoorState
            if (timeline.state == state).any()
        },
        "lapses": [
            {"since": format_utc(start), "until": format_utc(end)}
            for start, end in zip(
                timeline.lapse_start_ns.tolist(), timeline.lapse_end_ns.tolist(), strict=True
            )
        ],
        "hold": None if timeline.hold is None else _hold(timeline.hold),
    }


def _hold(hold: Hold) -> dict[str, Any]:
    return {
        "seconds": hold.ns / SECOND_NS,
        "gaps": hold.gaps,
        "gap_seconds": hold.gap_ns / SECOND_NS,
        "looks": hold.looks,
        "is_measured": hold.is_measured,
    }


def _interval(interval: Interval) -> dict[str, Any]:
    return {
        "since": format_utc(interval.start_ns),
        "until": format_utc(interval.end_ns),
        "state": interval.state.name,
        "sightings": interval.sightings,
        "event": interval.event,
        "seen_seconds": interval.seen_ns / SECOND_NS,
    }


NOTE_KEYS = ("actor", "source", "reason", "correlation")


def event_to_json(
    event: RecordedEvent | Event, *, note: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Return the event as a value that `json.dumps` writes.

    A RecordedEvent has its number (`event`) and `recorded` time, too; of `note` (actor, source,
    reason, correlation) what is not empty is added.
    """
    if isinstance(event, RecordedEvent):
        shown = {"event": event.number, **event_to_json(event.event)}
        shown["recorded"] = format_utc(event.recorded_ns)
    else:
        shown = {"kind": type(event).__name__, **_fields(event)}
        if event.happened_ns is not None:
            shown["happened"] = format_utc(event.happened_ns)
    return shown | {key: text for key, text in (note or {}).items() if text}


def line_to_json(event: RecordedEvent, commit: Commit, *, retracted: bool) -> dict[str, Any]:
    """Return an event with all that `import` needs to make the same log of it.

    Besides the event, its number, its times and its note: the `command_id` of its commit; `commit`,
    the numbers of the commit's first and last event, where it has several; `content`, the digest
    of the command's content, where it has one; and `retracted`, where that is true.
    """
    note = {key: getattr(commit.note, key) for key in NOTE_KEYS}
    shown = event_to_json(event, note=note)
    shown["command_id"] = commit.command_id.hex()
    if commit.count > 1:
        shown["commit"] = [commit.first_event, commit.last_event]
    if commit.content != NO_CONTENT:
        shown["content"] = commit.content.hex()
    if retracted:
        shown["retracted"] = True
    return shown


def means_same(given: Event, stored: Event) -> bool:
    """Return whether two events are equal in JSON.

    Fields that an update does not set mean nothing; a time or a level that is not given is any.
    """
    mine, its = event_to_json(given), event_to_json(stored)
    if "happened" not in mine:
        its.pop("happened", None)
    if "level" in mine and not is_given(mine["level"]):
        mine["level"] = its.get("level")
    return mine == its


def _fields(event: Event) -> dict[str, Any]:
    if isinstance(event, FloorMap):
        return _floor_map_fields(event)
    if isinstance(event, UnknownEvent):
        return {"newer": True, "cdr_base64": base64.b64encode(event.data).decode()}
    values = {name: getattr(event, name) for name in _TOLD[event.kind]}
    if isinstance(event, DoorUpdated):
        kept = {"door_id", *event.values_set()}
        values = {name: value for name, value in values.items() if name in kept}
        values["changed"] = [part.name for part in PARTS if part & event.changed]
    if isinstance(event, DoorObserved) and event.accuracy_open == event.accuracy_closed:
        values["accuracy"] = values.pop("accuracy_open")
        del values["accuracy_closed"]
    for name, key in _TIMES.get(event.kind, ()):
        values[key] = format_utc(values.pop(name))
    return {name: _plain(value) for name, value in values.items()}


def key_of(name: str, rule: Rule) -> str:
    """Return the key of a field: a time is a text in JSON, so its key has no unit."""
    return name.removesuffix("_ns") if isinstance(rule, Nanoseconds) else name


_TIMES = {
    kind.kind: [
        (n, key_of(n, r)) for n, r in kind.rules.fields.items() if isinstance(r, Nanoseconds)
    ]
    for kind in KINDS
}
"""Kind -> its fields that are times, and their keys."""

_TOLD = {kind.kind: public_fields(kind) for kind in KINDS}


def _plain(value: object) -> object:
    if isinstance(value, DoorState):
        return value.name
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


FLOOR_MAP_KEYS = (
    "level", "resolution", "origin_x", "origin_y", "origin_theta",
    "width", "height", "cells_zlib_base64",
)  # fmt: skip
MOST_CELLS = 100_000_000


def _floor_map_fields(event: FloorMap) -> dict[str, Any]:
    """Return the keys of `FLOOR_MAP_KEYS`: width and height in cells, the cells row by row."""
    height, width = event.cells.shape
    packed = zlib.compress(event.cells.tobytes(), level=6)
    return {
        "level": event.level,
        "resolution": event.resolution,
        "origin_x": event.origin_x,
        "origin_y": event.origin_y,
        "origin_theta": event.origin_theta,
        "width": width,
        "height": height,
        "cells_zlib_base64": base64.b64encode(packed).decode(),
    }


def unpack_cells(text: str, *, width: int, height: int) -> NDArray[np.int8]:
    """Return the cells that a FloorMap's `cells_zlib_base64` holds, int8, (height, width).

    Raises:
        ValueError: They are not that, or not that many.
    """
    if width < 0 or height < 0 or width * height > MOST_CELLS:
        raise ValueError(f"expected at most {MOST_CELLS:,} cells, got {width} x {height}")
    size = width * height
    raw = inflated(base64.b64decode(text, validate=True), size)
    if len(raw) != size:
        raise ValueError(f"expected {size:,} cells of {width} x {height}, got {len(raw):,}")
    return np.frombuffer(raw, np.int8).reshape(height, width)
