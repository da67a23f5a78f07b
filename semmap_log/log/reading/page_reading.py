"""Chunks of a segment, read and checked: their heads, their CRC, their times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from semmap_log.errors import CorruptLogError
from semmap_log.log import records as mcap
from semmap_log.log.chunks import (
    ChunkDamage,
    check_crc,
    gather,
    walk_by_index,
    walk_together,
)
from semmap_log.log.pages import Page
from semmap_log.log.reading.chunk_table import ChunkTable

_HEAD: np.dtype[np.void] = np.dtype(
    {
        "names": ["opcode", "length", "start_ns", "end_ns", "size", "crc", "name_length",
                  "stored_size"],
        "formats": ["u1", "<i8", "<i8", "<i8", "<i8", "<u4", "<u4", "<i8"],
        "offsets": [0, 1, 9, 17, 25, 33, 37, 41],
        "itemsize": 49,
    }
)  # fmt: skip
"""Of an uncompressed Chunk record, up to its records."""


def read_page(chunks: ChunkTable, first_event: int) -> Page:
    """Return the records of these chunks as one page.

    Args:
        chunks: At least one; where there are several, none of them compressed.
        first_event: Event number at which their segment begins.

    Raises:
        CorruptLogError: One is not what was written.
    """
    if len(chunks) == 1:
        return _read_one(chunks, first_event)
    crcs = _check_heads(chunks)
    starts = chunks.rows["offset"] + _HEAD.itemsize
    parts = []
    for start, size, crc in zip(starts.tolist(), chunks.rows["size"].tolist(), crcs, strict=True):
        parts.append(chunks.file[start : start + size])
        try:
            check_crc(parts[-1], crc)
        except ChunkDamage as damage:
            raise CorruptLogError(chunks.path, start - _HEAD.itemsize, str(damage)) from None
    records = b"".join(parts)
    ends = np.cumsum(chunks.rows["size"])
    try:
        offsets = walk_together(records, ends - chunks.rows["size"], ends)
    except ChunkDamage as damage:
        raise CorruptLogError(chunks.path, int(chunks.rows["offset"][0]), str(damage)) from None
    page = Page(records, first_event, chunks.path, int(chunks.rows["offset"][0]), offsets)
    place = first_misfit(page.heads["log_time"], np.searchsorted(offsets, ends), chunks.rows)
    if place is not None:
        raise CorruptLogError(chunks.path, int(chunks.rows["offset"][place]), TIMES_MISFIT)
    return page


TIMES_MISFIT = "its head does not tell the least and greatest log time of its messages"


def first_misfit(
    log_time: NDArray[np.int64], ends: NDArray[np.intp], rows: NDArray[np.void]
) -> int | None:
    """Return the place of the first chunk that says other times than its messages have, if any.

    Args:
        log_time: Of all messages.
        ends: How many messages there are to the end of each chunk; each has at least one.
        rows: What is said of the chunks: `start_ns`, `end_ns`.
    """
    starts = np.append(0, ends[:-1])
    wrong = (np.minimum.reduceat(log_time, starts) != rows["start_ns"]) | (
        np.maximum.reduceat(log_time, starts) != rows["end_ns"]
    )
    places: Sequence[int] = np.flatnonzero(wrong).tolist()
    return places[0] if places else None


def _read_one(chunks: ChunkTable, first_event: int) -> Page:
    chunk = chunks[0]
    try:
        records = chunk.records(chunks.file)
        page = Page(
            records,
            first_event,
            chunks.path,
            chunk.offset,
            walk_by_index(chunks.file, chunk, records),
        )
        _check_times(page, chunks)
    except ChunkDamage as damage:
        raise CorruptLogError(chunks.path, chunk.offset, str(damage)) from None
    return page


def _check_times(page: Page, chunks: ChunkTable) -> None:
    if not len(page.offsets):
        raise ChunkDamage("a chunk without messages")
    ends = np.array([len(page.offsets)])
    if first_misfit(page.heads["log_time"], ends, chunks.rows) is not None:
        raise ChunkDamage(TIMES_MISFIT)


def _check_heads(chunks: ChunkTable) -> list[int]:
    """Check the heads of uncompressed chunks against the table, and return their CRCs."""
    rows = chunks.rows
    heads = gather(chunks.file, rows["offset"], _HEAD)
    wrong = (
        (heads["opcode"] != Opcode.CHUNK)
        | (heads["length"] != rows["length"] - mcap.FRAME.size)
        | (heads["start_ns"] != rows["start_ns"])
        | (heads["end_ns"] != rows["end_ns"])
        | (heads["size"] != rows["size"])
        | (heads["name_length"] != 0)
        | (heads["stored_size"] != rows["stored_size"])
        | (rows["size"] == 0)
    )
    for place in np.flatnonzero(wrong).tolist():
        chunks[place]  # says what is wrong
        raise CorruptLogError(chunks.path, int(rows["offset"][place]), "a chunk without messages")
    crcs: list[int] = heads["crc"].tolist()
    return crcs
