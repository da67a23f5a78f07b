"""The door map at a moment: the nearest keyframe, and what came after it.

A keyframe is a cache. One serves a moment if all its events had happened by then, and if it holds
nothing that a later retraction hides; behind it only those chunks are read in which events lie that
had happened by then, too. Without any keyframe the answer is the same, from the log's beginning.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np

from semmap_log.core.batches.retraction import Retractions
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.io.progress import Progress
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.texts import counted
from semmap_log.errors import KeyframeWarning
from semmap_log.log.replay import keyframes
from semmap_log.store.kind_bits import KEYFRAME_BIT
from semmap_log.store.reading.reader import BEGINNING, ChunkPlace, LogReader
from semmap_log.store.reading.segment_reading import page_at
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.reading.window import Window, numbers_of


def state_at(
    reader: LogReader,
    *,
    at_ns: int | None = None,
    limit: int | None = None,
    uses_keyframes: bool = True,
    progress: Progress | None = None,
    with_newer: bool = False,
) -> DoorMapState:
    """Return the door map as of a moment; without bounds: now.

    Args:
        reader: The log.
        at_ns: Only what had happened by then.
        limit: Only events up to that number, and what they retract.
        uses_keyframes: Whether to start at one; else from the beginning, for the same answer.
        progress: Told how far the reading is.
        with_newer: Even where an event of an unknown kind may have changed it.

    Raises:
        NewerLogError: There is such an event.
        CorruptLogError: What was read is not what was written.
        HorizonError: What it would take was older than the log is kept.
    """
    state, start = DoorMapState(), BEGINNING
    if limit is not None and limit < 0:
        return state
    if at_ns is not None and at_ns < reader.horizon_ns:
        return _pinned(reader, at_ns, limit)
    retractions = reader.retractions(limit=limit, with_newer=with_newer)
    if uses_keyframes:
        state, start = _Search(reader, at_ns, limit, retractions).nearest()
    window = Window.up_to(at_ns=at_ns, event=limit)
    reader.check_reaches_horizon(start)
    for batch in reader.batches(window, start=start, progress=progress, with_newer=True):
        state.note_used_ids(batch)
        state.apply(retractions.visible(batch))
    return state


def _pinned(reader: LogReader, at_ns: int, limit: int | None) -> DoorMapState:
    """Return the state of a moment before the horizon.

    Raises:
        HorizonError: It was not pinned, or not all that is known today is to count.
    """
    from semmap_log.log.replay.pins import pinned_state

    state = pinned_state(reader, at_ns) if limit is None else None
    if state is None:
        raise reader.behind_horizon()
    return state


@dataclass(frozen=True, slots=True)
class _Search:
    """For the last keyframe that serves a moment."""

    reader: LogReader
    at_ns: int | None
    limit: int | None
    retractions: Retractions

    def nearest(self) -> tuple[DoorMapState, ChunkPlace]:
        """Return its state and where the events behind it begin; the empty state if none serves."""
        unused: list[str] = []
        found = self._nearest(unused)
        if unused:
            others = f"; nor {counted(len(unused) - 1, 'other')}" if len(unused) > 1 else ""
            warnings.warn(KeyframeWarning(unused[0] + others), stacklevel=3)
        return found

    def _nearest(self, unused: list[str]) -> tuple[DoorMapState, ChunkPlace]:
        behind: int | None = None
        for place, chunk, event in self._candidates():
            if behind is not None and event >= behind:
                continue  # it rests on the same retracted event
            state = keyframe_at(self.reader.segments[place], chunk, unused)
            if state is None or self._knows_of_later(state):
                continue
            behind = state.first_among(self.retractions.after(event).ranges)
            if behind is None:
                return state, ChunkPlace(place, chunk + 1)
        return DoorMapState(), BEGINNING

    def _knows_of_later(self, state: DoorMapState) -> bool:
        """Tell whether a state counts events from after the moment, which were taken out since.

        What is left of a chunk then happened before the moment.
        """
        return self.at_ns is not None and state.latest_happened_ns > self.at_ns

    def _candidates(self) -> Iterator[tuple[int, int, int]]:
        """Yield segment, chunk and event number of the keyframes of events that all count.

        The last comes first.
        """
        for place in reversed(range(self._last_segment() + 1)):
            segment = self.reader.segments[place]
            chunks = np.flatnonzero(segment.chunks.rows["kinds"] == KEYFRAME_BIT)
            firsts, _ = numbers_of(segment)
            events = firsts[chunks] - 1  # behind the last event before it
            serves = np.ones(len(chunks), np.bool_)
            if self.limit is not None:
                serves &= events <= self.limit
            if self.at_ns is not None:
                serves &= chunks <= self._chunks_by(place)
            chosen = zip(chunks[serves].tolist(), events[serves].tolist(), strict=True)
            for chunk, event in reversed(list(chosen)):
                yield place, chunk, event

    def _last_segment(self) -> int:
        """Return the last segment before which all events count."""
        last = len(self.reader.segments) - 1
        if self.limit is not None:
            last = self.reader.segment_of(self.limit + 1) or 0  # its head may be right behind
        if self.at_ns is not None:
            last = min(last, self.reader.segments_by(self.at_ns))
        return last

    def _chunks_by(self, place: int) -> int:
        """Return how many of a segment's first chunks had happened by the moment."""
        assert self.at_ns is not None
        latest = np.maximum.accumulate(self.reader.segments[place].spans["greatest"])
        return int(np.searchsorted(latest, self.at_ns, "right"))


def keyframe_at(
    segment: Segment, chunk: int, unused: list[str] | None = None
) -> DoorMapState | None:
    """Return the state that a chunk with a keyframe holds; None: it cannot be used.

    Args:
        segment: The segment.
        chunk: The chunk's place in it.
        unused: Is told which one it is, and why.

    Raises:
        CorruptLogError: The chunk is not what was written.
    """
    (data,) = page_at(segment, chunk).keyframes()
    state = keyframes.decode(data)
    if state is None and unused is not None:
        offset = int(segment.chunks.rows["offset"][chunk])
        why = keyframes.why_unused(data)
        unused.append(f"{segment.path}: the keyframe at byte {offset} is not used: {why}")
    return state
