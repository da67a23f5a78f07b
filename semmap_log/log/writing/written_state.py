"""The door map after the last commit, as a writer needs it: kept current without reading."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from semmap_log.events import Retracted
from semmap_log.log.chunks import BuiltChunk
from semmap_log.log.form import CHUNK_BYTES
from semmap_log.log.pages import Page
from semmap_log.log.reading.reader import LogReader
from semmap_log.projections.door_map import DoorMapState
from semmap_log.projections.retraction import Retractions


class WrittenState:
    """A state with records that wait to be folded in: when somebody asks, or when they are many."""

    def __init__(self, folder: Path, state: DoorMapState, flush: Callable[[], None]) -> None:
        self._folder = folder
        self._state = state
        self._flush = flush
        """Hands the kernel what the writer holds back, before the log is read."""
        self._unfolded: list[bytes] = []
        self._offsets: list[NDArray[np.int64] | None] = []
        """Where the records begin in each of those, as far as it is known."""
        self._unfolded_size = 0
        self._first_event = state.event + 1
        """A number below those that wait, and less than 2^32 away from them."""
        self._needs_reading = False

    def add(self, chunk: BuiltChunk) -> None:
        """Remember a chunk that was written."""
        self._unfolded.append(chunk.records)
        self._offsets.append(chunk.offsets)
        self._unfolded_size += len(chunk.records)
        if self._unfolded_size >= CHUNK_BYTES:
            self._fold()

    def get(self) -> DoorMapState:
        """Return the state after the last commit."""
        self._fold()
        if self._needs_reading:
            self._flush()
            self._state, self._needs_reading = state_at_end(LogReader(self._folder)), False
        return self._state

    def _fold(self) -> None:
        """Fold what was written; what a retraction hides can only be left out by a new fold."""
        if not self._unfolded:
            return
        page = Page(
            b"".join(self._unfolded),
            self._first_event,
            self._folder,
            known_offsets=_joined(self._unfolded, self._offsets),
        )
        batch = page.events()
        self._unfolded, self._offsets, self._unfolded_size = [], [], 0
        self._state.apply(batch)
        self._first_event = self._state.event + 1
        self._needs_reading |= Retracted in batch


def _joined(
    records: Sequence[bytes], offsets: Sequence[NDArray[np.int64] | None]
) -> NDArray[np.int64] | None:
    """Return where each record begins once those of all chunks are joined; None: not known."""
    found, start = [], 0
    for its_records, its_offsets in zip(records, offsets, strict=True):
        if its_offsets is None:
            return None
        found.append(its_offsets + start)
        start += len(its_records)
    return np.concatenate(found)


def state_at_end(reader: LogReader) -> DoorMapState:
    """Return the state at a log's end: from its last keyframe, unless a retraction touches it."""
    last = len(reader.segments) - 1
    state = reader.keyframe(reader.segments[last])
    retractions = Retractions()
    for batch in reader.batches(first_segment=last):
        retractions.apply(batch)
    if state is None or (retractions and retractions.first_event <= state.event):
        last, state, retractions = 0, DoorMapState(), reader.retractions()
    for batch in reader.batches(first_segment=last):
        state.note_used_ids(batch)
        state.apply(retractions.visible(batch))
    return state
