"""Which part of a log a view shows: a span of happened time, and some of the doors."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semmap_log.doors import DoorId, DoorMap
from semmap_log.event_batch import EventBatch

if TYPE_CHECKING:
    from semmap_log.door_log import DoorLog, Time

NO_DOOR = 0


@dataclass(frozen=True, slots=True)
class Excerpt:
    """The events of [since, until) about some doors, and those that are about no door."""

    log: DoorLog
    since_ns: int | None = None
    """None: from the log's start."""
    until_ns: int | None = None
    """None: to the log's end."""
    doors: frozenset[DoorId] | None = None
    """None: all doors."""

    @classmethod
    def of(
        cls, log: DoorLog, since: Time, until: Time, doors: Collection[DoorId] | None
    ) -> Excerpt:
        """Return the excerpt between two moments.

        Raises:
            MomentError: A time cannot be read.
        """
        chosen = None if doors is None else frozenset(doors)
        return cls(log, instant_ns(log, since), instant_ns(log, until), chosen)

    def batches(self, progress: Callable[[int, int], None] | None = None) -> Iterator[EventBatch]:
        """Yield the events, numbers ascending, about a MiB of the log at a time."""
        for batch in self.log.batches(self.since_ns, self.until_ns, progress=progress):
            chosen = batch
            if self.doors is not None:
                chosen = batch.select(np.isin(batch.door_ids(), [NO_DOOR, *self.doors]))
            if len(chosen):
                yield chosen

    def part_of(self, batch: EventBatch) -> EventBatch:
        """Return those of a batch's events that belong to it; `until` is not asked for."""
        kept = np.ones(len(batch), np.bool_)
        if self.since_ns is not None:
            kept &= batch.folds_ns >= self.since_ns
        if self.doors is not None:
            kept &= np.isin(batch.door_ids(), [NO_DOOR, *self.doors])
        return batch if kept.all() else batch.select(kept)

    def before(self) -> DoorMap:
        """Return the map just before the first event; empty where the excerpt starts the log."""
        if self.since_ns is None:
            return DoorMap({}, {})
        earlier = self.log.replay(at=max(self.since_ns - 1, 0))
        kept = {
            i: door for i, door in earlier.doors.items() if self.doors is None or i in self.doors
        }
        return DoorMap(kept, earlier.levels, earlier.event)

    def last_ns(self) -> int | None:
        """Return the last nanosecond that counts; None: the log's end."""
        return None if self.until_ns is None else max(self.until_ns - 1, 0)


def instant_ns(log: DoorLog, time: Time) -> int | None:
    """Return the instant (ns, UTC) that a moment means; of `event:12`, that of the event.

    Raises:
        MomentError: The time cannot be read.
    """
    moment = log.moment(time)
    if moment.event is None:
        return moment.ns
    recorded = log.event(moment.event)
    return min(recorded.happened_ns, recorded.recorded_ns)
