"""A chunk: from message records to the bytes in the file, and back, all lengths and CRC checked."""

from __future__ import annotations

import struct
import threading
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.io.checksum import crc32
from semmap_log.store import byte_layout
from semmap_log.store import records as mcap
from semmap_log.store.record_scan import (
    FREE_CHUNK_BYTES,
    MAX_CHUNK_BYTES,
    MOST_RATIO,
    ChunkDamage,
    heads_of,
    most_unpacked,
    unpack_records,
)

if TYPE_CHECKING:
    from mcap.records import ChunkIndex

_BODY = struct.Struct("<QQQI")
"""Start time, end time, uncompressed size, CRC: the head of a Chunk's body."""

MOST_NS = 2**63 - 1
"""Times are below: the year 2262."""

_local = threading.local()
"""zstd contexts: one a thread, as in `unpacking`."""


@dataclass(slots=True)
class ChunkFacts:
    """What a segment's summary says of a chunk; made for every append, so it is kept small."""

    chunk_length: int
    """Bytes of the Chunk record; the indexes follow it."""
    compression: str
    stored_size: int
    size: int
    times: tuple[int, int]
    """Least and greatest log time."""
    happened: tuple[int, int]
    """Of its events, recorded time where that is earlier; `NO_SPAN` if it has none."""
    counts: dict[int, int]
    """Channel id -> messages, ids ascending: the order of the indexes."""

    def index_at(self, offset: int) -> ChunkIndex:
        """Return the summary's ChunkIndex for this chunk at that place in the file."""
        from mcap.records import ChunkIndex

        at = offset + self.chunk_length
        index_offsets: dict[int, int] = {}
        for channel, count in self.counts.items():
            index_offsets[channel] = at
            at += mcap.MESSAGE_INDEX_HEAD_BYTES + count * mcap.MESSAGE_INDEX_ENTRY_BYTES
        return ChunkIndex(
            chunk_length=self.chunk_length,
            chunk_start_offset=offset,
            compression=self.compression,
            compressed_size=self.stored_size,
            message_end_time=self.times[1],
            message_index_length=at - offset - self.chunk_length,
            message_index_offsets=index_offsets,
            message_start_time=self.times[0],
            uncompressed_size=self.size,
        )


@dataclass(slots=True)
class BuiltChunk:
    """A Chunk record with its MessageIndex records."""

    records: bytes
    """The message records, as they are."""
    data: bytes
    """The bytes for the file."""
    facts: ChunkFacts
    offsets: NDArray[np.int64] | None = field(default=None, compare=False)
    """Where each record begins, if whoever built it knows: others must walk."""
    commit_at: int = field(default=-1, compare=False)
    """Where its only Commit begins, if whoever built it knows; -1: not known, or there is none."""


NO_SPAN = (-1, -1)
"""The span of happened times of a chunk without events."""


def build_chunk(
    records: bytes, offsets: NDArray[np.int64], *, compression: str | None = None
) -> BuiltChunk:
    """Return the chunk of these message records.

    Args:
        records: Message records, one after the other.
        offsets: Where each begins.
        compression: "" or "zstd"; default: zstd where the records are long.
    """
    heads = heads_of(records, offsets)
    log_times, channel_ids = heads["log_time"], heads["channel_id"]
    is_event = (channel_ids <= byte_layout.LAST_EVENT_CHANNEL) | (
        channel_ids >= byte_layout.FLOOR_MAP_CHANNEL
    )
    happened = np.minimum(heads["publish_time"], log_times)[is_event]
    index, counts = message_indexes(channel_ids, log_times, offsets)
    return assemble_chunk(
        records,
        index,
        counts,
        times=(int(log_times.min()), int(log_times.max())),
        happened=(int(happened.min()), int(happened.max())) if len(happened) else NO_SPAN,
        compression=compression,
    )


def message_indexes(
    channel_ids: NDArray[np.uint16], log_times: NDArray[np.int64], offsets: NDArray[np.int64]
) -> tuple[bytes, dict[int, int]]:
    """Return the bytes of a chunk's MessageIndex records, and channel id -> messages.

    Args:
        channel_ids: Of each message.
        log_times: When it was recorded.
        offsets: Where it begins.
    """
    entries = np.empty((len(offsets), 2), "<i8")
    entries[:, 0], entries[:, 1] = log_times, offsets
    messages = np.bincount(channel_ids)
    counts = {channel: int(messages[channel]) for channel in np.flatnonzero(messages).tolist()}
    parts: list[bytes] = []
    for channel, count in counts.items():
        its = entries if count == len(entries) else entries[channel_ids == channel]
        parts += (mcap.message_index_head(channel, its.nbytes), its.tobytes())
    return b"".join(parts), counts


