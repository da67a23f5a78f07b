"""A chunk: from message records to the bytes in the file, and back, all lengths and CRC checked."""

from __future__ import annotations

import struct
import threading
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from mcap.opcode import Opcode
from mcap.records import ChunkIndex
from numpy.typing import NDArray

from semmap_log.log import records as mcap
from semmap_log.log.form import (
    COMPRESS_FROM_BYTES,
    FLOOR_MAP_CHANNEL,
    LAST_EVENT_CHANNEL,
    ZSTD_LEVEL,
)

_BODY = struct.Struct("<QQQI")
"""Start time, end time, uncompressed size, CRC: the head of a Chunk's body."""

MAX_CHUNK_BYTES = 2**30
"""No chunk of ours comes near; a larger size is damage, and must not become an allocation."""

MOST_NS = 2**63 - 1
"""Times are below: the year 2262."""

_local = threading.local()
"""zstd contexts: one a thread, since one shared by two threads crashes the process."""


class ChunkDamage(Exception):  # noqa: N818  # translated into CorruptLogError, which knows the file
    """A chunk is not what was written."""


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
    entries = np.column_stack((log_times, offsets)).astype("<u8")
    is_event = (channel_ids <= LAST_EVENT_CHANNEL) | (channel_ids >= FLOOR_MAP_CHANNEL)
    happened = np.minimum(heads["publish_time"], log_times)[is_event]
    return assemble_chunk(
        records,
        {c: entries[channel_ids == c].tobytes() for c in sorted(set(channel_ids.tolist()))},
        times=(int(log_times.min()), int(log_times.max())),
        happened=(int(happened.min()), int(happened.max())) if len(happened) else NO_SPAN,
        compression=compression,
    )


def assemble_chunk(
    records: bytes,
    index: Mapping[int, bytes],
    *,
    times: tuple[int, int],
    happened: tuple[int, int],
    compression: str | None = None,
) -> BuiltChunk:
    """Return the chunk of message records about which everything is known.

    Args:
        records: Message records, one after the other.
        index: Channel id -> entries of its MessageIndex, ids ascending.
        times: Least and greatest log time.
        happened: Least and greatest happened time of its events.
        compression: "" or "zstd"; default: zstd where the records are long.
    """
    if compression is None:
        compression = "zstd" if len(records) >= COMPRESS_FROM_BYTES else ""
    stored = _compress(records) if compression else records
    head = mcap.chunk_head(
        stored_size=len(stored),
        size=len(records),
        compression=compression,
        crc=zlib.crc32(records),
        start=times[0],
        end=times[1],
    )
    parts = [head, stored]
    counts: dict[int, int] = {}
    for channel_id, entries in index.items():
        parts += (mcap.message_index_head(channel_id, len(entries)), entries)
        counts[channel_id] = len(entries) // mcap.MESSAGE_INDEX_ENTRY_BYTES
    facts = ChunkFacts(
        len(head) + len(stored), compression, len(stored), len(records), times, happened, counts
    )
    return BuiltChunk(records, b"".join(parts), facts)


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

    def records(self, file: memoryview | bytes) -> bytes | memoryview:
        """Return its records, CRC checked.

        Raises:
            ChunkDamage: They are not what was written.
        """
        stored = memoryview(file)[self.data_offset : self.data_offset + self.stored_size]
        if self.compression == "":
            plain: bytes | memoryview = stored
        elif self.compression == "zstd":
            plain = _decompress_zstd(stored, self.size)
        elif self.compression == "lz4":
            plain = _decompress_lz4(stored)
        else:
            raise ChunkDamage(f"unknown compression {self.compression!r}")
        if len(plain) != self.size:
            raise ChunkDamage(f"expected {self.size} bytes of records, got {len(plain)}")
        check_crc(plain, self.crc)
        return plain


def check_crc(records: bytes | memoryview, crc: int) -> None:
    """Check a chunk's records against its CRC, which ours always have: 0 is no exception.

    Raises:
        ChunkDamage: They do not fit.
    """
    if zlib.crc32(records) != crc:
        raise ChunkDamage(crc_problem(records, crc))


def crc_problem(records: bytes | memoryview, crc: int) -> str:
    """Say what is wrong with records that do not fit their CRC."""
    return f"its CRC says {crc:08x}, its bytes {zlib.crc32(records):08x}"


