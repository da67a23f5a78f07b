"""What events said about how doors are, as compact columns: the store that evidence is made of."""

from __future__ import annotations

import io
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.doors import DoorId
from semmap_log.event_batch import EventBatch
from semmap_log.events import DoorAdded, DoorObserved, DoorPassed, DoorRemoved, DoorUpdated, Event
from semmap_log.projections.state_words import STATE_WORDS, sets_state, states_of

Rows = NDArray[np.void]


class Means(IntEnum):
    """How a word tells of a state."""

    ADDED = 0
    SET = 1
    SEEN = 2
    REMOVED = 3


WORD = np.dtype(
    [
        ("number", np.int64),
        ("time_ns", np.int64),
        ("door_id", np.uint32),
        ("sensor", np.uint32),
        ("means", np.uint8),
        ("state", np.uint8),
    ]
)
"""Of an event: its number, the time by which it folds, its door, which of the sensors saw it, how
it tells (`Means`), and what (`DoorState`)."""

CERTAIN = (1.0, 1.0)
"""The accuracies of what is not a reading, and of who went through a door."""

_MEANS: dict[type[Event], Means] = {
    DoorAdded: Means.ADDED,
    DoorUpdated: Means.SET,
    DoorObserved: Means.SEEN,
    DoorPassed: Means.SEEN,
    DoorRemoved: Means.REMOVED,
}


class Words:
    """Words about all doors, in any order; 26 bytes each."""

    def __init__(self) -> None:
        self._rows = np.empty(0, WORD)
        self._count = 0
        self._sensors: dict[tuple[float, float], int] = {CERTAIN: 0}
        self._index = _Index(np.empty(0, np.uint32))

    def __len__(self) -> int:
        return self._count

    def take(self, batch: EventBatch) -> None:
        """Take up what the events of a batch say."""
        for kind in STATE_WORDS:
            if kind in batch:
                told = batch[kind]
                chosen = np.flatnonzero(sets_state(kind, told))
                if len(chosen):
                    self._note(batch, kind, told, chosen)

    def _note(
        self, batch: EventBatch, kind: type[Event], told: Rows, chosen: NDArray[np.intp]
    ) -> None:
        rows = self._room_for(len(chosen))
        where = batch.where(kind)[chosen]
        rows["number"] = batch.number[where]
        rows["time_ns"] = np.minimum(batch.happened_ns[where], batch.recorded_ns[where])
        rows["door_id"] = told["door_id"][chosen]
        rows["means"] = _MEANS[kind]
        rows["state"] = states_of(kind, told)[chosen]
        rows["sensor"] = self._sensors_of(told[chosen]) if kind is DoorObserved else 0

    def add(self, other: Words) -> None:
        """Take up what other words say; events that both have would count twice."""
        codes = np.array([self._sensor(pair) for pair in other._sensors], np.uint32)
        rows = self._room_for(len(other))
        rows[:] = other._rows[: len(other)]
        rows["sensor"] = codes[rows["sensor"]]

    def door_ids(self) -> NDArray[np.uint32]:
        """Return which doors there are words about, ascending."""
        return np.unique(self._rows["door_id"][: self._count])

    def about(self, door_id: DoorId) -> Rows:
        """Return what is said of a door, in the order of the fold: by time, then by number."""
        behind = self._rows[self._index.count : self._count]
        if len(behind) > max(_FEW, self._index.count // 4):
            self._index = _Index(self._rows["door_id"][: self._count])
            behind = behind[:0]
        late = np.flatnonzero(behind["door_id"] == door_id) + self._index.count
        rows = self._rows[np.append(self._index.of(door_id), late)]
        order = np.lexsort((rows["number"], rows["time_ns"]))
        return rows[order]

    def newer(self, count: int) -> NDArray[np.uint32]:
        """Return which doors the words behind the first `count` are about."""
        return np.unique(self._rows["door_id"][count : self._count])

    def accuracies(self) -> NDArray[np.float64]:
        """Return (sensors, 2): P(reads open | open) and P(reads closed | closed) of each."""
        return np.array(list(self._sensors), np.float64)

    def dump(self) -> bytes:
        """Return the words as bytes."""
        out = io.BytesIO()
        for part in (self._rows[: self._count], self.accuracies()):
            np.lib.format.write_array(out, part, allow_pickle=False)
        return out.getvalue()

    @classmethod
    def load(cls, data: bytes) -> Words:
        """Return the words that `dump` made these bytes of.

        Raises:
            ValueError: They are not of its making.
        """
        source = io.BytesIO(data)
        rows, accuracies = (_array(source, dtype) for dtype in (WORD, np.dtype(np.float64)))
        if accuracies.shape != (len(accuracies), 2) or rows["sensor"].max(initial=0) >= max(
            1, len(accuracies)
        ):
            raise ValueError("words of sensors that are not told")
        words = cls()
        words._rows, words._count = rows, len(rows)
        words._sensors = {(a, b): code for code, (a, b) in enumerate(accuracies.tolist())}
        return words

    def _room_for(self, count: int) -> Rows:
        """Return that many new rows at the end, to be filled."""
        first, self._count = self._count, self._count + count
        if self._count > len(self._rows):
            grown = np.empty(max(self._count, 2 * len(self._rows), _FEW), WORD)
            grown[:first] = self._rows[:first]
            self._rows = grown
        return self._rows[first : self._count]

    def _sensors_of(self, told: Rows) -> NDArray[np.uint32]:
        accuracy_open, accuracy_closed = told["accuracy_open"], told["accuracy_closed"]
        first = (float(accuracy_open[0]), float(accuracy_closed[0]))
        if (accuracy_open == first[0]).all() and (accuracy_closed == first[1]).all():
            return np.full(len(told), self._sensor(first), np.uint32)
        pairs, places = np.unique(accuracy_open + 1j * accuracy_closed, return_inverse=True)
        codes = [self._sensor((pair.real, pair.imag)) for pair in pairs.tolist()]
        return np.array(codes, np.uint32)[places]

    def _sensor(self, accuracies: tuple[float, float]) -> int:
        return self._sensors.setdefault(accuracies, len(self._sensors))


class _Index:
    """Where in a column each door is."""

    def __init__(self, door_ids: NDArray[np.uint32]) -> None:
        self.count = len(door_ids)
        self._order = np.argsort(door_ids, kind="stable")
        self._sorted = door_ids[self._order]

    def of(self, door_id: DoorId) -> NDArray[np.intp]:
        """Return the places of a door, ascending."""
        wanted = np.uint32(door_id)  # any other type would have the whole column converted
        first, end = (np.searchsorted(self._sorted, wanted, side) for side in ("left", "right"))
        return self._order[first:end]


def _array(source: io.BytesIO, dtype: np.dtype[Any]) -> NDArray[Any]:
    array = np.lib.format.read_array(source, allow_pickle=False)
    if array.dtype != dtype:
        raise ValueError(f"expected {dtype}, got {array.dtype}")
    return array


_FEW = 1024
"""So many words are looked through rather than sorted."""
