"""Which part of a log a view shows: a span of happened time, and some of the doors."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.batches.retraction import Retractions, in_ranges
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.doors import DoorId, DoorMap
from semmap_log.core.model.moments import refuse_reversed
from semmap_log.log.door_log.clock_warnings import warn_of_clock
from semmap_log.log.replay.replay import Scope
from semmap_log.store.reading.window import Window

if TYPE_CHECKING:
    from semmap_log.log.door_log.door_log import DoorLog, Time


@dataclass(frozen=True, slots=True)
class Excerpt:
    """What a view shows of a log, along each timeline from `since` on and before `until`.

    Along `happened` these are the events that happened then, with all that is known today; along
    `recorded` and `event` those recorded then, also what was taken back later. Most are both.
    """

    log: DoorLog
    since_ns: int | None = None
    """None: from the log's start; `of` begins at the horizon of a log that has one."""
    until_ns: int | None = None
    """None: to the log's end."""
    doors: frozenset[DoorId] | None = None
    """Events about these doors, and about none; None: all doors."""

    @classmethod
    def of(
        cls, log: DoorLog, since: Time, until: Time, doors: Collection[DoorId] | None
    ) -> Excerpt:
        """Return the excerpt between two moments.

        Raises:
            MomentError: A time cannot be read, or `since` comes after `until`.
            HorizonError: It begins, or ends, before the log's horizon.
        """
        chosen = None if doors is None else frozenset(doors)
        since_ns, until_ns = log.instant(since), log.instant(until)
        refuse_reversed(since_ns, until_ns)
        warn_of_clock(log, since_ns)
        return cls(log, log.shown_from_ns(since_ns, until_ns), until_ns, chosen)

    def read(self, progress: Callable[[int, int], None] | None = None) -> Iterator[EventBatch]:
        """Yield the events of any of the timelines, about any door, numbers ascending.

        About a MiB of the log at a time, retracted ones included.
        """
        # An event never counts as later than it was recorded: so both ranges lie in this one.
        window = Window(recorded_from_ns=self.since_ns, happened_before_ns=self.until_ns)
        for batch in self.log.batches_in(window, progress=progress):
            if len(batch):
                yield batch

    def chosen(self, batch: EventBatch) -> EventBatch:
        """Return those that are about the doors, or about none."""
        if self.doors is None:
            return batch
        return batch.select(batch.of_doors(self.doors) | ~batch.about_doors())

    def batches(self, progress: Callable[[int, int], None] | None = None) -> Iterator[EventBatch]:
        """Yield the same as `read`, about the doors alone."""
        for batch in self.read(progress):
            chosen = self.chosen(batch)
            if len(chosen):
                yield chosen

    def happened(self, progress: Callable[[int, int], None] | None = None) -> Iterator[EventBatch]:
        """Yield those of `batches` that stand on the timeline `happened`."""
        for batch in self.batches(progress):
            standing = batch.select(self.has_happened(batch.number, batch.folds_ns))
            if len(standing):
                yield standing

    @property
    def retractions(self) -> Retractions:
        """What was taken back, as known today."""
        return self.log.retractions()

    def is_retracted(self, numbers: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Tell for each event whether it was taken back."""
        known = self.retractions
        return in_ranges(numbers, known.ranges) & ~np.isin(numbers, known.numbers)

    def has_happened(
        self, numbers: NDArray[np.int64], folds_ns: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        """Tell which events stand on the timeline `happened`."""
        happened = ~self.is_retracted(numbers)
        if self.since_ns is not None:
            happened &= folds_ns >= self.since_ns
        return happened

    def was_recorded(
        self, numbers: NDArray[np.int64], recorded_ns: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        """Tell which events stand on the timelines `recorded` and `event`."""
        known = self.retractions
        ahead = [(max(first, number), last) for number, (first, last)
                 in zip(known.numbers, known.ranges, strict=True) if last > number]  # fmt: skip
        recorded = ~(in_ranges(numbers, ahead) & ~np.isin(numbers, known.numbers))
        if self.until_ns is not None:
            recorded &= recorded_ns < self.until_ns
        return recorded

    def part_of(self, batch: EventBatch) -> EventBatch:
        """Return those of a batch's events that belong to it; `until` is not asked for."""
        recorded = batch
        if self.since_ns is not None:
            recorded = batch.select(batch.recorded_ns >= self.since_ns)
        return self.chosen(recorded)

    def before(self) -> DoorMap:
        """Return the map just before the first event; empty where the excerpt starts the log."""
        if self.since_ns is None:
            return DoorMap({}, {})
        earlier = self.log.replay(at=max(self.since_ns - 1, 0))
        kept = {
            i: door for i, door in earlier.doors.items() if self.doors is None or i in self.doors
        }
        return DoorMap(kept, earlier.levels, earlier.event)

    def known_before(self) -> DoorMapState:
        """Return the fold of what was known just before the first event was recorded."""
        if self.since_ns is None:
            return DoorMapState()
        return self.log.state_in(Scope(known_at_ns=max(self.since_ns - 1, 0)))

    def number_before(self) -> int:
        """Return the number of the last event that was known then; -1: none."""
        if self.since_ns is None:
            return -1
        known = self.log.limit_of(Scope(known_at_ns=max(self.since_ns - 1, 0)))
        assert known is not None, "knowledge has a bound"
        return known

    def last_ns(self) -> int | None:
        """Return the last nanosecond that counts; None: the log's end."""
        return None if self.until_ns is None else max(self.until_ns - 1, 0)
