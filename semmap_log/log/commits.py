"""A commit's bytes: its events, its note, and the record whose hash chains it to the last."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from semmap_log.commits import Commit, Note
from semmap_log.errors import CommandError
from semmap_log.events import DoorAnnotated, Event, FloorMap
from semmap_log.log import records as mcap
from semmap_log.log.chunks import BuiltChunk, build_chunk
from semmap_log.log.form import (
    CHUNK_BYTES,
    COMMIT_CHANNEL,
    FLOOR_MAP_CHANNEL,
    NOTE_CHANNEL,
)
from semmap_log.messages import encode, layout, serialize, type_name

NO_HASH = bytes(32)
"""What the first commit of a log has as its predecessor's hash."""

HASH_BYTES = 32


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


class CommitBuilder:
    """Turns events into the chunks of one commit, in memory of about one chunk."""

    def __init__(self, stamp: Stamp, note: Note = Note(), salt: bytes = bytes(16)) -> None:
        self._stamp = stamp
        self._note = note
        self._salt = salt
        self._time = stamp.recorded_ns
        self._number = stamp.first_event
        self._parts: list[bytes] = []
        self._offsets: list[int] = []
        self._size = 0
        self._digests: dict[int, Any] = {}
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
            note=self._note,
        )

    def _add_event(self, event: Event) -> None:
        happened = self._stamp.wall_clock_ns if event.happened_ns is None else event.happened_ns
        if isinstance(event, DoorAnnotated) and not event.salt:
            event = replace(event, salt=_derived_salt(self._salt, self._number))
        channel = event.kind
        if isinstance(event, FloorMap):
            channel = FLOOR_MAP_CHANNEL + event.level
            self.levels.add(event.level)
        self._add(channel, self._number, happened, encode(event, happened))
        self._number += 1

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
        self._add(NOTE_CHANNEL, self._number - 1, self._time, data)

    def _add_commit(self) -> None:
        stamp = self._stamp
        data = layout("Commit").pack(
            stamp.first_event,
            self._number - stamp.first_event,
            stamp.command_id,
            stamp.wall_clock_ns,
            stamp.monotonic_clock_ns,
            stamp.boot_id,
            stamp.previous_hash,
            NO_HASH,
        )
        record = mcap.message(COMMIT_CHANNEL, self._number - 1, self._time, self._time, data)
        digests = {channel: digest.digest() for channel, digest in self._digests.items()}
        self._hash = commit_hash(record, digests)
        self._append(record[:-HASH_BYTES] + self._hash)

    def _add(self, channel: int, number: int, happened: int, data: bytes) -> None:
        record = mcap.message(channel, number, self._time, happened, data)
        if channel not in self._digests:
            self._digests[channel] = hashlib.sha256()
        self._digests[channel].update(record)
        self._append(record)

    def _append(self, record: bytes) -> None:
        self._offsets.append(self._size)
        self._parts.append(record)
        self._size += len(record)
        self._time += 1

    def _chunk(self) -> BuiltChunk:
        built = build_chunk(b"".join(self._parts), np.array(self._offsets, np.int64))
        self._parts, self._offsets, self._size = [], [], 0
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
