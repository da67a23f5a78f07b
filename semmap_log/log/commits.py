"""A commit's bytes: its events, its note, and the record whose hash chains it to the last."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import accumulate, count
from typing import Any

import numpy as np
from mcap.opcode import Opcode

from semmap_log.commits import NO_CONTENT, Commit, Durability, Note
from semmap_log.errors import CommandError
from semmap_log.events import DoorAnnotated, Event, FloorMap
from semmap_log.log import records as mcap
from semmap_log.log.chunks import NO_SPAN, BuiltChunk, assemble_chunk
from semmap_log.log.form import (
    CHUNK_BYTES,
    COMMIT_CHANNEL,
    FLOOR_MAP_CHANNEL,
    NOTE_CHANNEL,
)
from semmap_log.messages import (
    CDR_HEADER,
    OBJECT_KINDS,
    encode,
    field_getter,
    fixed_layout,
    layout,
    serialize,
    type_name,
)

NO_HASH = bytes(32)
"""What the first commit of a log has as its predecessor's hash."""

HASH_BYTES = 32
SALT_BYTES = 16

Entropy = Callable[[int], bytes]
"""Like os.urandom: n bytes for ids and salts; seeded where bytes must repeat."""

_MESSAGE = int(Opcode.MESSAGE)
_LOW_32_BITS = 0xFFFF_FFFF


@dataclass(slots=True)
class Stamp:
    """All that a commit takes from outside: where the log stands, who asks, what time it is."""

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

    Works without numpy: most commits are one event, and then its calls would be most of the time.
    """

    def __init__(self, stamp: Stamp, note: Note, entropy: Entropy) -> None:
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

    def chunks(self, events: Iterable[Event]) -> Iterator[BuiltChunk]:
        """Yield the commit's chunks; only the last makes it visible."""
        time, number = self._stamp.recorded_ns, self._stamp.first_event
        wall_ns = self._stamp.wall_clock_ns
        records: list[bytes] = []
        channels: list[int] = []
        span = NO_SPAN
        size = 0
        for event in events:
            if size >= CHUNK_BYTES:
                yield self._chunk(records, channels, time, span)
                records, channels, span, size = [], [], NO_SPAN, 0
            kind = event.kind
            happened = wall_ns if event.happened_ns is None else event.happened_ns
            if kind in OBJECT_KINDS:
                channel, record = self._object(event, number, time, happened)
            else:
                channel = kind
                pack, length, values = _packing(kind)
                record = pack(
                    _MESSAGE, length, kind, number & _LOW_32_BITS, time, happened,
                    CDR_HEADER, *values(event),
                )  # fmt: skip
            records.append(record)
            channels.append(channel)
            span = _wider(span, min(time, happened))
            size += len(record)
            time += 1
            number += 1
        if number == self._stamp.first_event:
            raise CommandError("a commit wants at least one event.")
        self._end_event = number
        if self._note:
            records.append(self._note_record(time))
            channels.append(NOTE_CHANNEL)
            time += 1
        self._end_ns = time
        yield self._last_chunk(records, channels, span)

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
        return channel, mcap.message(channel, number, time, happened, encode(event, happened))

    def _note_record(self, time: int) -> bytes:
        note = self._note
        data = serialize(
            type_name("CommitNote"),
            salt=np.frombuffer(note.salt or self._salt(-1), np.uint8),
            actor=note.actor,
            source=note.source,
            reason=note.reason,
            correlation=note.correlation,
        )
        return mcap.message(NOTE_CHANNEL, self._end_event - 1, time, time, data)

    def _salt(self, number: int) -> bytes:
        """Return a salt of its own for each text of a commit, from one draw of randomness."""
        self._drawn_salt = self._drawn_salt or self._entropy(SALT_BYTES)
        return hashlib.sha256(self._drawn_salt + struct.pack("<q", number)).digest()[:SALT_BYTES]

    def _last_chunk(
        self, records: list[bytes], channels: list[int], span: tuple[int, int]
    ) -> BuiltChunk:
        """Return the chunk that closes the commit: the events that are left, note and Commit."""
        self._hash_in(records, channels)
        time = self._end_ns
        digests = {channel: digest.digest() for channel, digest in self._digests.items()}
        record, self._hash = closing_record(self._stamp, self._end_event, time, digests)
        records.append(record)
        channels.append(COMMIT_CHANNEL)
        return _chunk_of(records, channels, time + 1, span)

    def _chunk(
        self, records: list[bytes], channels: list[int], end_ns: int, span: tuple[int, int]
    ) -> BuiltChunk:
        self._hash_in(records, channels)
        return _chunk_of(records, channels, end_ns, span)

    def _hash_in(self, records: list[bytes], channels: list[int]) -> None:
        """Take records into the digests of their channels."""
        alone = len(channels) == channels.count(channels[0]) if channels else False
        for channel in sorted(set(channels)):
            mine = records if alone else [
                record for record, its in zip(records, channels, strict=True) if its == channel
            ]  # fmt: skip
            joined = b"".join(mine) if len(mine) > 1 else mine[0]
            known = self._digests.get(channel)
            if known is None:
                self._digests[channel] = hashlib.sha256(joined)
            else:
                known.update(joined)


def _chunk_of(
    records: list[bytes], channels: list[int], end_ns: int, span: tuple[int, int]
) -> BuiltChunk:
    """Return the chunk of these records, whose log times are one apart and end before `end_ns`."""
    start_ns = end_ns - len(records)
    entries: dict[int, list[int]] = {}
    for channel, time, offset in zip(
        channels, count(start_ns), accumulate(map(len, records), initial=0)
    ):  # the offsets are one more: where the next record would begin
        known = entries.get(channel)
        if known is None:
            entries[channel] = [time, offset]
        else:
            known += (time, offset)
    return assemble_chunk(
        b"".join(records),
        {
            channel: struct.pack(f"<{len(known)}Q", *known)
            for channel, known in sorted(entries.items())
        },
        times=(start_ns, end_ns - 1),
        happened=span,
    )


def closing_record(
    stamp: Stamp, end_event: int, time: int, digests: dict[int, bytes]
) -> tuple[bytes, bytes]:
    """Return the Commit record, and the hash in it.

    Args:
        stamp: What the commit takes from outside.
        end_event: The number behind its last event.
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


def _wider(span: tuple[int, int], time: int) -> tuple[int, int]:
    if span is NO_SPAN:
        return time, time
    low, high = span
    return (time, high) if time < low else (low, time) if time > high else span
