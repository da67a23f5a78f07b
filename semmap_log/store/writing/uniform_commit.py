"""Commits of events that are all of one fixed-size kind, without a note: most of a patrol's.

The bytes are those of `CommitBuilder`, made in a few calls, since all but the values is known
before: a durable append takes as long as the disk does only if little else is done for it.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import lru_cache
from hashlib import sha256
from itertools import chain
from zlib import crc32

import numpy as np
from mcap.opcode import Opcode

from semmap_log.batches.event_batch import EventBatch
from semmap_log.domain.commits import Commit, Note
from semmap_log.domain.events import Event
from semmap_log.messages import CDR_HEADER, OBJECT_KINDS, field_getter, fixed_layout
from semmap_log.store import records as mcap
from semmap_log.store.batch_records import Start, happened_times, is_columns, packed_rows, span_of
from semmap_log.store.chunks import BuiltChunk, ChunkFacts
from semmap_log.store.commit_records import Stamp, closing_record
from semmap_log.store.form import COMMIT_CHANNEL, COMPRESS_FROM_BYTES

FEW = 8
"""Up to so many events are packed one by one; more are laid out with numpy."""
MOST = 1000
_LOW_32_BITS = 0xFFFF_FFFF
_CDR_HEADER = np.frombuffer(CDR_HEADER, np.uint8)
_MESSAGE = int(Opcode.MESSAGE)
_ENTRY = struct.Struct("<QQ")
"""Of a MessageIndex: log time and offset in the chunk's records."""


def uniform_commit(
    stamp: Stamp, note: Note, events: Sequence[Event | EventBatch]
) -> tuple[BuiltChunk, Commit] | None:
    """Return the one chunk of a commit, and the commit; None if it wants `CommitBuilder`.

    Args:
        stamp: What it takes from outside.
        note: What was said of it.
        events: Its events, or one batch of them.
    """
    if note or not 0 < len(events) <= MOST:
        return None
    first = events[0]
    if isinstance(first, EventBatch):
        return _uniform_batch(stamp, note, first) if len(events) == 1 else None
    cls = type(first)
    if first.kind in OBJECT_KINDS or {cls} != set(map(type, events)):
        return None
    template = _template(first.kind, len(events))
    # All are of the first one's class, which is no batch.
    return template.commit(stamp, note, events) if template.fits else None  # type: ignore[arg-type]


def _uniform_batch(stamp: Stamp, note: Note, batch: EventBatch) -> tuple[BuiltChunk, Commit] | None:
    """Return the same for a batch."""
    if not 0 < len(batch) <= MOST or len(batch.columns) != 1 or not is_columns(batch):
        return None
    (kind,) = batch.columns
    template = _template(kind, len(batch))
    return template.commit_of_batch(stamp, note, batch) if template.fits else None


