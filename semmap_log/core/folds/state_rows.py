"""Who set the states of doors when: the writes of many events, as rows that can be sorted."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.registers import writes_of
from semmap_log.core.model.events import DoorObserved

COMES, GOES = 254, 255
"""In place of a state: the door is added, or removed."""

STATE_ROW: np.dtype[np.void] = np.dtype(
    [("door_id", "u4"), ("folds_ns", "i8"), ("number", "i8"), ("recorded_ns", "i8"),
     ("state", "u1"), ("is_sighting", "?"), ("accuracy_open", "f8"), ("accuracy_closed", "f8"),
     ("run", "i8")]
)  # fmt: skip
"""A write to a door's state; `run` is free for whoever groups them."""


def state_rows(batches: Iterable[EventBatch]) -> NDArray[np.void]:
    """Return the writes to states, and the comings and goings of doors, as `STATE_ROW`."""
    found = [np.empty(0, STATE_ROW)]
    for batch in batches:
        for writes in writes_of(batch):
            if writes.register not in ("state", "added", "removed"):
                continue
            places = writes.positions
            rows = np.zeros(len(places), STATE_ROW)
            rows["door_id"] = batch.door_ids()[places]
            rows["folds_ns"], rows["number"] = batch.folds_ns[places], batch.number[places]
            rows["recorded_ns"] = batch.recorded_ns[places]
            told = writes.values_of(np.arange(len(places)))
            rows["state"] = told.get("state", COMES if writes.register == "added" else GOES)
            is_seen = rows["is_sighting"] = batch.kind[places] == DoorObserved.kind
            if is_seen.any():
                seen = batch[DoorObserved][
                    np.searchsorted(batch.where(DoorObserved), places[is_seen])
                ]
                for name in ("accuracy_open", "accuracy_closed"):
                    rows[name][is_seen] = seen[name]
            found.append(rows)
    return np.concatenate(found)
