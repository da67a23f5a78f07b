"""Commits of events that are all of one fixed-size kind, without a note: most of a patrol's.

The bytes are those of `CommitBuilder`, made in a few calls, since all but the values is known in
advance: a durable append takes only as long as the disk does if little else is done for it. Single
events are not packed with numpy: a loop is faster for them, because after a sync the processor's
cache has lost numpy's code, and reloading it takes longer than packing a hundred events.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import lru_cache
from hashlib import sha256
from typing import Any

import numpy as np
from mcap.opcode import Opcode

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.batches.taken_columns import TakenColumns
from semmap_log.core.io.checksum import crc32
from semmap_log.core.messages import (
    CDR_HEADER,
    OBJECT_KINDS,
    field_getter,
    field_getters,
    fixed_layout,
)
from semmap_log.core.model.commits import Commit, Note
from semmap_log.core.model.events import Event
from semmap_log.store import records as mcap
from semmap_log.store.batch_records import (
    Start,
    happened_times,
    is_columns,
    packed_rows,
    span_of,
)
from semmap_log.store.chunks import BuiltChunk, ChunkFacts, assemble_chunk
from semmap_log.store.commit_records import Stamp, closing_record
from semmap_log.store.form import COMMIT_CHANNEL, COMPRESS_FROM_BYTES

FEW = 8
"""Up to so many events are packed one by one; of more, each field is taken out of all of them."""
MOST = 1000
_LOW_32_BITS = 0xFFFF_FFFF
_MESSAGE = int(Opcode.MESSAGE)
_SAME_BYTES = struct.calcsize("<BQH")
_HEAD = struct.Struct(f"<{_SAME_BYTES}sIQQ")
"""Of a Message record: what is the same in all of a kind, sequence, log time, publish time."""
_ENTRY = struct.Struct("<QQ")
"""Of a MessageIndex: log time and offset in the chunk's records."""


def uniform_commit(
    stamp: Stamp, note: Note, events: Sequence[Event | EventBatch]
) -> tuple[BuiltChunk, Commit] | None:
    """Return the one chunk of a commit, and the commit; None if it wants `CommitBuilder`.

    Args:
        stamp: What it takes from outside.
        note: Its note.
        events: Its events, or one batch of them.
    """
    if note or not 0 < len(events) <= MOST:
        return None
    first = events[0]
    if isinstance(first, EventBatch):
        return _uniform_batch(stamp, note, first) if len(events) == 1 else None
    kinds = events.kinds if isinstance(events, TakenColumns) else set(map(type, events))
    if first.kind in OBJECT_KINDS or len(kinds) > 1:
        return None
    # All are of the first one's class, which is no batch.
    return _template(first.kind, len(events)).commit(stamp, note, events)  # type: ignore[arg-type]


def _uniform_batch(stamp: Stamp, note: Note, batch: EventBatch) -> tuple[BuiltChunk, Commit] | None:
    """Return the same for a batch."""
    if not 0 < len(batch) <= MOST or len(batch.columns) != 1 or not is_columns(batch):
        return None
    (kind,) = batch.columns
    return _template(kind, len(batch)).commit_of_batch(stamp, note, batch)


