"""A commit's bytes: its events, its note, and the record whose hash chains it to the last."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from mcap.opcode import Opcode

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.messages import (
    CDR_HEADER,
    OBJECT_KINDS,
    encode,
    field_getter,
    fixed_layout,
    layout,
    type_name,
    write_message,
)
from semmap_log.core.model.commits import NO_CONTENT, Commit, Durability, Note
from semmap_log.core.model.events import DoorAnnotated, Event, FloorMap
from semmap_log.errors import CommandError, InvalidEventError
from semmap_log.store import records as mcap
from semmap_log.store.batch_records import Start, block_of, is_columns, record_size, sizes_of
from semmap_log.store.chunk_builder import ChunkBuilder, wider
from semmap_log.store.chunks import BuiltChunk
from semmap_log.store.form import (
    CHUNK_BYTES,
    COMMIT_CHANNEL,
    FLOOR_MAP_CHANNEL,
    HASH_BYTES,
    NO_HASH,
    NOTE_CHANNEL,
)

MOST_EVENT_BYTES = 100 * 2**20
"""Of an event's record: a floor map of 100 million cells is shorter. Chunks have a bound, too."""
SALT_BYTES = 16

Entropy = Callable[[int], bytes]
"""Like os.urandom: n bytes for ids and salts; seeded where bytes must repeat."""

_MESSAGE = int(Opcode.MESSAGE)
_LOW_32_BITS = 0xFFFF_FFFF

ROWS_AT_A_TIME = 8192
"""So many of a batch become records at a time: less than a chunk, and the CPU's cache holds it."""


@dataclass(slots=True)
class Stamp:
    """All that a commit takes from outside: the log's position, the caller, and the time."""

    first_event: int
    recorded_ns: int
    previous_hash: bytes
    command_id: bytes
    wall_clock_ns: int
    monotonic_clock_ns: int
    boot_id: bytes
    durability: Durability = Durability.EVENT
    durable_before: int = 0
    content: bytes = NO_CONTENT


@cache
def _packing(kind: int) -> tuple[Callable[..., bytes], int, Callable[[Event], tuple[Any, ...]]]:
    """Return what packs a whole record of a fixed-size kind, its length field, and its values."""
    packer = fixed_layout(kind).packer_behind(mcap.MESSAGE)
    return packer.pack, packer.size - mcap.FRAME.size, field_getter(kind)


@cache
def _commit_packing() -> tuple[Callable[..., bytes], int]:
    """Return what packs a whole Commit record, and its length field."""
    packer = layout("Commit").packer_behind(mcap.MESSAGE)
    return packer.pack, packer.size - mcap.FRAME.size


