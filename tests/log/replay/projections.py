"""Projections to test with."""

from __future__ import annotations

from typing import Any

import numpy as np

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.events import DoorAnnotated, DoorObserved


class Numbers:
    """The numbers of all events, in the order in which they came: shows every gap and repeat."""

    def initial(self) -> list[int]:
        return []

    def apply(self, state: list[int], batch: EventBatch) -> list[int]:
        state += batch.number.tolist()
        return state

    def merge(self, earlier: list[int], later: list[int]) -> list[int]:
        return earlier + later


class Texts:
    """What was said of doors."""

    name, version = "texts", 1

    def initial(self) -> list[str]:
        return []

    def apply(self, state: list[str], batch: EventBatch) -> list[str]:
        said = [one.event.value for one in batch if isinstance(one.event, DoorAnnotated)]
        return [*state, *said]


class Sums:
    """Arrays, changed in place: how often each door of at most 8 was seen in which state."""

    def initial(self) -> dict[str, Any]:
        return {"seen": np.zeros((8, 5), np.int64), "last_ns": np.full(8, -1, np.int64)}

    def apply(self, state: dict[str, Any], batch: EventBatch) -> dict[str, Any]:
        if DoorObserved in batch:
            rows, where = batch[DoorObserved], batch.where(DoorObserved)
            np.add.at(state["seen"], (rows["door_id"], rows["state"]), 1)
            np.maximum.at(state["last_ns"], rows["door_id"], batch.folds_ns[where])
        return state


class Digest:
    """A state of its own making, bytes of its own, a new one at each step."""

    name = "digest"
    version = "2"

    def initial(self) -> complex:
        return 0j

    def apply(self, state: complex, batch: EventBatch) -> complex:
        return state + complex(len(batch), int((batch.number * batch.number).sum()))

    def dump(self, state: complex) -> bytes:
        return f"{state.real:.0f} {state.imag:.0f}".encode()

    def load(self, data: bytes) -> complex:
        return complex(*map(float, data.split()))
