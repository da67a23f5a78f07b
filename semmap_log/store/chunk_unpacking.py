"""The records of chunks that anybody may have packed, unpacked in bounded memory.

A few kilobytes of zstd can hold gigabytes. What honest chunks hold is known: messages that fill it,
each later than the one before. So records that are packed more than `CLOSE_RATIO` times, as floor
maps and keyframes are, are looked at while they are unpacked, a MiB at a time, and unpacking ends
where they are no such messages. How much a chunk may hold is limited, too, and how much all chunks
of a segment may.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator

from mcap.opcode import Opcode

from semmap_log.core.texts import counted
from semmap_log.store import records as mcap
from semmap_log.store.record_scan import ChunkDamage

FREE_CHUNK_BYTES = 128 * 2**20
"""So much a chunk may hold however few bytes it is packed in: the longest event and note, behind
which a chunk ends, and what stands before them (below 2 MiB)."""
MOST_RATIO = 100
"""Beyond, only so many times its packed bytes: keyframes of a million doors are, packed sixteenfold
where these are all alike."""
MAX_CHUNK_BYTES = 2**30
"""And never more. A larger size is damage, and must not become an allocation."""

FREE_SEGMENT_BYTES = 2**30
"""So much all chunks of a segment may hold, however few bytes they are packed in."""
MOST_SEGMENT_RATIO = 4000
"""Beyond, only so many times their packed bytes: a map of which nothing is known yet is packed ten
thousand times, one of a few rooms a thousand times."""

CLOSE_RATIO = 64
"""Sightings and poses, whose times differ, are never packed so many times."""
PIECE_BYTES = 2**20
MOST_AT_ONCE = 1000
"""Messages of a chunk whose time is not after that of the one before: a keyframe's may be the same,
and there are few in a chunk."""

_local = threading.local()
"""zstd contexts: one a thread, since one shared by two threads crashes the process."""


def most_unpacked(stored_size: int) -> int:
    """Return how many bytes of records a chunk of so many stored bytes may hold."""
    return min(MAX_CHUNK_BYTES, max(FREE_CHUNK_BYTES, MOST_RATIO * stored_size))


def check_sizes(size: int, stored_size: int) -> None:
    """Check what all chunks of a segment say that they hold, before any of it is unpacked.

    Raises:
        ChunkDamage: More than those of any segment do.
    """
    most = max(FREE_SEGMENT_BYTES, MOST_SEGMENT_RATIO * stored_size)
    if size > most:
        raise ChunkDamage(
            f"expected chunks that hold at most {most} bytes together ({FREE_SEGMENT_BYTES}, or "
            f"{MOST_SEGMENT_RATIO} times the {stored_size} that they are packed in), got {size}"
        )


def unpack_records(
    stored: memoryview, compression: str, size: int, into: memoryview | None = None
) -> bytes | memoryview:
    """Return the records of a chunk; their CRC is not checked.

    Args:
        stored: As they are stored.
        compression: "", zstd or lz4.
        size: So many bytes there must be.
        into: Memory of that size, which is filled with them; None: they lie anywhere.

    Raises:
        ChunkDamage: They are others, no messages, or of no such packing.
    """
    if compression == "":
        plain: bytes | memoryview = stored
    elif compression == "zstd":
        plain = _records_in_zstd(stored, size, into)
    elif compression == "lz4":
        plain = _records_in_lz4(stored, size)
    else:
        raise ChunkDamage(f"unknown compression {compression!r}")
    if len(plain) != size:
        raise ChunkDamage(f"expected {size} bytes of records, got {len(plain)}")
    if into is not None and plain is not into:
        into[:] = plain
        return into
    return plain


def _records_in_zstd(stored: memoryview, size: int, into: memoryview | None) -> bytes | memoryview:
    """Return what it holds, which is in that memory then, if any is given."""
    import zstandard

    if not hasattr(_local, "decompressor"):
        _local.decompressor = zstandard.ZstdDecompressor()
    try:
        if zstandard.frame_content_size(stored) != size:  # or it would become an allocation
            raise ChunkDamage(f"its zstd frame does not hold {size} bytes")
        if size > CLOSE_RATIO * len(stored):
            _check_messages(_pieces(stored))
        if into is None:
            return bytes(_local.decompressor.decompress(stored, max_output_size=size))
        with _local.decompressor.stream_reader(stored) as unpacked:
            got = unpacked.readinto(into)
    except (zstandard.ZstdError, MemoryError) as error:
        raise ChunkDamage(f"zstd: {error}") from error
    return into if got == size else into[:got]


def _pieces(stored: memoryview) -> Iterator[bytes]:
    """Yield what a zstd frame holds, piece by piece."""
    import zstandard

    # One of its own, which lets go of the memory in which it looks back.
    with zstandard.ZstdDecompressor().stream_reader(stored) as unpacked:
        while piece := unpacked.read(PIECE_BYTES):
            yield piece


def _records_in_lz4(stored: memoryview, size: int) -> bytes:
    """Return what it holds; if that is more than it should be, one byte more."""
    import lz4.frame

    try:
        unpacker = lz4.frame.LZ4FrameDecompressor()
        unpacked = bytes(unpacker.decompress(bytes(stored), max_length=size + 1))
    except (RuntimeError, MemoryError) as error:
        raise ChunkDamage(f"lz4: {error}") from error
    if size > CLOSE_RATIO * len(stored):
        _check_messages([unpacked])
    return unpacked


def _check_messages(pieces: Iterable[bytes]) -> None:
    """Check that records are messages of a log, as far as their heads tell.

    Args:
        pieces: The records; the next one is asked for when those before it are good.

    Raises:
        ChunkDamage: One is no message, or many have the same time.
    """
    unpack, size, least = mcap.MESSAGE.unpack_from, mcap.MESSAGE.size, mcap.MESSAGE_BODY_HEAD
    reached = at = not_after = 0
    last_ns, begun = -1, b""
    for piece in pieces:
        data = begun + piece if begun else piece
        start, reached = reached - len(begun), reached + len(piece)
        while at + size <= reached:
            opcode, length, _, _, log_ns, _ = unpack(data, at - start)
            if opcode != Opcode.MESSAGE or length < least:
                raise ChunkDamage(f"no message at byte {at} of the chunk's records")
            not_after += log_ns <= last_ns
            if not_after > MOST_AT_ONCE:
                raise ChunkDamage(f"{counted(not_after, 'message')} not after the one before")
            last_ns, at = log_ns, at + mcap.FRAME.size + length
        begun = data[at - start :]  # of a head, or nothing
