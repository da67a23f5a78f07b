"""One chunk, examined: everything in it that can be told without its neighbours.

Here nothing is believed: the messages must tile the records, the CRC must fit even where it says
zero, and what stands around them (times, MessageIndex records) is computed from them anew.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass

from mcap.opcode import Opcode
from mcap.records import ChunkIndex

from semmap_log.core.io.checksum import crc32
from semmap_log.store import records as mcap
from semmap_log.store.chunk_unpacking import unpack_records
from semmap_log.store.chunks import NO_SPAN, StoredChunk, read_chunk_head
from semmap_log.store.form import FLOOR_MAP_CHANNEL, LAST_EVENT_CHANNEL, ZSTD_LEVEL
from semmap_log.store.record_scan import ChunkDamage
from semmap_log.store.verification.file_bytes import WINDOW_BYTES, FileBytes

Message = tuple[int, int, int, int, int, int]
"""Channel, sequence, log time, publish time, start and end in the chunk's records."""

_CHUNK_HEAD = re.compile(
    rb"\x06.{4}\0{4}"  # opcode; a length below 2^32
    rb".{16}.{4}\0{4}"  # start and end time; a size below 2^32
    rb".{4}(?:\0{4}|\x04\0{3}zstd)"  # CRC; the compression's name
    rb".{4}\0{4}",  # a stored size below 2^32
    re.DOTALL,
)
_MOST_HEAD_BYTES = 64
"""No such head is longer."""
_TIMES_END = 2**63  # times are handled as int64


@dataclass(frozen=True, slots=True)
class Piece:
    """A chunk whose messages are as they were written, as far as its CRC can tell."""

    stored: StoredChunk
    records: bytes | memoryview
    messages: list[Message]
    index: bytes
    """The MessageIndex records that must follow it."""
    index_offsets: dict[int, int]
    """Channel id -> where its MessageIndex must begin, counted from the chunk's start."""
    counts: dict[int, int]
    """Channel id -> messages."""
    times: tuple[int, int]
    """Least and greatest log time of its messages."""
    happened: tuple[int, int]
    """The same of its events' happened times; `NO_SPAN` if it has no event."""

    @property
    def end(self) -> int:
        """Where in the file its MessageIndex records begin."""
        return self.stored.offset + self.stored.length

    @property
    def levels(self) -> list[int]:
        """The levels whose floor map is in it, ascending."""
        return [c - FLOOR_MAP_CHANNEL for c in self.counts if c >= FLOOR_MAP_CHANNEL]

    def is_compressed_as_usual(self, file: FileBytes) -> bool:
        """Tell whether its stored bytes are those that this zstd makes of its records.

        Some bits of a zstd frame mean nothing; only a closed segment's data CRC covers them.
        """
        import zstandard

        stored = self.stored
        if stored.compression != "zstd":
            return True
        usual = zstandard.ZstdCompressor(level=ZSTD_LEVEL).compress(self.records)
        return bool(file[stored.data_offset : stored.data_offset + stored.stored_size] == usual)

    def chunk_index(self) -> ChunkIndex:
        """Return what the summary must say of it."""
        stored = self.stored
        return ChunkIndex(
            chunk_length=stored.length,
            chunk_start_offset=stored.offset,
            compression=stored.compression,
            compressed_size=stored.stored_size,
            message_end_time=self.times[1],
            message_index_length=len(self.index),
            message_index_offsets={c: stored.offset + at for c, at in self.index_offsets.items()},
            message_start_time=self.times[0],
            uncompressed_size=stored.size,
        )


