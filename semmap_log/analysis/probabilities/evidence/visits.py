"""Reports about doors as compact rows, and sightings grouped into visits.

The rows are the store that evidence is made of. What a sensor says again and again in one pass is
one proof, not many.
"""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch, distinct
from semmap_log.core.folds import door_changes
from semmap_log.core.folds.thinned_runs import sightings_of_runs
from semmap_log.core.folds.timeline import pass_begins
from semmap_log.core.model import events
from semmap_log.core.model.doors import DoorId

LEAST_ACCURACY, MOST_ACCURACY = 0.5, 0.999
"""The bounds of a sensor's accuracies; no reading proves more."""

_FINE = 2.0**32
"""Sums are of whole parts of a nat, so that they do not depend on what else is summed up."""


class Visits(NamedTuple):
    """Which visit each sighting belongs to, and what it adds."""

    visit: NDArray[np.intp]
    """(k,), counted from 0 in the order in which they begin."""
    llr: NDArray[np.float64]
    """(k,), nats: sightings of a visit add up, at each of them, to the mean of those so far."""


def llr_of(
    reads_open: NDArray[np.bool_],
    accuracy_open: NDArray[np.float64],
    accuracy_closed: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return log P(reading | open) / P(reading | closed) of readings by themselves, in nats."""
    when_open = np.clip(accuracy_open, LEAST_ACCURACY, MOST_ACCURACY)
    when_closed = np.clip(accuracy_closed, LEAST_ACCURACY, MOST_ACCURACY)
    return np.where(
        reads_open,
        np.log(when_open / (1 - when_closed)),
        np.log((1 - when_open) / when_closed),
    )


def visits_of(
    seen_ns: NDArray[np.int64],
    sensor: NDArray[np.integer[Any]],
    segment: NDArray[np.intp],
    llr: NDArray[np.float64],
) -> Visits:
    """Return the visits that sightings of one door make.

    Args:
        seen_ns: (k,), ascending.
        sensor: (k,): what looked; sightings of different ones belong to different visits, however
            they mix.
        segment: (k,), never falling: a visit lies in one of them.
        llr: (k,): what each would say by itself.
    """
    order = np.argsort(sensor, kind="stable")
    first = _firsts(seen_ns[order], sensor[order], segment[order])
    added = np.empty(len(llr))
    added[order] = _added(llr[order], first)
    is_first = first == np.arange(len(first))
    # Passes come sensor by sensor here; they are counted by when they began.
    begins = np.zeros(len(first), np.bool_)
    begins[order[is_first]] = True
    visit = np.empty(len(first), np.intp)
    visit[order] = (np.cumsum(begins) - 1)[order[first]]
    return Visits(visit, added)


def _firsts(
    seen_ns: NDArray[np.int64], sensor: NDArray[np.integer[Any]], segment: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Return the place of the first sighting of each one's pass; sensor by sensor."""
    is_parted = (np.diff(segment) != 0) | (sensor[1:] != sensor[:-1])
    begins = pass_begins(seen_ns, is_parted)
    return np.maximum.accumulate(np.where(begins, np.arange(len(begins)), 0))


def _added(llr: NDArray[np.float64], first: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return how much each sighting changes the mean of its pass."""
    place = np.arange(len(llr))
    fine = np.rint(llr * _FINE).astype(np.int64)
    total = np.cumsum(fine)
    mean = (total - total[first] + fine[first]) / (place - first + 1) / _FINE
    return np.where(place == first, llr, mean - np.append(0.0, mean[:-1]))


Rows = NDArray[np.void]


REPORT = np.dtype(
    [
        *(
            (name, door_changes.STATE_CHANGE[name])
            for name in door_changes.STATE_CHANGE.names or ()
        ),
        ("sensor", "u4"),
    ]
)
"""An event's report of a door's state, and the sensor that saw it: 26 bytes."""


class Sensor(NamedTuple):
    """What a sighting is from."""

    accuracy_open: float
    accuracy_closed: float
    source: str
    """Which one it was, as the commit's note says; empty: it does not."""

    @property
    def identity(self) -> object:
        """What looks again in a pass: the source, however sure it is each time.

        Where none is named, sensors of the same accuracies are taken to be one.
        """
        return self.source or (self.accuracy_open, self.accuracy_closed)


CERTAIN = Sensor(1.0, 1.0, "")
"""The sensor of events that are not readings, and of passages."""


class Sensors(NamedTuple):
    """What is known of sensors, as columns."""

    accuracy_open: NDArray[np.float64]
    accuracy_closed: NDArray[np.float64]
    identity: NDArray[np.intp]
    """The same for those that are taken to be one: `Sensor.identity`."""


class Reports:
    """The reports about all doors, in any order."""

    def __init__(self) -> None:
        self._rows = np.empty(0, REPORT)
        self._count = 0
        self._sensors: dict[Sensor, int] = {CERTAIN: 0}
        self._as_columns: Sensors | None = None
        self._index = _Index(np.empty(0, np.uint32))

    def __len__(self) -> int:
        return self._count

    def take(self, batch: EventBatch) -> None:
        """Take in the reports of a batch."""
        for kind in events.STATE_KINDS:
            if kind in batch:
                places = door_changes.chosen_of(
                    batch, kind, setting=door_changes.STATE | door_changes.THERE
                )
                if len(places):
                    self._take_kind(batch, kind, places)
        if events.SightingsThinned in batch:
            self._take_thinned(batch)

    def _take_thinned(self, batch: EventBatch) -> None:
        """Take in thinned sightings: as many as there were, spread over their time.

        They have the number of the first: while that is here, too, they do not count.
        """
        told = batch[events.SightingsThinned]
        of_row, seen_ns = sightings_of_runs(told)
        rows = self._room_for(len(of_row))
        rows["folds_ns"] = seen_ns
        rows["door_id"], rows["kind"] = told["door_id"][of_row], events.SightingsThinned.kind
        rows["number"] = told["first_event"][of_row]
        rows["state"] = door_changes.known_states(told["state"])[of_row]
        of_nobody = np.zeros(len(told), np.intp)
        rows["sensor"] = self._sensors_of(told, of_nobody, [""])[of_row]

    def _take_kind(
        self, batch: EventBatch, kind: type[events.Event], places: NDArray[np.intp]
    ) -> None:
        rows = self._room_for(len(places))
        door_changes.fill(rows, batch, kind, places)
        rows["state"] = door_changes.known_states(rows["state"])
        if "accuracy_open" in events.field_names(kind):
            codes, names = batch.sources(kind)
            rows["sensor"] = self._sensors_of(batch[kind][places], codes[places], names)

    def add(self, other: Reports) -> None:
        """Take in other reports; events that both have would count twice."""
        codes = np.array([self._code(sensor) for sensor in other._sensors], np.uint32)
        rows = self._room_for(len(other))
        rows[:] = other._rows[: len(other)]
        rows["sensor"] = codes[rows["sensor"]]

    def door_ids(self) -> NDArray[np.uint32]:
        """Return which doors there are reports about, ascending."""
        return distinct(self._rows["door_id"][: self._count])

    def about(self, door_id: DoorId) -> Rows:
        """Return the reports about a door, in the order of the fold: by time, then by number."""
        behind = self._rows[self._index.count : self._count]
        if len(behind) > max(_FEW, self._index.count // 4):
            self._index = _Index(self._rows["door_id"][: self._count])
            behind = behind[:0]
        late = np.flatnonzero(behind["door_id"] == door_id) + self._index.count
        places = np.append(self._index.of(door_id), late)
        order = np.lexsort((self._rows["number"][places], self._rows["folds_ns"][places]))
        # Of rows with several fields `take` is ten times as quick as an index.
        return _that_count(self._rows.take(places[order]))

    def newer(self, count: int) -> NDArray[np.uint32]:
        """Return the doors of the reports after the first `count`."""
        return distinct(self._rows["door_id"][count : self._count])

    def latest(self, door_ids: NDArray[np.integer[Any]], until_ns: int, most: int) -> Rows:
        """Return the reports about some doors up to a time, by door, then time, then number.

        Args:
            door_ids: The doors.
            until_ns: That moment included.
            most: Only so many of all their reports: the latest.
        """
        rows = self._rows[: self._count]
        chosen = np.flatnonzero((rows["folds_ns"] <= until_ns) & np.isin(rows["door_id"], door_ids))
        if len(chosen) > most:
            chosen = chosen[np.argsort(rows["folds_ns"][chosen], kind="stable")[-most:]]
        rows = _that_count(rows.take(chosen))
        return rows.take(np.lexsort((rows["number"], rows["folds_ns"], rows["door_id"])))

    def known_sensors(self) -> list[Sensor]:
        """Return the sensors by their places, as `REPORT` has them, each with its name."""
        return list(self._sensors)

    def sensors(self) -> Sensors:
        """Return the sensors by their places, as `REPORT` has them."""
        if self._as_columns is not None and len(self._as_columns.identity) == len(self._sensors):
            return self._as_columns
        known: dict[object, int] = {}
        codes = [known.setdefault(sensor.identity, len(known)) for sensor in self._sensors]
        accuracies = np.array([sensor[:2] for sensor in self._sensors], np.float64)
        columns = (accuracies[:, 0], accuracies[:, 1], np.array(codes, np.intp))
        self._as_columns = Sensors(*columns)
        return self._as_columns

    def dump(self) -> bytes:
        """Return the reports as bytes."""
        out = io.BytesIO()
        np.lib.format.write_array(out, self._rows[: self._count], allow_pickle=False)
        return out.getvalue() + json.dumps(list(self._sensors)).encode()

    @classmethod
    def load(cls, data: bytes) -> Reports:
        """Return the reports in the bytes of `dump`.

        Raises:
            ValueError: They are not from `dump`.
        """
        source = io.BytesIO(data)
        rows = np.lib.format.read_array(source, allow_pickle=False)
        sensors = [Sensor(float(a), float(b), str(name)) for a, b, name in json.load(source)]
        if rows.dtype != REPORT or rows["sensor"].max(initial=0) >= len(sensors):
            raise ValueError("not reports, or reports of sensors that are not told")
        reports = cls()
        reports._rows, reports._count = rows, len(rows)
        reports._sensors = {sensor: code for code, sensor in enumerate(sensors)}
        return reports

    def _room_for(self, count: int) -> Rows:
        """Return that many new rows at the end, to be filled."""
        first, self._count = self._count, self._count + count
        if self._count > len(self._rows):
            grown = np.empty(max(self._count, 2 * len(self._rows), _FEW), REPORT)
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


def _that_count(rows: Rows) -> Rows:
    """Return the reports, without records of thinned sightings that are still in the log."""
    is_told = rows["kind"] == events.SightingsThinned.kind
    if not is_told.any():
        return rows
    is_there = np.isin(rows["number"], rows["number"][~is_told]) & (rows["number"] > 0)
    rows["kind"][is_told] = events.DoorObserved.kind
    counting: Rows = rows[~(is_told & is_there)]
    return counting


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
"""Up to so many reports are searched rather than sorted."""
