"""Whole chunks behind a place where nothing can be read: found by what chunks look like.

A record's length cannot be trusted there, so every byte is a place where a chunk may begin.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from semmap_log.log import records as mcap
from semmap_log.log.chunks import MAX_CHUNK_BYTES, StoredChunk, read_chunk_head
from semmap_log.log.walking import ChunkDamage, gather, walk

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


def whole_chunks(
    file: memoryview, start: int, end: int
) -> Iterator[tuple[StoredChunk, bytes | memoryview, NDArray[np.int64]]]:
    """Yield the whole chunks between two offsets, wherever they begin, in file order.

    With each come its records, CRC checked, and where its messages begin.
    """
    behind = start
    for offset in _candidates(file, start, end):
        if offset < behind:
            continue  # what looks like a chunk inside one that is whole
        (length,) = mcap.FRAME.unpack_from(file, offset)[1:]
        try:
            chunk = read_chunk_head(file, offset, mcap.FRAME.size + length)
            records = chunk.records(file)
            offsets = walk(records)
        except ChunkDamage:
            continue
        if len(offsets):
            yield chunk, records, offsets
            behind = offset + chunk.length


def _candidates(file: memoryview, start: int, end: int) -> Iterator[int]:
    """Yield the offsets of what may be the head of a chunk that ends by `end`."""
    for window in range(start, end, _WINDOW_BYTES):
        stop = min(window + _WINDOW_BYTES, end - _LOOKS.itemsize + 1)
        if stop <= window:
            return
        places = (
            np.flatnonzero(np.frombuffer(file, np.uint8, stop - window, window) == _CHUNK) + window
        )
        head = gather(file, places, _LOOKS)
        fits = (
            (head["length"] >= _HEAD_BYTES)
            & (head["length"] <= end - places - mcap.FRAME.size)
            & (head["size"] <= MAX_CHUNK_BYTES)
            & (head["name_length"] <= _LONGEST_NAME)
        )
        yield from places[fits].tolist()
