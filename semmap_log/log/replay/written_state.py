"""Keeps the door map after the last commit current without reading: a writer's keyframes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model.events import Retracted
from semmap_log.log.replay import keyframes
from semmap_log.log.replay.state import state_at
from semmap_log.store.byte_layout import (
    CHUNK_BYTES,
    KEYFRAME_EVERY_BYTES,
    KEYFRAME_RARITY,
)
from semmap_log.store.chunks import BuiltChunk
from semmap_log.store.folder import LogFolder
from semmap_log.store.pages import Page
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.record_scan import ScannedRecords
from semmap_log.store.records import MESSAGE
from semmap_log.store.writing.keyframe_source import Flush, KeyframeMessage


class WrittenState:
    """A lazily folded state: waiting records are folded in on access, or when they are many.

    A `KeyframeSource`.
    """

    def __init__(self, folder: LogFolder, flush: Flush, reader: LogReader | None = None) -> None:
        """Begin with the state of the log, as for `NewKeyframeSource`.

        Raises:
            NewerLogError: An event of an unknown kind may have changed it.
            CorruptLogError: What was read is not what was written.
        """
        self._folder = folder
        self._flush = flush
        self._reader = reader
        """The log as it was when it was read last; None: it was not."""
        self._state = DoorMapState() if reader is None else state_at(reader)
        self._unfolded: list[bytes] = []
        self._offsets: list[NDArray[np.int64] | None] = []
        """Where the records begin in each of those, as far as it is known."""
        self._unfolded_size = 0
        self._first_event = self._state.event + 1
        """A number below those that wait, and less than 2^32 away from them."""
        self._needs_reading = False
        self._since_keyframe = 0
        """Bytes of records since the last keyframe."""
        self._keyframe_size = 0
        """Of the last keyframe's record."""

    def add(self, chunk: BuiltChunk) -> None:
        """Remember a chunk that was written."""
        self._unfolded.append(chunk.records)
        self._offsets.append(chunk.offsets)
        self._unfolded_size += len(chunk.records)
        self._since_keyframe += len(chunk.records)
        if self._unfolded_size >= CHUNK_BYTES:
            self._fold()

    def keyframe(self) -> KeyframeMessage:
        """Return the keyframe that is written now."""
        state = self.get()
        data = keyframes.encode(state)
        self._since_keyframe, self._keyframe_size = 0, MESSAGE.size + len(data)
        return KeyframeMessage(state.event, data)

    def wants_keyframe(self, *, is_commit_begun: bool) -> bool:
        """Return whether a keyframe should stand before what is written next.

        In the middle of a commit none can be made if a retraction came before it.
        """
        wanted = max(KEYFRAME_EVERY_BYTES, KEYFRAME_RARITY * self._keyframe_size)
        if self._since_keyframe < wanted:
            return False
        self._fold()
        return not (is_commit_begun and self._needs_reading)

    def get(self) -> DoorMapState:
        """Return the state after the last commit."""
        self._fold()
        if self._needs_reading:
            self._flush()
            known = self._reader  # of which nothing is read again
            self._reader = LogReader(self._folder) if known is None else known.refreshed()
            self._state, self._needs_reading = state_at(self._reader), False
        return self._state

    def _fold(self) -> None:
        """Fold what was written; what a retraction hides can only be left out by a new fold."""
        if not self._unfolded:
            return
        page = Page(
            b"".join(self._unfolded),
            max(0, self._first_event - 1),  # the number of a Commit is that of the event before it
            self._folder.path,
            scanned=_joined(self._unfolded, self._offsets),
        )
        batch = page.events()
        needs_reading = self._needs_reading or Retracted in batch
        self._needs_reading = True  # if it is interrupted: half a fold must not become a keyframe
        self._unfolded, self._offsets, self._unfolded_size = [], [], 0
        self._state.apply(batch)
        last = page.numbers(np.array([len(page.offsets) - 1]))
        self._state.event = max(self._state.event, int(last[0]))  # some may have been taken out
        self._first_event = self._state.event + 1
        self._needs_reading = needs_reading


def _joined(
    records: Sequence[bytes], offsets: Sequence[NDArray[np.int64] | None]
) -> ScannedRecords | None:
    """Return where each record begins once those of all chunks are joined; None: not known."""
    found, start = [], 0
    for its_records, its_offsets in zip(records, offsets, strict=True):
        if its_offsets is None:
            return None
        found.append(its_offsets + start)
        start += len(its_records)
    return ScannedRecords(np.concatenate(found))