def read_chunk_head(file: memoryview | bytes, offset: int, length: int) -> StoredChunk:
    """Return the Chunk whose record lies at `offset`.

    Args:
        file: The file's bytes.
        offset: Where the record begins.
        length: Bytes of the record, frame included, all of them in the file.

    Raises:
        ChunkDamage: Its lengths contradict each other.
    """
    at = offset + mcap.FRAME.size
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
    if at + 8 + stored_size != offset + length:
        raise ChunkDamage(f"{stored_size} stored bytes do not fit a record of {length}")
    if size > MAX_CHUNK_BYTES:
        raise ChunkDamage(f"{size} bytes of records are more than any chunk has")
    return StoredChunk(offset, length, start, end, size, crc, compression, at + 8, stored_size)


def walk(records: bytes | memoryview) -> NDArray[np.int64]:
    """Return where each message record begins; the records tile the whole.

    Raises:
        ChunkDamage: They do not, or one is not a message.
    """
    offsets = []
    at, end = 0, len(records)
    frame, unpack, least = mcap.FRAME.size, mcap.FRAME.unpack_from, mcap.MESSAGE_BODY_HEAD
    while at < end:
        if at + frame > end:
            raise ChunkDamage(f"a record is cut at byte {at} of the chunk's records")
        opcode, length = unpack(records, at)
        if opcode != Opcode.MESSAGE or length < least:
            raise ChunkDamage(f"no message at byte {at} of the chunk's records")
        offsets.append(at)
        at += frame + length
    if at != end:
        raise ChunkDamage(f"the last record ends at byte {at} of {end}")
    return np.array(offsets, np.int64)


