"""The places of a log's doors at the moments of scans: as they were then, by what is known now."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from semmap_log.domain.events import DoorAdded, DoorAnnotated, DoorRemoved, DoorUpdated, Event
from semmap_log.domain.meaning import PLACING, sets_part
from semmap_log.door_log.door_log import DoorLog
from semmap_log.replay.replay import Scope
from semmap_log.ros_mapping.lasers.door_places import changes_places, places_of
from semmap_log.scans.placed_scan import DoorPlaces


class DoorsThen:
    """The places of a log's doors over time, with events that are to come into it."""

    def __init__(self, log: DoorLog, others: Sequence[Event] = ()) -> None:
        self._log = log
        self._others = [event for event in others if changes_places(event)]
        self._moments = sorted({*_changes(log), *(e.happened_ns or 0 for e in self._others)})
        self._current: tuple[int, DoorPlaces] | None = None

    def at(self, when_ns: int) -> DoorPlaces:
        """Return the places of a moment; the same object until one of them changes."""
        number = bisect_right(self._moments, when_ns)
        if self._current is None or self._current[0] != number:
            self._current = (number, self._places(when_ns))
        return self._current[1]

    def _places(self, when_ns: int) -> DoorPlaces:
        state = self._log.state_in(Scope(at_ns=when_ns))
        for number, event in enumerate(self._others, start=self._log.last_event() + 1):
            if (event.happened_ns or 0) <= when_ns:
                state.apply_one(replace(event, happened_ns=event.happened_ns or 0), number)
        return places_of(state.door_map().doors.values())


def _changes(log: DoorLog) -> Iterator[int]:
    """Yield when a door came, went, or may have got another place."""
    kinds = [DoorAdded, DoorRemoved, DoorUpdated, DoorAnnotated]
    for batch in log.batches(kinds=kinds):
        when = batch.folds_ns
        moves = np.ones(len(batch), np.bool_)
        if DoorUpdated in batch:
            parts = batch[DoorUpdated]["changed"]
            moves[batch.where(DoorUpdated)] = sets_part(parts, int(PLACING))
        yield from np.unique(when[moves]).tolist()
