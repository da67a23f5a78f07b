"""What events said about how doors are, as compact columns: the store that evidence is made of."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.doors import DoorId
from semmap_log.event_batch import EventBatch
from semmap_log.events import (
    MAX_TIME_NS,
    DoorAdded,
    DoorObserved,
    DoorPassed,
    DoorRemoved,
    DoorUpdated,
    Event,
)
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


class Sensor(NamedTuple):
    """What a sighting is from."""

    accuracy_open: float
    accuracy_closed: float
    source: str
    """Which one it was, as the commit's note says; empty: it does not."""

    @property
    def eye(self) -> object:
        """What looks again in a pass: the source, however sure it is each time.

        Where none is named, sensors of the same accuracies are taken to be one.
        """
        return self.source or (self.accuracy_open, self.accuracy_closed)


CERTAIN = Sensor(1.0, 1.0, "")
"""Of what is not a reading, and of who went through a door."""

_MEANS: dict[type[Event], Means] = {
    DoorAdded: Means.ADDED,
    DoorUpdated: Means.SET,
    DoorObserved: Means.SEEN,
    DoorPassed: Means.SEEN,
    DoorRemoved: Means.REMOVED,
}


class Sensors(NamedTuple):
    """What is known of sensors, as columns."""

    accuracy_open: NDArray[np.float64]
    accuracy_closed: NDArray[np.float64]
    eye: NDArray[np.intp]
    """The same for those that are taken to be one: `Sensor.eye`."""


class Words:
    """Words about all doors, in any order; 26 bytes each."""

    def __init__(self) -> None:
        self._rows = np.empty(0, WORD)
        self._count = 0
        self._sensors: dict[Sensor, int] = {CERTAIN: 0}
        self._as_columns: Sensors | None = None
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
        sensors: NDArray[np.uint32] | int = 0
        if kind is DoorObserved:
            codes, names = batch.sources(kind)
            sensors = self._sensors_of(told[chosen], codes[chosen], names)
        rows = self._room_for(len(chosen))
        where = batch.where(kind)[chosen]
        rows["number"] = batch.number[where]
        rows["time_ns"] = np.minimum(batch.happened_ns[where], batch.recorded_ns[where])
        rows["door_id"] = told["door_id"][chosen]
        rows["means"] = _MEANS[kind]
        rows["state"] = states_of(kind, told)[chosen]
        rows["sensor"] = sensors

    def add(self, other: Words) -> None:
        """Take up what other words say; events that both have would count twice."""
        codes = np.array([self._code(sensor) for sensor in other._sensors], np.uint32)
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

    def earliest_ns(self, count: int) -> int:
        """Return the least time of the words behind the first `count`; without any, no time."""
        return int(self._rows["time_ns"][count : self._count].min(initial=MAX_TIME_NS))

    def sensors(self) -> Sensors:
        """Return the sensors by their places, as `WORD` has them."""
        if self._as_columns is not None and len(self._as_columns.eye) == len(self._sensors):
            return self._as_columns
        eyes: dict[object, int] = {}
        codes = [eyes.setdefault(sensor.eye, len(eyes)) for sensor in self._sensors]
        accuracies = np.array([sensor[:2] for sensor in self._sensors], np.float64)
        columns = (accuracies[:, 0], accuracies[:, 1], np.array(codes, np.intp))
        self._as_columns = Sensors(*columns)
        return self._as_columns

    def dump(self) -> bytes:
        """Return the words as bytes."""
        out = io.BytesIO()
        np.lib.format.write_array(out, self._rows[: self._count], allow_pickle=False)
        return out.getvalue() + json.dumps(list(self._sensors)).encode()

    @classmethod
    def load(cls, data: bytes) -> Words:
        """Return the words that `dump` made these bytes of.

        Raises:
            ValueError: They are not of its making.
        """
        source = io.BytesIO(data)
        rows = np.lib.format.read_array(source, allow_pickle=False)
        sensors = [Sensor(float(a), float(b), str(name)) for a, b, name in json.load(source)]
        if rows.dtype != WORD or rows["sensor"].max(initial=0) >= len(sensors):
            raise ValueError("not words, or words of sensors that are not told")
        words = cls()
        words._rows, words._count = rows, len(rows)
        words._sensors = {sensor: code for code, sensor in enumerate(sensors)}
        return words

    def _room_for(self, count: int) -> Rows:
        """Return that many new rows at the end, to be filled."""
        first, self._count = self._count, self._count + count
        if self._count > len(self._rows):
            grown = np.empty(max(self._count, 2 * len(self._rows), _FEW), WORD)
            grown[:first] = self._rows[:first]
            self._rows = grown
        return self._rows[first : self._count]

    def _sensors_of(
        self, told: Rows, sources: NDArray[np.intp], names: Sequence[str]
    ) -> NDArray[np.uint32]:
        """Return the places of sightings' sensors; of each different one it is looked up once."""
        columns = (told["accuracy_open"], told["accuracy_closed"], sources)
        if all((column == column[0]).all() for column in columns):
            return np.full(len(told), self._code_of(columns, 0, names), np.uint32)
        pairs, of_pair = np.unique(columns[0] + 1j * columns[1], return_inverse=True)
        kinds = of_pair + len(pairs) * sources
        _, one, of_kind = np.unique(kinds, return_index=True, return_inverse=True)
        codes = [self._code_of(columns, row, names) for row in one.tolist()]
        return np.array(codes, np.uint32)[of_kind]

    def _code_of(self, columns: tuple[NDArray[Any], ...], row: int, names: Sequence[str]) -> int:
        accuracy_open, accuracy_closed, source = (column[row].item() for column in columns)
        return self._code(Sensor(accuracy_open, accuracy_closed, names[source]))

    def _code(self, sensor: Sensor) -> int:
        return self._sensors.setdefault(sensor, len(self._sensors))


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


_FEW = 1024
"""So many words are looked through rather than sorted."""