def examine(file: FileBytes, offset: int, length: int) -> Piece:
    """Return the chunk whose record lies at `offset`.

    Args:
        file: The file's bytes.
        offset: Where the record begins.
        length: Bytes of the record, frame included.

    Raises:
        ChunkDamage: It is not as it was written.
    """
    if offset + length > len(file):
        raise ChunkDamage("a chunk that ends behind the file's end")
    try:
        data = file[offset : offset + length]
        stored = read_chunk_head(data, offset, length, offset)
    except struct.error:
        raise ChunkDamage("a chunk whose head does not fit into it") from None
    records = _records(data, stored)
    if crc32(records) != stored.crc:
        raise ChunkDamage(f"its CRC says {stored.crc:08x}, its bytes {crc32(records):08x}")
    messages = _messages(records)
    if not messages:
        raise ChunkDamage("a chunk without messages")
    log_times = [m[2] for m in messages]
    happened = [
        min(m[2], m[3]) for m in messages if m[0] <= LAST_EVENT_CHANNEL or m[0] >= FLOOR_MAP_CHANNEL
    ]
    entries: dict[int, list[int]] = {}
    for channel, _, log_time, _, start, _ in messages:
        entries.setdefault(channel, []).extend((log_time, start))
    index, offsets = _message_indexes(entries, length)
    return Piece(
        stored=stored,
        records=records,
        messages=messages,
        index=index,
        index_offsets=offsets,
        counts={channel: len(entries[channel]) // 2 for channel in sorted(entries)},
        times=(min(log_times), max(log_times)),
        happened=(min(happened), max(happened)) if happened else NO_SPAN,
    )


def find_piece(file: FileBytes, start: int, end: int) -> Piece | None:
    """Return the next whole chunk that begins in start..end, found by its bytes alone."""
    while start < end:
        window = file[start : min(start + WINDOW_BYTES, end)]
        for at in _heads_in(window):
            length = mcap.FRAME.size + mcap.FRAME.unpack_from(window, at)[1]
            if start + at + length <= end:
                try:
                    return examine(file, start + at, length)
                except ChunkDamage:
                    pass
        start += max(1, len(window) - _MOST_HEAD_BYTES)  # a head may lie across the window's end
    return None


def _heads_in(data: memoryview) -> Iterator[int]:
    """Yield where what looks like a chunk's head begins, overlapping ones, too."""
    found = _CHUNK_HEAD.search(data)
    while found is not None:
        yield found.start()
        found = _CHUNK_HEAD.search(data, found.start() + 1)


def _records(record: memoryview, stored: StoredChunk) -> bytes | memoryview:
    if stored.compression not in ("", "zstd"):
        raise ChunkDamage(f"unknown compression {stored.compression!r}")
    start = stored.data_offset - stored.offset
    data = record[start : start + stored.stored_size]
    return unpack_records(data, stored.compression, stored.size)


def _messages(records: bytes | memoryview) -> list[Message]:
    """Return the messages of a chunk; they tile its records."""
    found = []
    at, end = 0, len(records)
    size, least, unpack = mcap.MESSAGE.size, mcap.MESSAGE_BODY_HEAD, mcap.MESSAGE.unpack_from
    while at < end:
        if at + size > end:
            raise ChunkDamage(f"a record is cut at byte {at} of the chunk's records")
        opcode, length, channel, sequence, log_time, publish_time = unpack(records, at)
        if opcode != Opcode.MESSAGE or length < least:
            raise ChunkDamage(f"no message at byte {at} of the chunk's records")
        if log_time >= _TIMES_END or publish_time >= _TIMES_END:
            raise ChunkDamage(f"a time beyond the year 2262 at byte {at} of the chunk's records")
        behind = at + mcap.FRAME.size + length
        found.append((channel, sequence, log_time, publish_time, at, behind))
        at = behind
    if at != end:
        raise ChunkDamage(f"the last record ends at byte {at} of {end}")
    return found


def _message_indexes(entries: dict[int, list[int]], start: int) -> tuple[bytes, dict[int, int]]:
    """Return the MessageIndex records of a chunk, and where each lies when they begin at start."""
    parts: list[bytes] = []
    offsets: dict[int, int] = {}
    for channel in sorted(entries):
        values = entries[channel]
        offsets[channel] = start
        packed = struct.pack(f"<{len(values)}Q", *values)
        parts += (mcap.message_index_head(channel, len(packed)), packed)
        start += mcap.MESSAGE_INDEX_HEAD_BYTES + len(packed)
    return b"".join(parts), offsets
