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

from semmap_log.commits import Commit, Durability, Note
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

_MESSAGE = int(Opcode.MESSAGE)


@dataclass(frozen=True, slots=True)
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
    content: bytes = bytes(16)


class _Channel:
    """What a commit has on one channel."""

    __slots__ = ("digest", "entries")

    def __init__(self) -> None:
        self.digest = hashlib.sha256()
        """Of its records, in order."""
        self.entries: list[int] = []
        """Log time and offset of each record in the chunk that is being made."""


@cache
def _packing(kind: int) -> tuple[Callable[..., bytes], int, Callable[[Event], tuple[Any, ...]]]:
    """Return what packs a whole record of a fixed-size kind, its length field, and its values."""
    packer = fixed_layout(kind).packer_behind(mcap.MESSAGE)
    return packer.pack, packer.size - mcap.FRAME.size, field_getter(kind)


class CommitBuilder:
    """Turns events into the chunks of one commit, in memory of about one chunk.

    Works without numpy: most commits are one event, and then its calls would be most of the time.
    """

    def __init__(self, stamp: Stamp, note: Note = Note(), salt: bytes = bytes(16)) -> None:
        self._stamp = stamp
        self._note = note
        self._salt = salt
        self._time = stamp.recorded_ns
        self._number = stamp.first_event
        self._channels: dict[int, _Channel] = {}
        self._parts: list[bytes] = []
        self._size = 0
        self._chunk_start_ns = self._time
        self._happened: list[int] = []
        self.levels: set[int] = set()
        """Levels whose floor map is in it: their channels must stand before the chunk."""

    def chunks(self, events: Iterable[Event]) -> Iterator[BuiltChunk]:
        """Yield the commit's chunks; only the last makes it visible."""
        for event in events:
            if self._size >= CHUNK_BYTES:
                yield self._chunk()
            self._add_event(event)
        if self._number == self._stamp.first_event:
            raise CommandError("a commit wants at least one event.")
        if self._note:
            self._add_note()
        self._add_commit()
        yield self._chunk()

    @property
    def commit(self) -> Commit:
        """The commit, once all chunks are made."""
        stamp = self._stamp
        return Commit(
            first_event=stamp.first_event,
            count=self._number - stamp.first_event,
            recorded_ns=stamp.recorded_ns,
            closed_ns=self._time - 1,
            command_id=stamp.command_id,
            wall_clock_ns=stamp.wall_clock_ns,
            monotonic_clock_ns=stamp.monotonic_clock_ns,
            boot_id=stamp.boot_id,
            previous_hash=stamp.previous_hash,
            hash=self._hash,
            durability=stamp.durability,
            durable_before=stamp.durable_before,
            content=stamp.content,
            note=self._note,
        )

    def _add_event(self, event: Event) -> None:
        time, number, channel = self._time, self._number, event.kind
        happened = self._stamp.wall_clock_ns if event.happened_ns is None else event.happened_ns
        if channel in OBJECT_KINDS:
            if isinstance(event, DoorAnnotated) and not event.salt:
                event = replace(event, salt=_derived_salt(self._salt, number))
            elif isinstance(event, FloorMap):
                channel = FLOOR_MAP_CHANNEL + event.level
                self.levels.add(event.level)
            record = mcap.message(channel, number, time, happened, encode(event, happened))
        else:
            pack, length, values = _packing(channel)
            sequence = number & 0xFFFF_FFFF
            record = pack(
                _MESSAGE, length, channel, sequence, time, happened, CDR_HEADER, *values(event)
            )
        self._happened.append(min(time, happened))
        self._add(channel, record)
        self._number = number + 1

    def _add_note(self) -> None:
        note = self._note
        salt = note.salt or _derived_salt(self._salt, -1)
        data = serialize(
            type_name("CommitNote"),
            salt=np.frombuffer(salt, np.uint8),
            actor=note.actor,
            source=note.source,
            reason=note.reason,
            correlation=note.correlation,
        )
        record = mcap.message(NOTE_CHANNEL, self._number - 1, self._time, self._time, data)
        self._add(NOTE_CHANNEL, record)

    def _add_commit(self) -> None:
        stamp = self._stamp
        data = layout("Commit").pack(
            stamp.first_event,
            stamp.durable_before,
            self._number - stamp.first_event,
            stamp.durability,
            stamp.command_id,
            stamp.content,
            stamp.wall_clock_ns,
            stamp.monotonic_clock_ns,
            stamp.boot_id,
            stamp.previous_hash,
            NO_HASH,
        )
        record = mcap.message(COMMIT_CHANNEL, self._number - 1, self._time, self._time, data)
        digests = {channel: known.digest.digest() for channel, known in self._channels.items()}
        self._hash = commit_hash(record, digests)
        self._add(COMMIT_CHANNEL, record[:-HASH_BYTES] + self._hash)

    def _add(self, channel: int, record: bytes) -> None:
        known = self._channels.get(channel)
        if known is None:
            known = self._channels[channel] = _Channel()
        known.digest.update(record)
        known.entries += (self._time, self._size)
        self._parts.append(record)
        self._size += len(record)
        self._time += 1

    def _chunk(self) -> BuiltChunk:
        index = {
            channel: struct.pack(f"<{len(known.entries)}Q", *known.entries)
            for channel, known in sorted(self._channels.items())
            if known.entries
        }
        happened = self._happened
        built = assemble_chunk(
            b"".join(self._parts),
            index,
            times=(self._chunk_start_ns, self._time - 1),
            happened=(min(happened), max(happened)) if happened else NO_SPAN,
        )
        self._parts, self._size, self._happened = [], 0, []
        self._chunk_start_ns = self._time
        for known in self._channels.values():
            known.entries = []
        return built


def commit_hash(commit_record: bytes | memoryview, digests: dict[int, bytes]) -> bytes:
    """Return the hash that belongs into a Commit record.

    Args:
        commit_record: The whole Message record; its last 32 bytes do not count.
        digests: Channel id -> sha256 of that channel's records in this commit, in order.
    """
    whole = hashlib.sha256(commit_record[:-HASH_BYTES])
    for channel, digest in sorted(digests.items()):
        whole.update(struct.pack("<H", channel) + digest)
    return whole.digest()


def _derived_salt(salt: bytes, number: int) -> bytes:
    """Return a salt of its own for each text of a commit, from one draw of randomness."""
    return hashlib.sha256(salt + struct.pack("<q", number)).digest()[:16]
