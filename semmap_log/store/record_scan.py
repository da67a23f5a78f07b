"""Where the message records of chunks begin: walked, or proved from what an index claims.

Also unpacks, in bounded memory, the records of chunks that anybody may have packed. A few kilobytes
of zstd can hold gigabytes. What honest chunks hold is known: messages that fill the chunk, each
later than the one before. So records that are packed more than `CLOSE_RATIO` times, as floor maps
and keyframes are, are checked while they are unpacked, a MiB at a time, and unpacking ends where
they are no such messages. The size of a chunk is limited, too, and so is the size of all chunks of
a segment.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from semmap_log.core.loops import compiled
from semmap_log.core.messages import CDR_HEADER
from semmap_log.core.texts import counted
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import EventFields

FREE_CHUNK_BYTES = 128 * 2**20
"""So much a chunk may hold, however few bytes it is packed in: the longest event and note, which
end a chunk, and what stands before them (below 2 MiB)."""
MOST_RATIO = 100
"""Beyond, only so many times its packed bytes: keyframes of a million doors are, packed sixteenfold
where these are all alike."""
MAX_CHUNK_BYTES = 2**30
"""And never more. A larger size is damage, and must not become an allocation."""

FREE_SEGMENT_BYTES = 2**30
"""So much all chunks of a segment may hold, however few bytes they are packed in."""
MOST_SEGMENT_RATIO = 4000
"""Beyond that, only so many times their packed bytes: an entirely unknown map is packed ten
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
    """Check that records are messages of a log, as far as their heads show.

    Args:
        pieces: The records; the next piece is requested when those before it are good.

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


class ChunkDamage(Exception):  # noqa: N818  # translated into CorruptLogError, which knows the file
    """A chunk is not what was written."""


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


def scan_by_index(
    file: memoryview | bytes,
    behind: NDArray[np.int64],
    records: bytes | memoryview,
    starts: NDArray[np.int64],
    ends: NDArray[np.int64],
) -> ScannedRecords:
    """Return where the messages of one or more chunks begin, at numpy's speed.

    Their MessageIndexes are only a hint. They have no CRC, so nothing in them is believed: what is
    taken is offsets at which messages begin that tile the records. If these do not, or there are
    none, the records are walked.

    Args:
        file: The file's bytes.
        behind: Where each Chunk record ends in it; its indexes follow there.
        records: What holds the chunks' records.
        starts: Where those of each chunk begin, ascending …
        ends: … and where they end.

    Raises:
        ChunkDamage: As `scan_together`.
    """
    found = (_columns_of_few if len(behind) <= _FEW else _columns_of_many)(file, behind, starts)
    offsets = np.sort(np.concatenate(found), kind="stable")  # which merges what is sorted already
    heads = _tile(records, offsets, starts, ends)
    if heads is not None:
        return ScannedRecords(offsets, heads)
    return ScannedRecords(scan_together(records, starts, ends))


def scan_one(file: memoryview | bytes, behind: int, records: bytes | memoryview) -> ScannedRecords:
    """Return the same of one chunk, whose records are at hand.

    Raises:
        ChunkDamage: As `scan_together`.
    """
    start, end = np.zeros(1, np.int64), np.array([len(records)])
    return scan_by_index(file, np.array([behind]), records, start, end)


def _columns_of_few(
    file: memoryview | bytes, behind: NDArray[np.int64], starts: NDArray[np.int64]
) -> list[NDArray[np.int64]]:
    """Return the offsets that each MessageIndex after these chunks states; they are not checked."""
    found = [np.empty(0, np.int64)]
    head, step = mcap.MESSAGE_INDEX_HEAD_BYTES, mcap.MESSAGE_INDEX_ENTRY_BYTES
    for at, start in zip(behind.tolist(), starts.tolist(), strict=True):
        for opcode, offset, length in frames(file, at, len(file)):
            if opcode != _MESSAGE_INDEX or length < head:
                break
            count = (length - head) // step
            if count:
                first = offset + head + _OFFSET_IN_ENTRY
                found.append(np.ndarray(count, np.int64, file, first, strides=(step,)) + start)
    return found


def _columns_of_many(
    file: memoryview | bytes, at: NDArray[np.int64], starts: NDArray[np.int64]
) -> list[NDArray[np.int64]]:
    """Return the same of many chunks: the first index of each at once, then the second."""
    found = [np.empty(0, np.int64)]
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
        within = np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)
        first = at + mcap.MESSAGE_INDEX_HEAD_BYTES + _OFFSET_IN_ENTRY
        places = np.repeat(first, counts) + within * mcap.MESSAGE_INDEX_ENTRY_BYTES
        found.append(gather(file, places, _INT)["value"] + np.repeat(starts, counts))
        at = ends[is_index]
    return found


_FEW = 8
"""So many chunks are faster one by one."""
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


def scan_together(
    records: bytes | memoryview, starts: NDArray[np.int64], ends: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return where the messages of many small chunks begin, ascending.

    All chunks are walked at once: the first message of each, then the second, and so on; what is
    left of few of them is walked one by one.

    Args:
        records: What holds the chunks' records.
        starts: Where each chunk's records begin in it.
        ends: Where they end; the message records of each tile the space between.

    Raises:
        ChunkDamage: They do not, or one is not a message.
    """
    found: list[NDArray[np.int64]] = []
    if (starts >= ends).any():
        raise ChunkDamage("a chunk without messages")
    at = starts
    while len(at) > _FEW:
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
    whole = memoryview(records)
    for start, end in zip(at.tolist(), ends.tolist(), strict=True):
        found.append(walk(whole[start:end]) + start)
    return np.sort(np.concatenate(found), kind="stable")  # which merges what is sorted already


