"""What each event changed in the map: the value that a field of a door had before, and since.

Seen in the order of event numbers: what the log knew when the event was recorded, and what it knew
then. A late event that something newer outranks changes nothing.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.registers import NEVER, Writes, writes_of
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import DoorAnnotated


@dataclass(frozen=True, slots=True)
class ValueChange:
    """A field of a door, or a key of its annotations, that an event gave another value."""

    field: str
    before: Any
    """None: it had none."""
    after: Any


Changes = dict[int, tuple[ValueChange, ...]]
"""Event number -> what it changed; events that changed nothing are left out."""


def changes_of(batch: EventBatch, state: DoorMapState) -> Changes:
    """Return what the events of a batch change.

    Args:
        batch: Events without gaps in their numbers, none of them a retraction.
        state: The map before the first of them.
    """
    found: dict[int, list[ValueChange]] = defaultdict(list)
    by_register: dict[str, list[Writes]] = defaultdict(list)
    for writes in writes_of(batch):
        by_register[writes.register].append(writes)
    for register, parts in by_register.items():
        for number, change in _changes_of_register(batch, state, register, parts):
            found[number].append(change)
    for number, change in _changes_of_texts(batch, state):
        found[number].append(change)
    return {number: tuple(changes) for number, changes in sorted(found.items())}


def _changes_of_register(
    batch: EventBatch, state: DoorMapState, register: str, parts: list[Writes]
) -> Iterator[tuple[int, ValueChange]]:
    """Yield (event number, change) of one register of all doors.

    The value before a write is that of the greatest stamp among those before it, the state's own
    included: a running maximum over the writes to each door, in the order of their numbers.
    """
    where = np.concatenate([part.positions for part in parts])
    in_order = np.argsort(where)
    where = where[in_order]
    doors, group = np.unique(batch.door_ids()[where], return_inverse=True)
    known_ns, known_events, known = state.register_of(doors, register)
    happened = np.concatenate([known_ns, batch.folds_ns[where]])
    numbers = np.concatenate([known_events, batch.number[where]])
    groups = np.concatenate([np.arange(len(doors)), group])
    by_stamp = np.lexsort((numbers, happened, groups))
    rank = np.empty(len(groups), np.int64)
    rank[by_stamp] = np.arange(len(groups))
    rows = np.argsort(groups, kind="stable")  # of each door: what was known, then the writes
    greatest = np.maximum.accumulate(rank[rows])
    counts = rank[rows][1:] > greatest[:-1]
    counts &= rows[1:] >= len(doors)
    before, after = by_stamp[greatest[:-1]][counts], rows[1:][counts]
    written = [part.values_of(np.arange(len(part.positions))) for part in parts]
    for name, old in known.items():
        new = np.concatenate([values[name] for values in written])[in_order]
        values = np.concatenate([old, new])
        was, now = values[before], values[after]
        is_new = numbers[before] == NEVER
        is_empty = np.isnan(now)
        differs = np.where(is_new, ~is_empty, (was != now) & ~(np.isnan(was) & is_empty))
        told = zip(
            numbers[after][differs].tolist(), is_new[differs].tolist(),
            was[differs].tolist(), now[differs].tolist(), strict=True,
        )  # fmt: skip
        for number, first, one, other in told:
            yield number, ValueChange(name, None if first else _value(name, one),
                                      _value(name, other))  # fmt: skip


def _changes_of_texts(batch: EventBatch, state: DoorMapState) -> Iterator[tuple[int, ValueChange]]:
    if DoorAnnotated not in batch:
        return
    where = batch.where(DoorAnnotated)
    said: dict[tuple[int, str], tuple[tuple[int, int], str]] = {}
    stamps = zip(batch.folds_ns[where].tolist(), batch.number[where].tolist(), strict=True)
    for event, stamp in zip(batch.objects[DoorAnnotated.kind], stamps, strict=True):
        assert isinstance(event, DoorAnnotated)
        place = (event.door_id, event.key)
        before = said.get(place) or state.text(*place)
        if before is not None and before[0] > stamp:
            continue
        said[place] = (stamp, event.value)
        if before is None or before[1] != event.value:
            yield stamp[1], ValueChange(event.key, before and before[1], event.value)


def _value(name: str, value: Any) -> Any:
    return DoorState.of(value) if name == "state" else value