def assemble_chunk(
    records: bytes,
    index: bytes,
    counts: dict[int, int],
    *,
    times: tuple[int, int],
    happened: tuple[int, int],
    compression: str | None = None,
) -> BuiltChunk:
    """Return the chunk of message records about which everything is known.

    Args:
        records: Message records, one after the other.
        index: The bytes of its MessageIndex records, channel ids ascending.
        counts: Channel id -> messages, ids ascending.
        times: Least and greatest log time.
        happened: Least and greatest happened time of its events.
        compression: "" or "zstd"; default: zstd where the records are long.
    """
    size = len(records)
    if compression is None:
        compression = "zstd" if size >= byte_layout.COMPRESS_FROM_BYTES else ""
    stored = _compress(records) if compression else records
    head = mcap.chunk_head(
        stored_size=len(stored),
        size=size,
        compression=compression,
        crc=crc32(records),
        start=times[0],
        end=times[1],
    )
    facts = ChunkFacts(
        len(head) + len(stored), compression, len(stored), size, times, happened, counts
    )
    return BuiltChunk(records, b"".join((head, stored, index)), facts)


@dataclass(frozen=True, slots=True)
class StoredChunk:
    """A Chunk record in a file, its head read but not yet believed."""

    offset: int
    """Of the record in the file."""
    length: int
    """Of the record, frame included."""
    start_ns: int
    end_ns: int
    size: int
    crc: int
    compression: str
    data_offset: int
    """Of the stored records in the file."""
    stored_size: int

    def records(
        self, file: memoryview | bytes, base: int = 0, into: memoryview | None = None
    ) -> bytes | memoryview:
        """Return its records, CRC checked.

        Args:
            file: The file's bytes, or some of them.
            base: Where in the file these begin.
            into: Memory of their size, which is filled with them; None: they lie anywhere.

        Raises:
            ChunkDamage: They are not what was written.
        """
        start = self.data_offset - base
        stored = memoryview(file)[start : start + self.stored_size]
        plain = unpack_records(stored, self.compression, self.size, into)
        check_crc(plain, self.crc)
        return plain


def check_crc(records: bytes | memoryview, crc: int) -> None:
    """Check a chunk's records against its CRC, which ours always have: 0 is no exception.

    Raises:
        ChunkDamage: They do not fit.
    """
    if crc32(records) != crc:
        raise ChunkDamage(crc_problem(records, crc))


def crc_problem(records: bytes | memoryview, crc: int) -> str:
    """Say what is wrong with records that do not fit their CRC."""
    return f"its CRC says {crc:08x}, its bytes {crc32(records):08x}"


MOST_HEAD_BYTES = mcap.FRAME.size + _BODY.size + 4 + 16 + 8
"""A Chunk record's bytes before its stored ones are no more."""


def read_chunk_head(
    file: memoryview | bytes, offset: int, length: int, base: int = 0
) -> StoredChunk:
    """Return the Chunk whose record lies at `offset` of the file.

    Args:
        file: The file's bytes, or some of them, with the record's first `MOST_HEAD_BYTES`.
        offset: Where the record begins in the file.
        length: Bytes of the record, frame included, all of them in the file.
        base: Where in the file the bytes begin.

    Raises:
        ChunkDamage: Its lengths contradict each other.
    """
    at = offset - base + mcap.FRAME.size
    if length < mcap.FRAME.size + _BODY.size + 12:
        raise ChunkDamage(f"a chunk of {length} bytes has no head")
    start, end, size, crc = _BODY.unpack_from(file, at)
    at += _BODY.size
    (name_length,) = struct.unpack_from("<I", file, at)
    if name_length > min(16, length - mcap.FRAME.size - _BODY.size - 12):
        raise ChunkDamage(f"a compression's name of {name_length} bytes")
    if not start <= end <= MOST_NS:
        raise ChunkDamage(f"its messages end at {end} ns, and start at {start}")
    compression = bytes(file[at + 4 : at + 4 + name_length]).decode("ascii", "replace")
    at += 4 + name_length
    (stored_size,) = struct.unpack_from("<Q", file, at)
    if at + 8 + stored_size != offset - base + length:
        raise ChunkDamage(f"{stored_size} stored bytes do not fit a record of {length}")
    if size > most_unpacked(stored_size):
        raise ChunkDamage(
            f"{size} bytes of records in {stored_size} are more than any chunk has "
            f"({FREE_CHUNK_BYTES}, or {MOST_RATIO} times as many, at most {MAX_CHUNK_BYTES})"
        )
    data_offset = base + at + 8
    return StoredChunk(offset, length, start, end, size, crc, compression, data_offset, stored_size)


def _compress(records: bytes) -> bytes:
    import zstandard

    if not hasattr(_local, "compressor"):
        _local.compressor = zstandard.ZstdCompressor(level=byte_layout.ZSTD_LEVEL)
    return bytes(_local.compressor.compress(records))
