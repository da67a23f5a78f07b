"""A commit's bytes: its events, its note, and the record whose hash chains it to the last."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

from mcap.opcode import Opcode

from semmap_log.core.batches.columnar_events import ColumnarEvents
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.messages import (
    CDR_HEADER,
    OBJECT_KINDS,
    encode,
    layout,
    type_name,
    write_message,
)
from semmap_log.core.model.commits import NO_CONTENT, Commit, Durability, Note
from semmap_log.core.model.events import DoorAnnotated, Event, FloorMap
from semmap_log.errors import CommandError, InvalidEventError
from semmap_log.store import record_runs
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import (
    CHUNK_BYTES,
    COMMIT_CHANNEL,
    FLOOR_MAP_CHANNEL,
    HASH_BYTES,
    NO_HASH,
    NOTE_CHANNEL,
)
from semmap_log.store.chunk_builder import ChunkBuilder, kept_template
from semmap_log.store.chunks import BuiltChunk

if TYPE_CHECKING:
    from typing_extensions import Self

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

    @classmethod
    def of(
        cls, commit: Commit, first_event: int, previous_hash: bytes, durable_before: int
    ) -> Self:
        """Return that of a commit which is written again, after other commits."""
        return cls(
            first_event,
            commit.recorded_ns,
            previous_hash,
            commit.command_id,
            commit.wall_clock_ns,
            commit.monotonic_clock_ns,
            commit.boot_id,
            commit.durability,
            durable_before,
            commit.content,
        )


@cache
def _commit_packing() -> tuple[Callable[..., bytes], int]:
    """Return what packs a whole Commit record, and its length field."""
    packer = layout("Commit").packer_after(mcap.MESSAGE)
    return packer.pack, packer.size - mcap.FRAME.size


@cache
def _commit_run() -> record_runs.Run:
    """Return the run of one Commit record."""
    return record_runs.plain_run(
        COMMIT_CHANNEL, 1, layout("Commit").packer_after(mcap.MESSAGE).size
    )


class CommitBuilder:
    """Turns events into the chunks of one commit, in memory of about one chunk."""

    def __init__(self, stamp: Stamp, note: Note, entropy: Entropy) -> None:
        """Prepare a commit.

        Args:
            stamp: What the commit takes from outside.
            note: Its note: who, with what, why.
            entropy: Gives salts.

        Raises:
            InvalidEventError: The note is too long.
        """
        self._has_note = bool(note)
        if self._has_note:
            note.check_length()
        self._stamp = stamp
        self._note = note
        self._entropy = entropy
        self._drawn_salt = b""
        self._hash: bytes
        """Known, with the next, once all chunks are made."""
        self._end_ns: int
        self._end_event = stamp.first_event
        self.levels: set[int] = set()
        """Levels whose floor map is in it: their channels must stand before the chunk."""

    def chunks(self, events: Iterable[Event | EventBatch]) -> Iterable[BuiltChunk]:
        """Return the commit's chunks, made one by one; only the last makes it visible.

        Args:
            events: Events, and batches of them, whose numbers and recorded times do not count.

        Raises:
            InvalidEventError: One is too long.
        """
        whole = None if self._has_note else _single_run(events)
        return self._chunks(_parts(events)) if whole is None else (self._only_chunk(whole),)

    def _only_chunk(self, events: Sequence[Event] | EventBatch) -> BuiltChunk:
        """Return the chunk of a commit that is one run of events: most of a patrol's."""
        stamp = self._stamp
        start_ns = stamp.recorded_ns
        run, records, span = record_runs.run_of(
            events, record_runs.Start(stamp.first_event, start_ns), stamp.wall_clock_ns
        )
        assert isinstance(run, record_runs.Run)  # of one kind
        self._end_event, self._end_ns = stamp.first_event + run.count, start_ns + run.count
        digests = {run.channel: hashlib.sha256(records).digest()}
        record, self._hash = closing_record(stamp, self._end_event, self._end_ns, digests)
        return kept_template((run, _commit_run())).chunk(records + record, start_ns, span)

    def _chunks(self, parts: Iterable[Sequence[Event] | EventBatch]) -> Iterator[BuiltChunk]:
        """Yield the chunks of any commit."""
        open_chunk = ChunkBuilder(self._stamp.recorded_ns)
        digests: dict[int, Any] = {}
        for part in parts:
            rest = part
            while len(rest):
                if open_chunk.size >= CHUNK_BYTES:
                    open_chunk.hash_into(digests)
                    yield open_chunk.chunk()
                    open_chunk = ChunkBuilder(open_chunk.time)
                rest = self._fill(open_chunk, rest)
        if self._end_event == self._stamp.first_event:
            raise CommandError("a commit wants at least one event.")
        if self._has_note:
            record = self._note_record(open_chunk.time)
            open_chunk.add(record_runs.plain_run(NOTE_CHANNEL, 1, len(record)), record)
        open_chunk.hash_into(digests)
        yield self._last_chunk(open_chunk, {c: known.digest() for c, known in digests.items()})

    def _fill(
        self, open_chunk: ChunkBuilder, events: Sequence[Event] | EventBatch
    ) -> Sequence[Event] | EventBatch:
        """Add as many of these events as there is room for, at least one; return the others."""
        start = record_runs.Start(self._end_event, open_chunk.time)
        wall_ns = self._stamp.wall_clock_ns
        if not isinstance(events, EventBatch) and events[0].kind in OBJECT_KINDS:
            open_chunk.add(*self._object(events[0], start, wall_ns))
            self._end_event += 1
            return events[1:]
        fits, rest = record_runs.split_at(events, CHUNK_BYTES - open_chunk.size)
        open_chunk.add(*record_runs.run_of(fits, start, wall_ns))
        self._end_event += len(fits)
        return rest

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

    def _object(
        self, event: Event, start: record_runs.Start, wall_ns: int
    ) -> tuple[record_runs.Run, bytes, record_runs.Span]:
        """Return the run, the record and the span of an event with texts or arrays."""
        channel, happened = event.kind, event.happened_ns
        happened = wall_ns if happened is None else happened
        if isinstance(event, DoorAnnotated) and not event.salt:
            event = replace(event, salt=self._salt(start.event))
        elif isinstance(event, FloorMap):
            channel = FLOOR_MAP_CHANNEL + event.level
            self.levels.add(event.level)
        data = encode(event, happened)
        record = mcap.message(channel, start.event, start.recorded_ns, happened, data)
        if len(record) > MOST_EVENT_BYTES:
            expected = f"a record of at most {MOST_EVENT_BYTES} bytes"
            raise InvalidEventError(type(event).__name__, expected, len(record))
        counts_from = min(start.recorded_ns, happened)
        return record_runs.plain_run(channel, 1, len(record)), record, (counts_from, counts_from)

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

    def _last_chunk(self, open_chunk: ChunkBuilder, digests: dict[int, bytes]) -> BuiltChunk:
        """Return the chunk that closes the commit."""
        self._end_ns = open_chunk.time
        record, self._hash = closing_record(self._stamp, self._end_event, self._end_ns, digests)
        open_chunk.add(_commit_run(), record)
        return open_chunk.chunk()