class _Template:
    """A chunk of n events of one kind and their Commit: all that does not depend on the values."""

    def __init__(self, kind: int, count: int) -> None:
        fixed = fixed_layout(kind)
        record = fixed.packer_behind(mcap.MESSAGE)
        self._kind = kind
        self._count = count
        self._pack = record.pack
        self._pack_bodies = fixed.packer_of(count).pack
        self._values = field_getter(kind)
        self._length = record.size - mcap.FRAME.size
        self._end = count * record.size
        closing, _ = closing_record(_BLANK, 1, 0, {})
        self.fits = self._end + len(closing) < COMPRESS_FROM_BYTES
        """Larger chunks are compressed."""
        self._counts = {kind: count, COMMIT_CHANNEL: 1}
        self._index_heads = tuple(
            mcap.message_index_head(channel, n * mcap.MESSAGE_INDEX_ENTRY_BYTES)
            for channel, n in self._counts.items()
        )
        self._steps = np.arange(count, dtype=np.int64)
        self._entries = np.zeros((count, 2), "<i8")
        self._entries[:, 1] = self._steps * record.size
        self._offsets = np.append(self._entries[:, 1], self._end)
        """Of the events and of the Commit."""
        self._rows = np.zeros(count, fixed.behind(mcap.MESSAGE_DTYPE))
        self._rows["opcode"], self._rows["length"] = _MESSAGE, self._length
        self._rows["channel_id"] = kind

    def commit(
        self, stamp: Stamp, note: Note, events: Sequence[Event]
    ) -> tuple[BuiltChunk, Commit]:
        """Return the chunk and the commit."""
        start_ns, wall_ns = stamp.recorded_ns, stamp.wall_clock_ns
        happened = [wall_ns if e.happened_ns is None else e.happened_ns for e in events]
        span = _span(happened, start_ns)
        if self._count <= FEW:
            packed = self._packed_few(stamp, happened, events)
            return self._closed(stamp, note, packed, self._entries_of_few(start_ns), span)
        packed = self._packed_many(stamp, happened, events)
        return self._closed(stamp, note, packed, self._entries_of_many(start_ns), span)

    def commit_of_batch(
        self, stamp: Stamp, note: Note, batch: EventBatch
    ) -> tuple[BuiltChunk, Commit]:
        """Return the same of events as columns."""
        start_ns, steps = stamp.recorded_ns, self._steps
        happened = happened_times(batch, stamp.wall_clock_ns)
        span = span_of(happened, start_ns, steps)
        start = Start(stamp.first_event, start_ns)
        packed = packed_rows(self._kind, batch.columns[self._kind], steps, happened, start)
        entries = self._entries_of_many(start_ns)
        return self._closed(stamp, note, packed.tobytes(), entries, span)

    def _closed(
        self, stamp: Stamp, note: Note, packed: bytes, entries: bytes, span: tuple[int, int]
    ) -> tuple[BuiltChunk, Commit]:
        """Return the chunk of packed events, with the Commit behind them."""
        start_ns, count = stamp.recorded_ns, self._count
        end_ns = start_ns + count
        digests = {self._kind: sha256(packed).digest()}
        closing, hashed = closing_record(stamp, stamp.first_event + count, end_ns, digests)
        records = packed + closing
        size = len(records)
        head = mcap.chunk_head(
            stored_size=size, size=size, compression="", crc=crc32(records),
            start=start_ns, end=end_ns,
        )  # fmt: skip
        of_events, of_commit = self._index_heads
        data = b"".join((
            head, records, of_events, entries, of_commit, _ENTRY.pack(end_ns, self._end),
        ))  # fmt: skip
        facts = ChunkFacts(len(head) + size, "", size, size, (start_ns, end_ns), span, self._counts)
        commit = Commit(
            stamp.first_event, count, start_ns, end_ns, stamp.command_id, stamp.wall_clock_ns,
            stamp.monotonic_clock_ns, stamp.boot_id, stamp.previous_hash, hashed,
            stamp.durability, stamp.durable_before, stamp.content, note,
        )  # fmt: skip
        offsets = self._offsets if count > FEW else None
        return BuiltChunk(records, data, facts, offsets, self._end), commit

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
        """Return the same, the fields of all records set at once."""
        rows = self._rows.copy()
        rows["sequence"] = (self._steps + stamp.first_event) & _LOW_32_BITS
        rows["log_time"] = self._steps + stamp.recorded_ns
        rows["publish_time"] = happened
        bodies = self._pack_bodies(*chain.from_iterable(map(self._values, events)))
        as_bytes, body = rows.view(np.uint8).reshape(self._count, -1), mcap.MESSAGE.size
        as_bytes[:, body:] = np.frombuffer(bodies, np.uint8).reshape(self._count, -1)
        as_bytes[:, body : body + len(CDR_HEADER)] = _CDR_HEADER
        data: bytes = rows.tobytes()
        return data

    def _entries_of_few(self, start_ns: int) -> bytes:
        """Return the MessageIndex entries of the events."""
        size = self._length + mcap.FRAME.size
        return b"".join([_ENTRY.pack(start_ns + i, i * size) for i in range(self._count)])

    def _entries_of_many(self, start_ns: int) -> bytes:
        entries = self._entries.copy()
        entries[:, 0] = self._steps + start_ns
        data: bytes = entries.tobytes()
        return data


def _span(happened: list[int], start_ns: int) -> tuple[int, int]:
    """Return the least and the greatest happened time; one later than its record counts as that."""
    greatest = max(happened)
    if greatest <= start_ns:
        return min(happened), greatest
    folded = [min(time, start_ns + i) for i, time in enumerate(happened)]
    return min(folded), max(folded)


_BLANK = Stamp(0, 0, bytes(32), bytes(16), 0, 0, bytes(16))

_template = lru_cache(maxsize=256)(_Template)
