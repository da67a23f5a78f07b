"""The places of a log's doors at the moments of scans: as they were then, by what is known now."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import replace
from operator import itemgetter

import numpy as np

from semmap_log.analysis.scans.placed_scan import DoorPlaces
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_changes import STATE, STATE_CHANGE, known_states, parts_of
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import (
    STATE_KINDS,
    DoorAdded,
    DoorAnnotated,
    DoorRemoved,
    DoorUpdated,
    Event,
)
from semmap_log.core.model.meaning import PLACING, sets_part
from semmap_log.core.model.moments import HOUR_NS
from semmap_log.interop.topics.lasers.door_places import changes_places, places_of
from semmap_log.log.door_log.door_log import DoorLog
from semmap_log.log.replay.replay import Scope

AHEAD_NS = 4 * HOUR_NS
"""What was said so long after a moment is read with it: visits come in the order of time."""


class DoorsThen:
    """The places of a log's doors over time, with events that are to come into it."""

    def __init__(self, log: DoorLog, others: Sequence[Event] = ()) -> None:
        self._log = log
        of_state = [event for event in others if isinstance(event, STATE_KINDS)]
        self._states = _States(log, EventBatch.from_events(of_state))
        self._others = [event for event in others if changes_places(event)]
        self._moments = sorted({*_changes(log), *(e.happened_ns or 0 for e in self._others)})
        self._current: tuple[int, DoorPlaces] | None = None

    def at(self, when_ns: int) -> DoorPlaces:
        """Return the places of a moment; the same object until one of them changes."""
        number = bisect_right(self._moments, when_ns)
        if self._current is None or self._current[0] != number:
            self._current = (number, self._places(when_ns))
        return self._current[1]

    def state(self, door_id: int, since_ns: int, when_ns: int) -> DoorState | None:
        """Return how a door is by then, by what was said after `since_ns`; None: nothing was."""
        return self._states.last(door_id, since_ns, when_ns)

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


class _States:
    """What was said of the states of doors: some hours of it are in memory at a time."""

    def __init__(self, log: DoorLog, others: EventBatch) -> None:
        self._log, self._others = log, others
        self._from_ns = self._until_ns = 0
        self._of_door: dict[int, list[tuple[int, int, DoorState]]] = {}
        """Door -> when, number, state; ascending."""

    def last(self, door_id: int, since_ns: int, when_ns: int) -> DoorState | None:
        """Return the last one from after `since_ns` to `when_ns`; None: there is none."""
        if not self._from_ns <= since_ns <= when_ns < self._until_ns:
            self._read(since_ns, when_ns + AHEAD_NS)
        said = self._of_door.get(door_id, [])
        place = bisect_right(said, when_ns, key=itemgetter(0))
        return said[place - 1][2] if place and said[place - 1][0] > since_ns else None

    def _read(self, from_ns: int, until_ns: int) -> None:
        self._from_ns, self._until_ns = from_ns, until_ns
        self._of_door.clear()
        behind = self._log.last_event() + 1
        for batch in self._log.batches(since=from_ns, until=until_ns, kinds=STATE_KINDS):
            self._take(batch, 0)
        self._take(self._others, behind)
        for said in self._of_door.values():
            said.sort()

    def _take(self, batch: EventBatch, first: int) -> None:
        for rows in parts_of(batch, STATE_CHANGE, setting=STATE):
            rows["state"] = known_states(rows["state"])
            for door_id, at_ns, number, _, state in rows.tolist():
                said = (at_ns, first + number, DoorState(state))
                self._of_door.setdefault(door_id, []).append(said)
