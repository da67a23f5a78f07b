"""One event as one JSON object, both ways: what `record` reads and `history --json` writes.

A line of an exported log says what the log knows of its event, too: `line_to_json`.

    {"kind": "DoorObserved", "door_id": 1, "state": "OPEN", "accuracy": 0.9,
     "happened": "2026-03-01T12:00:00.000000000Z"}

Keys are the event's fields; states and changed fields by name, absent numbers null, times ISO-8601
(`happened_ns` is `happened`). A salt is never shown. An event of a kind that a later version has
added has `newer` and its bytes, `cdr_base64`, instead of fields; such a line is not read.
"""

from __future__ import annotations

import base64
import math
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import RecordedEvent
from semmap_log.core.io.inflating import inflated
from semmap_log.core.model.commits import NO_CONTENT, Commit
from semmap_log.core.model.doors import DoorState, is_given
from semmap_log.core.model.events import (
    KINDS,
    DoorObserved,
    DoorUpdated,
    Event,
    FloorMap,
    UnknownEvent,
    told_fields,
)
from semmap_log.core.model.meaning import PARTS
from semmap_log.core.model.moments import format_utc
from semmap_log.core.model.rules import Nanoseconds, Rule

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
    of what the command asked for, where it has one; and `retracted`, where that is true.
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
    """Tell whether two events say the same, as JSON tells it.

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
    """Return the key of a field: a time is told as text, and so without its unit."""
    return name.removesuffix("_ns") if isinstance(rule, Nanoseconds) else name


_TIMES = {
    kind.kind: [
        (n, key_of(n, r)) for n, r in kind.rules.fields.items() if isinstance(r, Nanoseconds)
    ]
    for kind in KINDS
}
"""Kind -> its fields that are times, and their keys."""

_TOLD = {kind.kind: told_fields(kind) for kind in KINDS}


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
