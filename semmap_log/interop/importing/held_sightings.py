"""Sightings that a log holds already, by another file: exports that overlap do not count twice.

Two are the same that tell of the same door, at the same nanosecond, the same state with the same
accuracy. Files of two sensors are kept apart by their sources: with one, only what the log has of
that source is compared.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.events import DoorObserved, DoorUpdated, Event
from semmap_log.core.model.meaning import Changed
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.store.kind_bits import bits_of_kinds
from semmap_log.store.reading.window import Window

_KINDS = (DoorObserved, DoorUpdated)
_ROW = np.dtype([("ns", "<i8"), ("door", "<u4"), ("state", "<u4"), ("open", "<f8"),
                 ("closed", "<f8")])  # fmt: skip
_NOT_SEEN = -1.0
"""In the place of an accuracy: the state was set, not seen."""
AT_ONCE = 1000
"""So many single events are compared together."""


class HeldSightings:
    """Tells which sightings, and updates of a state alone, a log has."""

    def __init__(self, log: DoorLog, *, source: str = "", before_event: int | None = None) -> None:
        """Look at nothing yet.

        Args:
            log: The log, as it stands.
            source: Compare with those of this source only; empty: with all.
            before_event: Only with events of lower numbers; None: with all.
        """
        self._log = log
        self._source = source
        self._before_event = before_event
        self._span = log.happened_span()
        self._retractions = log.retractions()
        self.count = 0
        """So many were found."""

    def among(self, batch: EventBatch) -> NDArray[np.bool_]:
        """Return which events of a batch the log holds."""
        held = np.zeros(len(batch), np.bool_)
        where, rows = _rows(batch)
        if self._span is None or not len(rows):
            return held
        first, last = int(rows["ns"].min()), int(rows["ns"].max())
        if last < self._span[0] or first > self._span[1]:
            return held
        known = {row for there in self._there(first, last, rows) for row in _texts(there)}
        if known:
            held[where] = [row in known for row in _texts(rows)]
        self.count += int(held.sum())
        return held

    def left(self, events: Iterable[Event]) -> Iterator[Event]:
        """Yield the events that the log does not hold, in their order."""
        waiting: list[Event] = []
        for event in events:
            waiting.append(event)
            if len(waiting) >= AT_ONCE:
                yield from self._left_of(waiting)
                waiting.clear()
        yield from self._left_of(waiting)

    def _left_of(self, events: list[Event]) -> Iterator[Event]:
        places = [i for i, event in enumerate(events) if isinstance(event, _KINDS)]
        held = self.among(EventBatch.from_events(events[i] for i in places))
        gone = {place for place, is_held in zip(places, held.tolist(), strict=True) if is_held}
        return (event for i, event in enumerate(events) if i not in gone)

    def _there(
        self, first_ns: int, last_ns: int, rows: NDArray[np.void]
    ) -> Iterator[NDArray[np.void]]:
        """Yield what the log has of these times."""
        times, kinds = np.unique(rows["ns"]), bits_of_kinds(_KINDS)
        window = Window(
            happened_from_ns=first_ns, happened_before_ns=last_ns + 1,
            before_event=self._before_event, kinds=kinds, only_kept=True,
        )  # fmt: skip
        for every in self._log.batches_in(window):
            batch = self._retractions.visible(every)
            where, there = _rows(batch)
            chosen = np.isin(there["ns"], times)
            if self._source and chosen.any():
                chosen &= _of_source(batch, self._source)[where]
            yield there[chosen]


def _rows(batch: EventBatch) -> tuple[NDArray[np.intp], NDArray[np.void]]:
    """Return the places of the sightings and updates of a state alone, and what they say."""
    places, found = [np.empty(0, np.intp)], [np.zeros(0, _ROW)]
    for kind in _KINDS:
        where = batch.where(kind)
        if not len(where):
            continue
        told = batch[kind]
        rows = np.zeros(len(where), _ROW)
        rows["ns"] = batch.happened_ns[where]
        rows["door"], rows["state"] = told["door_id"], told["state"]
        good = rows["ns"] >= 0
        if kind is DoorObserved:
            rows["open"], rows["closed"] = told["accuracy_open"], told["accuracy_closed"]
        else:
            rows["open"] = rows["closed"] = _NOT_SEEN
            good &= told["changed"] == Changed.STATE
        places.append(where[good])
        found.append(rows[good])
    return np.concatenate(places), np.concatenate(found)


def _texts(rows: NDArray[np.void]) -> list[bytes]:
    """Return rows as bytes, which can be looked up."""
    data, size = rows.tobytes(), rows.dtype.itemsize
    return [data[at : at + size] for at in range(0, len(data), size)]


def _of_source(batch: EventBatch, source: str) -> NDArray[np.bool_]:
    """Return which sightings and updates of a batch are from a source."""
    found = np.zeros(len(batch), np.bool_)
    for kind in _KINDS:
        which, names = batch.sources(kind)
        named = np.array([name == source for name in names], np.bool_)
        found[batch.where(kind)] = named[which]
    return found
