"""Finds whole chunks after a place where nothing can be read, by what chunks look like.

A record's length cannot be trusted there, so every byte is a place where a chunk may begin.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from semmap_log.store import records as mcap
from semmap_log.store.chunks import MOST_HEAD_BYTES, StoredChunk, read_chunk_head
from semmap_log.store.record_scan import MAX_CHUNK_BYTES, ChunkDamage, gather, walk

_WINDOW_BYTES = 2**22
_LOOKS: np.dtype[np.void] = np.dtype(
    {
        "names": ["opcode", "length", "size", "name_length"],
        "formats": ["u1", "<u8", "<u8", "<u4"],
        "offsets": [0, 1, 25, 37],
        "itemsize": 49,
    }
)
"""Of a Chunk record: what can be judged without knowing where it ends."""
_HEAD_BYTES = 40
_LONGEST_NAME = 4
_CHUNK = int(Opcode.CHUNK)


Read = Callable[[int, int], memoryview]
"""Returns the bytes between two offsets of a file."""


def whole_chunks(
    read: Read, start: int, end: int
) -> Iterator[tuple[StoredChunk, bytes | memoryview, NDArray[np.int64]]]:
    """Yield the whole chunks between two offsets, wherever they begin, in file order.

    With each come its records, CRC checked, and where its messages begin. Of the file a few MiB
    are in memory at a time, or one chunk.
    """
    behind = start
    for offset, length in _candidates(read, start, end):
        if offset < behind:
            continue  # what looks like a chunk inside one that is whole
        try:
            head = read(offset, min(offset + MOST_HEAD_BYTES, end))
            chunk = read_chunk_head(head, offset, length, offset)
            records = chunk.records(read(offset, offset + length), offset)
            offsets = walk(records)
        except ChunkDamage:
            continue
        if len(offsets):
            yield chunk, records, offsets
            behind = offset + chunk.length


def _candidates(read: Read, start: int, end: int) -> Iterator[tuple[int, int]]:
    """Yield offset and length of what may be a Chunk record that ends by `end`."""
    last = end - _LOOKS.itemsize
    for window in range(start, last + 1, _WINDOW_BYTES):
        starts = min(_WINDOW_BYTES, last + 1 - window)
        data = read(window, window + starts + _LOOKS.itemsize - 1)
        places = np.flatnonzero(np.frombuffer(data, np.uint8, starts) == _CHUNK)
        head = gather(data, places, _LOOKS)
        offsets, lengths = places + window, head["length"] + np.uint64(mcap.FRAME.size)
        fits = (
            (head["length"] >= _HEAD_BYTES)
            & (head["length"] <= (end - offsets - mcap.FRAME.size).astype(np.uint64))
            & (head["size"] <= MAX_CHUNK_BYTES)
            & (head["name_length"] <= _LONGEST_NAME)
        )
        yield from zip(offsets[fits].tolist(), lengths[fits].tolist(), strict=True)
