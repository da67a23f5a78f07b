"""The events of a log of which the oldest were taken out: what stands for those that are gone.

The keyframe at the horizon holds, for each field of each door, who wrote it last: as an event of
that number and time it is put back. So a fold that begins with these events is in the state of the
horizon when it comes there. What was before nobody knows: from its adding on a door is UNKNOWN,
until what its state was at the horizon had happened.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch, RecordedEvent
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.registers import NEVER
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import Changed, DoorAdded, DoorUpdated, Event, event_of
from semmap_log.core.model.meaning import PARTS, REGISTER_OF
from semmap_log.errors import HorizonError
from semmap_log.log.replay.state import keyframe_at
from semmap_log.store.kind_bits import EVENT_BITS, EXPIRING_BITS
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.window import Window


def events_at_horizon(
    reader: LogReader, window: Window, doors: Collection[int] | None
) -> Iterator[EventBatch]:
    """Yield what a log still tells of the time before its horizon, as one batch.

    Args:
        reader: Of a log that has a horizon.
        window: Which events; it has no beginning, and ends behind the horizon.
        doors: Only events about these, where they are about a door; None: all.

    Raises:
        HorizonError: The state at the horizon cannot be read.
    """
    before = replace(window, before_event=reader.horizon, kinds=window.kinds & ~EXPIRING_BITS)
    left = [recorded for batch in reader.batches(before) for recorded in batch]
    state = _state_at_horizon(reader)
    found = [
        *_without_first_states(left, state),
        *_last_writes(state, but=[one.number for one in left]),
    ]
    if doors is not None:
        wanted = set(doors)
        found = [one for one in found if getattr(one.event, "door_id", None) in wanted]
    if found:
        yield _batch(found)


def last_writes(reader: LogReader) -> list[RecordedEvent]:
    """Return the state at a log's horizon, as far as no event that is left tells it.

    Each is an update with the number of an event that is gone, and says what that wrote of a door
    and no other wrote since; numbers ascend. When it was recorded is not known.

    Raises:
        HorizonError: The state at the horizon cannot be read.
    """
    before = Window(before_event=reader.horizon, kinds=EVENT_BITS & ~EXPIRING_BITS)
    left = [number for batch in reader.batches(before) for number in batch.number.tolist()]
    found = _last_writes(_state_at_horizon(reader), but=left)
    return sorted(found, key=lambda one: one.number)


def _state_at_horizon(reader: LogReader) -> DoorMapState:
    place = reader.horizon_place()
    state = keyframe_at(reader.segments[place.segment], place.chunk)
    if state is None:
        raise HorizonError(
            f"{reader.folder}: the state at its horizon, event {reader.horizon}, is not there or "
            "cannot be used; verify the log."
        )
    return state


def _without_first_states(
    left: list[RecordedEvent], state: DoorMapState
) -> Iterator[RecordedEvent]:
    """Yield events, those that add a door with UNKNOWN where its state was another later."""
    for one in left:
        event = one.event
        if isinstance(event, DoorAdded):
            stamp = state.stamp(event.door_id, "state")
            if stamp is None or stamp[1] != one.number:
                event = replace(event, state=DoorState.UNKNOWN)
        yield replace(one, event=event)


def _last_writes(state: DoorMapState, *, but: list[int]) -> Iterator[RecordedEvent]:
    """Yield who wrote the fields of each door last, as updates; not the events of these numbers."""
    arrays = state.to_arrays()
    written: dict[tuple[int, int, int], dict[str, Any]] = {}
    for part in PARTS:
        register = REGISTER_OF[part]
        happened, numbers = arrays[f"{register}_happened_ns"], arrays[f"{register}_event"]
        for row in np.flatnonzero(~np.isin(numbers, [NEVER, *but])).tolist():
            key = (int(numbers[row]), int(happened[row]), int(arrays["door_id"][row]))
            values = written.setdefault(key, {"changed": Changed(0)})
            values["changed"] |= part
            values |= {name: arrays[name][row].item() for name in PARTS[part]}
    for (number, happened_ns, door_id), values in written.items():
        yield RecordedEvent(number, happened_ns, _update(door_id, values, happened_ns))


def _update(door_id: int, values: dict[str, Any], happened_ns: int) -> Event:
    nothing = {"level": 0, "x": 0.0, "y": 0.0, "theta": 0.0, "width": 0.0, "state": 0,
               "prob_open": np.nan, "prob_closed": np.nan}  # fmt: skip
    return event_of(DoorUpdated, nothing | values | {"door_id": door_id}, happened_ns)


def _batch(events: list[RecordedEvent]) -> EventBatch:
    events = sorted(events, key=lambda one: one.number)
    made = EventBatch.from_events([one.event for one in events])
    numbers = np.array([one.number for one in events], np.int64)
    recorded = np.array([one.recorded_ns for one in events], np.int64)
    return replace(made, number=numbers, recorded_ns=recorded, known_door_ids=None)
