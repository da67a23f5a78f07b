"""Which events a question is about, and so which segments and chunks it need not read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.store.pages import EVENT_BITS, bits_of_counts, bits_of_kind_numbers
from semmap_log.store.reading.segment_scan import Segment, numbers_of


@dataclass(frozen=True, slots=True)
class Window:
    """Half-open ranges of time and number, and kinds; None: no bound.

    Times are nanoseconds UTC. Happened is the time by which events are ordered: never after
    recording.
    """

    happened_from_ns: int | None = None
    happened_before_ns: int | None = None
    recorded_from_ns: int | None = None
    recorded_before_ns: int | None = None
    first_event: int | None = None
    before_event: int | None = None
    kinds: int = EVENT_BITS
    """As bits: `pages`."""
    only_kept: bool = False
    """Of what was before the log's horizon, what is kept is enough, wherever the window begins."""
    is_of_numbers: bool = False
    """It is about events of these numbers, of which what is kept is enough, without a warning."""

    @classmethod
    def up_to(cls, *, at_ns: int | None, event: int | None) -> Window:
        """Return what had happened by a moment, and has a number up to that; None: no bound."""
        return cls(
            happened_before_ns=None if at_ns is None else at_ns + 1,
            before_event=None if event is None else event + 1,
        )

    def may_reach(self, segment: Segment, next_event: int | None) -> bool:
        """Return whether events of a segment may lie in it, by its head and its summary.

        Args:
            segment: The segment.
            next_event: Number of the first event after it; None: not known.
        """
        return (
            self._meets_numbers(segment.header.first_event, next_event)
            and self._meets_kinds(segment)
            and (not self.has_recorded_bound or _meets(segment.recorded, *self._recorded))
            and (not self.has_happened_bound or _meets(segment.span, *self._happened))
        )

    def chunks(self, segment: Segment) -> NDArray[np.intp]:
        """Return the places of a segment's chunks in which such events may lie."""
        rows = segment.chunks.rows
        inside = (rows["kinds"] & np.uint32(self.kinds)) != 0
        if self.has_recorded_bound:
            inside &= _meet(rows["start_ns"], rows["end_ns"], *self._recorded)
        if self.has_happened_bound:
            spans = segment.spans
            inside &= _meet(spans["least"], spans["greatest"], *self._happened)
        if self.first_event is not None or self.before_event is not None:
            firsts, ends = numbers_of(segment)
            inside &= _meet(firsts, ends - 1, self.first_event, self.before_event)
        return np.flatnonzero(inside)

    def choose(self, batch: EventBatch) -> EventBatch:
        """Return those events of a batch that lie in it."""
        inside = _is_within(batch.number, self.first_event, self.before_event)
        if self.has_recorded_bound:
            inside &= _is_within(batch.recorded_ns, *self._recorded)
        if self.has_happened_bound:
            inside &= _is_within(batch.folds_ns, *self._happened)
        if self.kinds != EVENT_BITS:
            inside &= bits_of_kind_numbers(batch.kind) & np.uint32(self.kinds) != 0
        return batch.select(inside)

    @property
    def has_beginning(self) -> bool:
        """Whether it says from when on, or from which event."""
        return (self.first_event, self.recorded_from_ns, self.happened_from_ns) != (None,) * 3

    @property
    def has_happened_bound(self) -> bool:
        """Whether it asks for when events happened."""
        return self.happened_from_ns is not None or self.happened_before_ns is not None

    @property
    def has_recorded_bound(self) -> bool:
        """Whether it asks for when events were recorded."""
        return self.recorded_from_ns is not None or self.recorded_before_ns is not None

    @property
    def _happened(self) -> tuple[int | None, int | None]:
        return self.happened_from_ns, self.happened_before_ns

    @property
    def _recorded(self) -> tuple[int | None, int | None]:
        return self.recorded_from_ns, self.recorded_before_ns

    def _meets_numbers(self, first: int, next_event: int | None) -> bool:
        is_before = self.before_event is None or first < self.before_event
        return is_before and (next_event is None or next_event > (self.first_event or 0))

    def _meets_kinds(self, segment: Segment) -> bool:
        counts = segment.counts
        return counts is None or bool(self.kinds & bits_of_counts(counts))


EVERYTHING = Window()


def _meets(span: tuple[int, int], first: int | None, before: int | None) -> bool:
    least, greatest = span
    return (first is None or greatest >= first) and (before is None or 0 <= least < before)


def _meet(
    least: NDArray[np.int64], greatest: NDArray[np.int64], first: int | None, before: int | None
) -> NDArray[np.bool_]:
    inside = np.ones(len(least), np.bool_)
    if first is not None:
        inside &= greatest >= first
    if before is not None:
        inside &= least < before
    return inside


def _is_within(
    values: NDArray[np.int64], first: int | None, before: int | None
) -> NDArray[np.bool_]:
    inside = np.ones(len(values), np.bool_)
    if first is not None:
        inside &= values >= first
    if before is not None:
        inside &= values < before
    return inside