class CommitBuilder:
    """Turns events into the chunks of one commit, in memory of about one chunk.

    Events that come one by one are packed without numpy: most commits are one event, and then its
    calls would be most of the time.
    """

    def __init__(self, stamp: Stamp, note: Note, entropy: Entropy) -> None:
        """Prepare a commit.

        Args:
            stamp: What the commit takes from outside.
            note: Its note: who, with what, why.
            entropy: Gives salts.

        Raises:
            InvalidEventError: The note is too long.
        """
        note.check_length()
        self._stamp = stamp
        self._note = note
        self._entropy = entropy
        self._drawn_salt = b""
        self._digests: dict[int, Any] = {}
        """Channel -> sha256 of its records so far."""
        self._hash = NO_HASH
        self._end_ns = stamp.recorded_ns
        self._end_event = stamp.first_event
        self.levels: set[int] = set()
        """Levels whose floor map is in it: their channels must stand before the chunk."""

    def chunks(self, events: Iterable[Event | EventBatch]) -> Iterator[BuiltChunk]:
        """Yield the commit's chunks; only the last makes it visible.

        Args:
            events: Events, and batches of them, whose numbers and recorded times do not count.

        Raises:
            InvalidEventError: One is too long.
        """
        open_chunk = ChunkBuilder(self._stamp.recorded_ns)
        for part in _parts(events):
            rest: Event | EventBatch | None = part
            while rest is not None:
                if open_chunk.size >= CHUNK_BYTES:
                    yield self._full(open_chunk)
                    open_chunk = ChunkBuilder(open_chunk.time)
                rest = self._fill(open_chunk, rest)
        if self._end_event == self._stamp.first_event:
            raise CommandError("a commit wants at least one event.")
        if self._note:
            open_chunk.add(NOTE_CHANNEL, self._note_record(open_chunk.time))
        self._end_ns = open_chunk.time
        yield self._last_chunk(open_chunk)

    def _fill(self, open_chunk: ChunkBuilder, events: Event | EventBatch) -> EventBatch | None:
        """Add an event, or as many of a batch as there is room for; return those that are left."""
        number, wall_ns = self._end_event, self._stamp.wall_clock_ns
        if not isinstance(events, EventBatch):
            happened = wall_ns if events.happened_ns is None else events.happened_ns
            self._add(open_chunk, events, number, happened)
            self._end_event = number + 1
            return None
        fits, rest = _split(events, CHUNK_BYTES - open_chunk.size)
        open_chunk.add_block(block_of(fits, Start(number, open_chunk.time), wall_ns))
        self._end_event = number + len(fits)
        return rest if len(rest) else None

    def _add(self, open_chunk: ChunkBuilder, event: Event, number: int, happened: int) -> None:
        kind, time = event.kind, open_chunk.time
        if kind in OBJECT_KINDS:
            channel, record = self._object(event, number, time, happened)
        else:
            channel = kind
            pack, length, values = _packing(kind)
            record = pack(
                _MESSAGE, length, kind, number & _LOW_32_BITS, time, happened,
                CDR_HEADER, *values(event),
            )  # fmt: skip
        open_chunk.add(channel, record)
        open_chunk.span = wider(open_chunk.span, min(time, happened))

    @property
    def commit(self) -> Commit:
        """The commit, once all chunks are made."""
        stamp = self._stamp
        return Commit(
            stamp.first_event,
            self._end_event - stamp.first_event,
            stamp.recorded_ns,
            self._end_ns,
            stamp.command_id,
            stamp.wall_clock_ns,
            stamp.monotonic_clock_ns,
            stamp.boot_id,
            stamp.previous_hash,
            self._hash,
            stamp.durability,
            stamp.durable_before,
            stamp.content,
            self._note,
        )

    def _object(self, event: Event, number: int, time: int, happened: int) -> tuple[int, bytes]:
        """Return the channel and the record of an event with texts or arrays."""
        channel = event.kind
        if isinstance(event, DoorAnnotated) and not event.salt:
            event = replace(event, salt=self._salt(number))
        elif isinstance(event, FloorMap):
            channel = FLOOR_MAP_CHANNEL + event.level
            self.levels.add(event.level)
        record = mcap.message(channel, number, time, happened, encode(event, happened))
        if len(record) > MOST_EVENT_BYTES:
            expected = f"a record of at most {MOST_EVENT_BYTES} bytes"
            raise InvalidEventError(type(event).__name__, expected, len(record))
        return channel, record

    def _note_record(self, time: int) -> bytes:
        note = self._note
        said = {
            "salt": note.salt or self._salt(-1),
            "actor": note.actor,
            "source": note.source,
            "reason": note.reason,
            "correlation": note.correlation,
        }
        data = write_message(type_name("CommitNote"), said)
        return mcap.message(NOTE_CHANNEL, self._end_event - 1, time, time, data)

    def _salt(self, number: int) -> bytes:
        """Return a salt of its own for each text of a commit, from one draw of randomness."""
        self._drawn_salt = self._drawn_salt or self._entropy(SALT_BYTES)
        return hashlib.sha256(self._drawn_salt + struct.pack("<q", number)).digest()[:SALT_BYTES]

    def _last_chunk(self, open_chunk: ChunkBuilder) -> BuiltChunk:
        """Return the chunk that closes the commit: the events that are left, note and Commit."""
        open_chunk.hash_into(self._digests)
        digests = {channel: digest.digest() for channel, digest in self._digests.items()}
        record, self._hash = closing_record(self._stamp, self._end_event, self._end_ns, digests)
        open_chunk.add(COMMIT_CHANNEL, record)
        return open_chunk.chunk()

    def _full(self, open_chunk: ChunkBuilder) -> BuiltChunk:
        open_chunk.hash_into(self._digests)
        return open_chunk.chunk()


def _parts(events: Iterable[Event | EventBatch]) -> Iterator[Event | EventBatch]:
    """Yield events, and of batches parts that can be made records at once.

    What has texts or maps comes one by one, and so does a batch in which there are such.
    """
    for event in events:
        if not isinstance(event, EventBatch):
            yield event
            continue
        for part in event.parts(ROWS_AT_A_TIME):
            if len(part) and is_columns(part):
                yield part
            else:
                yield from part.to_events()


def _split(batch: EventBatch, room: int) -> tuple[EventBatch, EventBatch]:
    """Return the events that a chunk takes which has so much room, at least one, and the rest.

    A chunk takes one more as long as it has any room: it may become longer than it should.
    """
    if len(batch.columns) == 1:
        (kind,) = batch.columns
        return batch.split(-(-room // record_size(kind)))
    ends = np.cumsum(sizes_of(batch))
    return batch.split(int(np.searchsorted(ends, room, "left")) + 1)


def closing_record(
    stamp: Stamp, end_event: int, time: int, digests: dict[int, bytes]
) -> tuple[bytes, bytes]:
    """Return the Commit record, and the hash in it.

    Args:
        stamp: What the commit takes from outside.
        end_event: The number after its last event.
        time: Its log time.
        digests: Channel id -> sha256 of that channel's records in this commit, in order.
    """
    pack, length = _commit_packing()
    record = pack(
        _MESSAGE, length, COMMIT_CHANNEL, (end_event - 1) & _LOW_32_BITS, time, time,
        CDR_HEADER,
        stamp.first_event,
        stamp.durable_before,
        end_event - stamp.first_event,
        stamp.durability,
        stamp.command_id,
        stamp.content,
        stamp.wall_clock_ns,
        stamp.monotonic_clock_ns,
        stamp.boot_id,
        stamp.previous_hash,
        NO_HASH,
    )  # fmt: skip
    hashed = commit_hash(record, digests)
    return record[:-HASH_BYTES] + hashed, hashed


def commit_hash(commit_record: bytes | memoryview, digests: dict[int, bytes]) -> bytes:
    """Return the hash that belongs into a Commit record.

    Args:
        commit_record: The whole Message record; its last 32 bytes do not count.
        digests: Channel id -> sha256 of that channel's records in this commit, in order.
    """
    whole = hashlib.sha256(commit_record[:-HASH_BYTES])
    for channel, digest in sorted(digests.items()):
        whole.update(channel.to_bytes(2, "little") + digest)
    return whole.digest()
