"""Which events are hidden: Retracted events, folded into ranges of event numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.events import HistoryTrimmed, MomentPinned, Retracted

_ABOUT_THE_LOG = (HistoryTrimmed.kind, MomentPinned.kind)
"""Kinds that tell of the log, and not of the building."""


class Retractions:
    """Ranges of event numbers that were taken back; a retraction itself is never hidden.

    Nor is an event that tells of the log by a range around it: only by its own number.
    """

    def __init__(self) -> None:
        self.ranges: list[tuple[int, int]] = []
        """(first, last) event number of each, inclusive."""
        self.numbers: list[int] = []
        """Of each, the number of the Retracted event."""

    def apply(self, batch: EventBatch) -> None:
        """Fold a batch in."""
        if Retracted in batch:
            rows = batch[Retracted]
            self.ranges += zip(
                rows["first_event"].tolist(), rows["last_event"].tolist(), strict=True
            )
            self.numbers += batch.number[batch.where(Retracted)].tolist()

    def up_to(self, event: int) -> Retractions:
        """Return those that events up to that number made."""
        return self._those([number <= event for number in self.numbers])

    def after(self, event: int) -> Retractions:
        """Return those that events behind that number made."""
        return self._those([number > event for number in self.numbers])

    def __bool__(self) -> bool:
        return bool(self.ranges)

    def hidden(self, batch: EventBatch) -> NDArray[np.bool_]:
        """Return, for each event of a batch, whether it is hidden."""
        hidden = in_ranges(batch.number, self.ranges)
        hidden &= batch.kind != Retracted.kind
        about_the_log = hidden & np.isin(batch.kind, _ABOUT_THE_LOG)
        if about_the_log.any():
            alone = [first for first, last in self.ranges if first == last]
            hidden &= ~about_the_log | np.isin(batch.number, alone)
        return hidden

    def first_hiding(self, event: int) -> int | None:
        """Return the number of the first retraction of an event; None: there is none."""
        known = zip(self.ranges, self.numbers, strict=True)
        return min((by for (first, last), by in known if first <= event <= last), default=None)

    def visible(self, batch: EventBatch) -> EventBatch:
        """Return the events of a batch that are not hidden."""
        return batch.select(~self.hidden(batch)) if self.ranges else batch

    def _those(self, chosen: Sequence[bool]) -> Retractions:
        those = Retractions()
        those.ranges = [r for r, keep in zip(self.ranges, chosen, strict=True) if keep]
        those.numbers = [n for n, keep in zip(self.numbers, chosen, strict=True) if keep]
        return those


def in_ranges(numbers: NDArray[np.int64], ranges: Sequence[tuple[int, int]]) -> NDArray[np.bool_]:
    """Return, for each number, whether it lies in one of the ranges, ends included."""
    if not ranges:
        return np.zeros(len(numbers), np.bool_)
    firsts, lasts = np.array(sorted(ranges), np.int64).T
    reached = np.maximum.accumulate(lasts)
    before = np.searchsorted(firsts, numbers, "right") - 1
    inside: NDArray[np.bool_] = (before >= 0) & (numbers <= reached[before])
    return inside