def _single_run(events: Iterable[Event | EventBatch]) -> Sequence[Event] | EventBatch | None:
    """Return what is one run of events, no longer than a chunk; None: it is not."""
    if not isinstance(events, list) or not 0 < len(events) <= record_runs.MOST:
        return None
    first = events[0]
    if isinstance(first, EventBatch):
        is_one = len(events) == 1 and 0 < len(first) <= record_runs.MOST and len(first.columns) == 1
        return first if is_one and record_runs.is_columns(first) else None
    kinds = events.kinds if isinstance(events, ColumnarEvents) else set(map(type, events))
    return None if len(kinds) > 1 or first.kind in OBJECT_KINDS else events


def _parts(events: Iterable[Event | EventBatch]) -> Iterator[Sequence[Event] | EventBatch]:
    """Yield events that can be made records at once: of fixed sizes, or parts of batches.

    What has texts or maps comes one by one, and so do the events of a batch with such.
    """
    some: list[Event] = []
    for event in events:
        parts: Iterable[Sequence[Event] | EventBatch] = ()
        if isinstance(event, EventBatch):
            parts = _parts_of_batch(event)
        elif event.kind in OBJECT_KINDS:
            parts = ((event,),)
        else:
            some.append(event)
            if len(some) < record_runs.MOST:
                continue
        if some:
            yield some
            some = []
        yield from parts
    if some:
        yield some


def _parts_of_batch(batch: EventBatch) -> Iterator[Sequence[Event] | EventBatch]:
    for part in batch.parts(ROWS_AT_A_TIME):
        if len(part) and record_runs.is_columns(part):
            yield part
        else:
            yield from _parts(part.to_events())


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
