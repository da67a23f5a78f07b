"""Where the message records of chunks begin: walked, or proved from what an index claims."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from semmap_log.core.loops import compiled
from semmap_log.core.messages import CDR_HEADER
from semmap_log.store import records as mcap
from semmap_log.store.event_fields import EventFields


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
    """Return the offsets that each MessageIndex behind these chunks says, whatever it is worth."""
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
    """Which kinds of record it holds: `kind_bits`."""
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


def gather_behind(
    records: bytes | memoryview,
    offsets: NDArray[np.int64],
    ahead: int,
    places: NDArray[np.int64],
    dtype: np.dtype[np.void],
) -> NDArray[np.void]:
    """Return the structs of that dtype which lie so many bytes behind some of these offsets.

    Args:
        records: What holds them.
        offsets: Where records begin.
        ahead: How far behind that the structs lie.
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
