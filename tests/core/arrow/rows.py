"""What the tables should hold, told event by event; and logs with something of everything."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow as pa

import semmap_log as sl
from semmap_log.core.arrow.table import COLUMNS
from semmap_log.core.batches.event_batch import RecordedEvent
from semmap_log.core.folds.history import HistoryEntry
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorEvent,
    DoorUpdated,
    Event,
    FloorMap,
    LevelAdded,
    field_names,
)
from semmap_log.errors import CommandError, InvalidEventError
from semmap_log.log.door_log.known_past import Validator
from tests.conftest import SteadyClock

UPDATED = {
    "level": Changed.POSE, "x": Changed.POSE, "y": Changed.POSE, "theta": Changed.POSE,
    "width": Changed.WIDTH, "state": Changed.STATE,
    "prob_open": Changed.PROB_OPEN, "prob_closed": Changed.PROB_CLOSED,
}  # fmt: skip


def row_of(recorded: RecordedEvent) -> dict[str, Any]:
    """Return the row of one event, times as nanoseconds."""
    event = recorded.event
    row: dict[str, Any] = {column.name: None for column in COLUMNS}
    row |= {
        "event": recorded.number,
        "kind": type(event).__name__,
        "happened": recorded.happened_ns,
        "recorded": recorded.recorded_ns,
    }
    for name in field_names(type(event)):
        if isinstance(event, DoorUpdated) and name in UPDATED and not event.changed & UPDATED[name]:
            continue
        row |= _cells(name, getattr(event, name))
    return row


def _cells(name: str, value: Any) -> dict[str, Any]:
    if name == "salt":
        return {}
    if name == "cells":
        height, width = value.shape
        return {"cells": value.flatten().tolist(), "cells_width": width, "cells_height": height}
    if isinstance(value, DoorState):
        return {name: value.name}
    if isinstance(value, Changed):
        return {name: "|".join(bit.name or "" for bit in Changed if bit in value)}
    if isinstance(value, float) and math.isnan(value):
        return {name: None}
    return {"at" if name == "at_ns" else name: value}


def stamp(entry: HistoryEntry) -> tuple[int, int]:
    """Return by what it is ordered."""
    return entry.folds_ns, entry.number


def history_rows(entries: Sequence[HistoryEntry]) -> Iterator[dict[str, Any]]:
    """Yield the row of each entry, found by looking at all the others."""
    counting = [entry for entry in entries if not entry.retracted]
    for entry in entries:
        yield {
            **row_of(entry.recorded),
            **dict(zip(("door_name", "level_name"), called(entry, counting), strict=True)),
            "actor": entry.actor or None,
            "source": entry.source or None,
            "reason": entry.reason or None,
            "correlation": entry.correlation or None,
            "command_id": entry.command_id.hex(),
            "retracted": entry.retracted,
        }


def called(entry: HistoryEntry, counting: Sequence[HistoryEntry]) -> tuple[str | None, str | None]:
    """Return what an entry's door was called in that moment, and the level it was on."""
    then = sorted((each for each in counting if each.folds_ns <= entry.folds_ns), key=stamp)
    before = [each for each in then if stamp(each) <= stamp(entry)]
    name, level = None, getattr(entry.event, "level", None)
    if isinstance(entry.event, DoorEvent):
        name, level = None, None
        mine = [e for e in counting if getattr(e.event, "door_id", None) == entry.event.door_id]
        added = [stamp(each) for each in mine if isinstance(each.event, DoorAdded)]
        for each in then:
            if each not in mine or (added and stamp(each) < added[0]):
                continue
            match each.event:
                case DoorAnnotated(key="name", value=value):
                    name = value or None
                case DoorAdded(level=put) if each in before:
                    level = put
                case DoorUpdated(changed=changed, level=put) if (
                    Changed.POSE in changed and each in before
                ):
                    level = put
    if level is None:
        return name, None
    names = [e.event.name for e in then
             if isinstance(e.event, LevelAdded) and e.event.level == level]  # fmt: skip
    return name, (names[-1] if names else "") or str(level)


def rows_of(table: pa.Table) -> list[dict[str, Any]]:
    """Return the rows of a table, times as nanoseconds."""
    for i, field in enumerate(table.schema):
        if pa.types.is_timestamp(field.type):
            table = table.set_column(i, field.name, table.column(i).cast(pa.int64()))
    return table.to_pylist()


def write_any(path: Path, commits: Iterable[tuple[list[Event], sl.Note]]) -> Path:
    """Write a log of four doors and those of the events that the map lets pass, and return it."""
    with sl.create(path, tz="Europe/Vienna", clock=SteadyClock(), compact=False) as log:
        for _ in range(4):
            log.add_door()
        for events, note in commits:
            validator = Validator(log.door_index, log.state.event + 1, past=log.known_past)
            passed = [event for event in map(_about_our_doors, events) if _may(validator, event)]
            if passed:
                log.append(passed, note=note)
    return path


def _about_our_doors(event: Event) -> Event:
    if isinstance(event, DoorEvent):
        return replace(event, door_id=DoorId(1 + event.door_id % 4))
    if isinstance(event, FloorMap):
        return replace(event, level=event.level % 3)
    return event


def _may(validator: Validator, event: Event) -> bool:
    try:
        validator.check(event)
    except (CommandError, InvalidEventError):
        return False
    return True