def walk_by_index(
    file: memoryview | bytes,
    behind: NDArray[np.int64],
    records: bytes | memoryview,
    starts: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Return where the messages of one or more chunks begin, at numpy's speed.

    Their MessageIndexes are only a hint. They have no CRC, so nothing in them is believed: what is
    taken is offsets at which messages begin that tile the records. If these do not, or there are
    none, the records are walked.

    Args:
        file: The file's bytes.
        behind: Where each Chunk record ends in it; its indexes follow there.
        records: What holds the chunks' records, one behind the other.
        starts: Where those of each chunk begin.

    Raises:
        ChunkDamage: As `walk_together`.
    """
    offsets = _indexed_offsets(file, behind, starts)
    if _tile(records, offsets):
        return offsets
    return walk_together(records, starts, np.append(starts[1:], len(records)))


def _indexed_offsets(
    file: memoryview | bytes, at: NDArray[np.int64], starts: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return what the MessageIndexes behind some chunks say, ascending; whatever it is worth.

    The first index of each chunk is read at once, then the second, and so on.
    """
    found: list[NDArray[np.int64]] = []
    for _ in range(_MOST_CHANNELS):
        is_here = at + mcap.MESSAGE_INDEX_HEAD_BYTES <= len(file)
        at, starts = at[is_here], starts[is_here]
        head = gather(file, at, _INDEX_DTYPE)
        size = head["length"] - _INDEX_BODY_HEAD
        ends = at + mcap.MESSAGE_INDEX_HEAD_BYTES + size
        is_index = (head["opcode"] == _MESSAGE_INDEX) & (size >= 0) & (ends <= len(file))
        at, starts, size = at[is_index], starts[is_index], size[is_index]
        counts = size // mcap.MESSAGE_INDEX_ENTRY_BYTES
        if not len(at) or int(counts.sum()) > len(file):
            break
        first = at + mcap.MESSAGE_INDEX_HEAD_BYTES + _OFFSET_IN_ENTRY
        found.append(_spread(file, first, counts) + np.repeat(starts, counts))
        at = ends[is_index]
    return np.sort(np.concatenate(found)) if found else np.empty(0, np.int64)


def _spread(
    file: memoryview | bytes, first: NDArray[np.int64], counts: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the integers of several columns of MessageIndex entries, one behind the other."""
    if len(first) == 1:
        (start,), (count,) = first.tolist(), counts.tolist()
        step = mcap.MESSAGE_INDEX_ENTRY_BYTES
        column: NDArray[np.int64] = np.ndarray(count, "<i8", file, start, strides=(step,))
        return column
    within = np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)
    places = np.repeat(first, counts) + within * mcap.MESSAGE_INDEX_ENTRY_BYTES
    return gather(file, places, _INT)["value"]


_INT: np.dtype[np.void] = np.dtype([("value", "<i8")])
_INDEX_DTYPE: np.dtype[np.void] = np.dtype(
    {"names": ["opcode", "length"], "formats": ["u1", "<i8"], "offsets": [0, 1],
     "itemsize": mcap.MESSAGE_INDEX_HEAD_BYTES}
)  # fmt: skip
_MOST_CHANNELS = 256
"""In a chunk; one with more is walked."""
_INDEX_BODY_HEAD = mcap.MESSAGE_INDEX_HEAD_BYTES - mcap.FRAME.size
_OFFSET_IN_ENTRY = 8
_MESSAGE_INDEX = int(Opcode.MESSAGE_INDEX)
_MESSAGE = int(Opcode.MESSAGE)


def walk_together(
    records: bytes | memoryview, starts: NDArray[np.int64], ends: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return where the messages of many small chunks begin, ascending.

    All chunks are walked at once: the first message of each, then the second, and so on.

    Args:
        records: What holds the chunks' records.
        starts: Where each chunk's records begin in it.
        ends: Where they end; the message records of each tile the space between.

    Raises:
        ChunkDamage: They do not, or one is not a message.
    """
    found: list[NDArray[np.int64]] = []
    at = starts
    while len(at):
        if (at + mcap.MESSAGE.size > ends).any():
            raise ChunkDamage("the last record of a chunk is cut")
        frame = gather(records, at, _FRAME_DTYPE)
        length = frame["length"]
        is_message = (frame["opcode"] == _MESSAGE) & (length >= mcap.MESSAGE_BODY_HEAD)
        if not is_message.all() or (length > ends - at).any():
            raise ChunkDamage("no message where one must begin, or one that is cut")
        found.append(at)
        at = at + mcap.FRAME.size + length
        at, ends = at[at != ends], ends[at != ends]
    return np.sort(np.concatenate(found)) if found else np.empty(0, np.int64)


_FRAME_DTYPE = np.dtype(
    {"names": ["opcode", "length"], "formats": ["u1", "<i8"], "offsets": [0, 1], "itemsize": 9}
)


def _tile(records: bytes | memoryview, offsets: NDArray[np.int64]) -> bool:
    """Tell whether messages begin at these ascending offsets, one behind the other, to the end."""
    end = len(records)
    if not len(offsets) or offsets[0] != 0 or offsets[-1] > end - mcap.MESSAGE.size:
        return False
    heads = heads_of(records, offsets)
    ends = offsets + mcap.FRAME.size + heads["length"].astype(np.int64)
    return bool(
        (heads["opcode"] == _MESSAGE).all()
        and (heads["length"] >= mcap.MESSAGE_BODY_HEAD).all()
        and (ends[:-1] == offsets[1:]).all()
        and ends[-1] == end
    )


def heads_of(records: bytes | memoryview, offsets: NDArray[np.int64]) -> NDArray[np.void]:
    """Return the fixed fields of the message records at these offsets, as MESSAGE_DTYPE."""
    return gather(records, offsets, mcap.MESSAGE_DTYPE)


def gather(
    records: bytes | memoryview, offsets: NDArray[np.int64], dtype: np.dtype[np.void]
) -> NDArray[np.void]:
    """Return the structs of that dtype which lie at these offsets, however unaligned."""
    # A view in which a struct begins at every byte: taking from it copies whole structs.
    places = max(0, len(records) - dtype.itemsize + 1)
    everywhere: NDArray[np.void] = np.ndarray(places, f"V{dtype.itemsize}", records, strides=(1,))
    return everywhere[offsets].view(dtype)


def frames(file: memoryview | bytes, start: int, end: int) -> Iterator[tuple[int, int, int]]:
    """Yield (opcode, offset, length with frame) of the records that lie whole in start..end."""
    at, frame, unpack = start, mcap.FRAME.size, mcap.FRAME.unpack_from
    while at + frame <= end:
        opcode, body = unpack(file, at)
        if at + frame + body > end:
            return
        yield opcode, at, frame + body
        at += frame + body


def _compress(records: bytes) -> bytes:
    import zstandard

    if not hasattr(_local, "compressor"):
        _local.compressor = zstandard.ZstdCompressor(level=ZSTD_LEVEL)
    return bytes(_local.compressor.compress(records))


def _decompress_zstd(stored: memoryview, size: int) -> bytes:
    import zstandard

    if not hasattr(_local, "decompressor"):
        _local.decompressor = zstandard.ZstdDecompressor()
    try:
        if zstandard.frame_content_size(stored) != size:  # or it would become an allocation
            raise ChunkDamage(f"its zstd frame does not hold {size} bytes")
        return bytes(_local.decompressor.decompress(stored, max_output_size=size))
    except zstandard.ZstdError as error:
        raise ChunkDamage(f"zstd: {error}") from error


def _decompress_lz4(stored: memoryview) -> bytes:
    import lz4.frame

    try:
        return bytes(lz4.frame.decompress(bytes(stored)))
    except RuntimeError as error:
        raise ChunkDamage(f"lz4: {error}") from error