class _Template:
    """A chunk of n events of one kind and their Commit: all that does not depend on the values."""

    def __init__(self, kind: int, count: int) -> None:
        fixed = fixed_layout(kind)
        record = fixed.packer_behind(mcap.MESSAGE)
        self._kind = kind
        self._count = count
        self._pack = record.pack
        self._length = record.size - mcap.FRAME.size
        self._end = count * record.size
        self._values = field_getter(kind)
        self._columns = field_getters(kind)
        """Of an event about a door, that is the first."""
        self._pack_many = fixed.packer_behind(_HEAD, count).pack
        head = mcap.MESSAGE.pack(_MESSAGE, self._length, kind, 0, 0, 0)[:_SAME_BYTES]
        one = [head, 0, 0, 0, CDR_HEADER, *[0] * len(fixed.fields)]
        self._width = len(one)
        self._values_of_many: list[Any] = one * count
        """What is packed; its zeros are set for each commit."""
        self._pack_entries = struct.Struct(f"<{2 * count}Q").pack
        self._values_of_entries = [x for i in range(count) for x in (0, i * record.size)]
        closing, _ = closing_record(_BLANK, 1, 0, {})
        self._is_compressed = self._end + len(closing) >= COMPRESS_FROM_BYTES
        self._counts = {kind: count, COMMIT_CHANNEL: 1}
        self._index_heads = tuple(
            mcap.message_index_head(channel, n * mcap.MESSAGE_INDEX_ENTRY_BYTES)
            for channel, n in self._counts.items()
        )
        self._steps = np.arange(count, dtype=np.int64)
        self._offsets = np.append(self._steps * record.size, self._end)
        """Of the events and of the Commit."""

    def commit(
        self, stamp: Stamp, note: Note, events: Sequence[Event]
    ) -> tuple[BuiltChunk, Commit]:
        """Return the chunk and the commit."""
        start_ns = stamp.recorded_ns
        happened = _happened_times(events, stamp.wall_clock_ns)
        span = _span(happened, start_ns)
        if self._count <= FEW:
            packed = self._packed_few(stamp, happened, events)
        else:
            packed = self._packed_many(stamp, happened, events)
        return self._closed(stamp, note, packed, self._entries_at(start_ns), span)

    def commit_of_batch(
        self, stamp: Stamp, note: Note, batch: EventBatch
    ) -> tuple[BuiltChunk, Commit]:
        """Return the same of events as columns."""
        start_ns, steps = stamp.recorded_ns, self._steps
        happened = happened_times(batch, stamp.wall_clock_ns)
        span = span_of(happened, start_ns, steps)
        start = Start(stamp.first_event, start_ns)
        packed = packed_rows(self._kind, batch.columns[self._kind], steps, happened, start)
        return self._closed(stamp, note, packed.tobytes(), self._entries_at(start_ns), span)

    def _closed(
        self, stamp: Stamp, note: Note, packed: bytes, entries: bytes, span: tuple[int, int]
    ) -> tuple[BuiltChunk, Commit]:
        """Return the chunk of packed events, followed by the Commit."""
        start_ns, count = stamp.recorded_ns, self._count
        end_ns = start_ns + count
        digests = {self._kind: sha256(packed).digest()}
        closing, hashed = closing_record(stamp, stamp.first_event + count, end_ns, digests)
        commit = Commit(
            stamp.first_event, count, start_ns, end_ns, stamp.command_id, stamp.wall_clock_ns,
            stamp.monotonic_clock_ns, stamp.boot_id, stamp.previous_hash, hashed,
            stamp.durability, stamp.durable_before, stamp.content, note,
        )  # fmt: skip
        times, last_entry = (start_ns, end_ns), _ENTRY.pack(end_ns, self._end)
        if self._is_compressed:
            index = {self._kind: entries, COMMIT_CHANNEL: last_entry}
            chunk = assemble_chunk(packed + closing, index, times=times, happened=span)
        else:
            chunk = self._plain_chunk(packed + closing, entries, last_entry, times, span)
        chunk.offsets = self._offsets if count > FEW else None
        chunk.commit_at = self._end
        return chunk, commit

    def _plain_chunk(
        self,
        records: bytes,
        entries: bytes,
        last_entry: bytes,
        times: tuple[int, int],
        span: tuple[int, int],
    ) -> BuiltChunk:
        """Return what `assemble_chunk` does of records that are not compressed."""
        size = len(records)
        head = mcap.chunk_head(
            stored_size=size, size=size, compression="", crc=crc32(records),
            start=times[0], end=times[1],
        )  # fmt: skip
        of_events, of_commit = self._index_heads
        data = b"".join((head, records, of_events, entries, of_commit, last_entry))
        facts = ChunkFacts(len(head) + size, "", size, size, times, span, self._counts)
        return BuiltChunk(records, data, facts)

    def _packed_few(self, stamp: Stamp, happened: list[int], events: Sequence[Event]) -> bytes:
        """Return the events' records."""
        time, number = stamp.recorded_ns, stamp.first_event
        pack, values, length, kind = self._pack, self._values, self._length, self._kind
        records = [
            pack(_MESSAGE, length, kind, (number + i) & _LOW_32_BITS, time + i, happened[i],
                 CDR_HEADER, *values(event))
            for i, event in enumerate(events)
        ]  # fmt: skip
        return records[0] if len(records) == 1 else b"".join(records)

    def _packed_many(self, stamp: Stamp, happened: list[int], events: Sequence[Event]) -> bytes:
        """Return the same, a field of all events taken at once, and all of them packed at once."""
        start_ns, end = stamp.recorded_ns, stamp.first_event + self._count
        values, width = self._values_of_many.copy(), self._width
        values[1::width] = _sequences(stamp.first_event, end)
        values[2::width] = range(start_ns, start_ns + self._count)
        values[3::width] = happened
        columns = enumerate(self._columns, 5)
        if isinstance(events, TakenColumns):
            next(columns)
            values[5::width] = events.door_ids
        for place, column in columns:
            values[place::width] = map(column, events)
        return self._pack_many(*values)

    def _entries_at(self, start_ns: int) -> bytes:
        """Return the MessageIndex entries of the events."""
        values = self._values_of_entries.copy()
        values[::2] = range(start_ns, start_ns + self._count)
        return self._pack_entries(*values)


def _happened_times(events: Sequence[Event], wall_ns: int) -> list[int]:
    """Return when each event happened: the wall clock's time where it is not given."""
    if isinstance(events, TakenColumns):
        return events.times_or(wall_ns)
    return [wall_ns if e.happened_ns is None else e.happened_ns for e in events]


def _sequences(first: int, end: int) -> Sequence[int]:
    """Return the low 32 bits of these event numbers."""
    if end <= _LOW_32_BITS:
        return range(first, end)
    return [number & _LOW_32_BITS for number in range(first, end)]


def _span(happened: list[int], start_ns: int) -> tuple[int, int]:
    """Return the least and the greatest happened time; one later than its record counts as that."""
    greatest = max(happened)
    if greatest <= start_ns:
        return min(happened), greatest
    folded = [min(time, start_ns + i) for i, time in enumerate(happened)]
    return min(folded), max(folded)


_BLANK = Stamp(0, 0, bytes(32), bytes(16), 0, 0, bytes(16))

_template = lru_cache(maxsize=128)(_Template)