_FRAME_DTYPE = np.dtype(
    {"names": ["opcode", "length"], "formats": ["u1", "<i8"], "offsets": [0, 1], "itemsize": 9}
)


def _tile(
    records: bytes | memoryview,
    offsets: NDArray[np.int64],
    starts: NDArray[np.int64],
    ends: NDArray[np.int64],
) -> NDArray[np.void] | None:
    """Return the heads of the messages at these ascending offsets, if they fill each start..end."""
    most = len(records) - mcap.MESSAGE.size
    if not len(offsets) or offsets[0] < 0 or offsets[-1] > most:
        return None
    firsts = np.searchsorted(offsets, starts)
    if firsts[0] or firsts[-1] >= len(offsets) or (offsets[firsts] != starts).any():
        return None
    lengths = np.empty_like(offsets)  # as they are if the messages fill the space
    np.subtract(offsets[1:], offsets[:-1], out=lengths[:-1])
    lengths[firsts[1:] - 1] = ends[:-1] - offsets[firsts[1:] - 1]
    lengths[-1] = ends[-1] - offsets[-1]
    lengths -= mcap.FRAME.size
    heads = heads_of(records, offsets)
    if lengths.min() < mcap.MESSAGE_BODY_HEAD or (heads["length"] != lengths.view("u8")).any():
        return None
    return heads if (heads["opcode"] == _MESSAGE).all() else None


class ScannedChunks(NamedTuple):
    """What is in each of some chunks; each has at least one message."""

    ends: NDArray[np.int64]
    """How many messages there are to its end."""
    kinds: NDArray[np.uint32]
    """Which kinds of record it holds: `pages`."""
    least_ns: NDArray[np.int64]
    """Its least log time …"""
    greatest_ns: NDArray[np.int64]
    """… and its greatest."""

    @classmethod
    def room_for(cls, count: int) -> ScannedChunks:
        """Return rows that somebody fills."""
        return cls(
            ends=np.empty(count, np.int64),
            kinds=np.empty(count, np.uint32),
            least_ns=np.empty(count, np.int64),
            greatest_ns=np.empty(count, np.int64),
        )


class ScannedRecords(NamedTuple):
    """What was found of some chunks' messages."""

    offsets: NDArray[np.int64]
    """Where each begins, ascending."""
    heads: NDArray[np.void] | None = None
    """Their fixed fields, where these had to be read for it."""
    chunks: ScannedChunks | None = None
    """What is in each chunk, where that was found with it."""
    events: EventFields | None = None
    """The events among them, where these were found with it, each of its kind's length."""


HEAD_DTYPE: np.dtype[np.void] = np.dtype(
    {
        "names": ["opcode", "length", "channel_id", "sequence", "log_time", "publish_time",
                  "door_id"],
        "formats": ["u1", "<u8", "<u2", "<u4", "<i8", "<i8", "<u4"],
        "offsets": [0, 1, 9, 11, 15, 23, mcap.MESSAGE.size + len(CDR_HEADER)],
        "itemsize": mcap.MESSAGE.size + len(CDR_HEADER) + 4,
    }
)  # fmt: skip
"""The fixed fields of a message record (`MESSAGE_DTYPE`), and the first four bytes of what it
carries: of an event of fixed size that is about a door, the door's id. Read with the rest they cost
nothing."""


def heads_of(records: bytes | memoryview, offsets: NDArray[np.int64]) -> NDArray[np.void]:
    """Return the heads of the message records at these ascending offsets, as `HEAD_DTYPE`."""
    if len(offsets):
        missing = int(offsets[-1]) + HEAD_DTYPE.itemsize - len(records)
        if missing > 0:  # the last one carries less
            records = bytes(records) + bytes(missing)
    return gather(records, offsets, HEAD_DTYPE)


def gather(
    records: bytes | memoryview, offsets: NDArray[np.int64], dtype: np.dtype[np.void]
) -> NDArray[np.void]:
    """Return the structs of that dtype which lie at these offsets, however unaligned."""
    # A view in which a struct begins at every byte: taking from it copies whole structs.
    places = max(0, len(records) - dtype.itemsize + 1)
    everywhere: NDArray[np.void] = np.ndarray(places, f"V{dtype.itemsize}", records, strides=(1,))
    return everywhere[offsets].view(dtype)


def gather_after(
    records: bytes | memoryview,
    offsets: NDArray[np.int64],
    ahead: int,
    places: NDArray[np.int64],
    dtype: np.dtype[np.void],
) -> NDArray[np.void]:
    """Return the structs of that dtype which lie so many bytes after some of these offsets.

    Args:
        records: What holds them.
        offsets: Where records begin.
        ahead: How far after that the structs lie.
        places: Of which records.
        dtype: Theirs.
    """
    loops = compiled()
    if loops is not None:
        found = np.empty(len(places), dtype)
        data = found.view(np.uint8)
        if loops.gather(records, offsets, ahead, places, dtype.itemsize, data):
            return found
    return gather(records, offsets[places] + ahead, dtype)


def frames(file: memoryview | bytes, start: int, end: int) -> Iterator[tuple[int, int, int]]:
    """Yield (opcode, offset, length with frame) of the records that lie whole in start..end."""
    at, frame, unpack = start, mcap.FRAME.size, mcap.FRAME.unpack_from
    while at + frame <= end:
        opcode, body = unpack(file, at)
        if at + frame + body > end:
            return
        yield opcode, at, frame + body
        at += frame + body
