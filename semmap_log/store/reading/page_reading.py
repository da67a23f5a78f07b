"""Chunks of a segment, read and checked: their heads, their CRC, their times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from semmap_log.core.io.checksum import crc32
from semmap_log.errors import CorruptLogError
from semmap_log.store import records as mcap
from semmap_log.store.chunks import crc_problem
from semmap_log.store.pages import Page, compiled_scan
from semmap_log.store.reading import invariants
from semmap_log.store.reading.chunk_table import ChunkTable, LoadedChunks
from semmap_log.store.record_scan import (
    ChunkDamage,
    ScannedChunks,
    ScannedRecords,
    gather,
    scan_by_index,
    scan_one,
    scan_together,
)

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


_FEW_RECORDS_BYTES = 1500
"""Chunks of so few records are walked as fast as their indexes are read."""


Records = bytes | memoryview


class Unpacked(NamedTuple):
    """Chunks whose bytes were read."""

    loaded: LoadedChunks
    records: Records | None
    """Those of all chunks, concatenated, each CRC checked. None: there are several that are not
    compressed, and they are in what was loaded."""


def unpack(chunks: ChunkTable) -> Unpacked:
    """Read chunks, and decompress them.

    Raises:
        CorruptLogError: They are not what was written.
    """
    loaded = chunks.loaded()
    if len(chunks) > 1 and chunks.are_plain[0]:
        return Unpacked(loaded, None)
    if len(chunks) == 1:
        return Unpacked(loaded, _checked(loaded, 0, loaded.records))
    ends = np.cumsum(chunks.rows["size"]).tolist()
    records = np.empty(ends[-1], np.uint8).data  # which is not filled with zeros first
    for place, (start, end) in enumerate(pairwise((0, *ends))):
        _checked(loaded, place, partial(loaded.records, into=records[start:end]))
    return Unpacked(loaded, records.toreadonly())


def _checked(loaded: LoadedChunks, place: int, read: Callable[[int], Records]) -> Records:
    """Return what `read` gives of a chunk, where that is something.

    Raises:
        CorruptLogError: It is not what was written.
    """
    try:
        records = read(place)
        _check_filled(records)
    except ChunkDamage as damage:
        offset = int(loaded.table.rows["offset"][place])
        raise CorruptLogError(loaded.table.path, offset, str(damage)) from None
    return records


def _check_filled(records: Records) -> None:
    if not len(records):
        raise ChunkDamage("a chunk without messages")


def read_page(
    chunks: ChunkTable,
    first_event: int,
    *,
    unpacked: Unpacked | None = None,
    in_place: bool = False,
    is_sound: bool = False,
) -> Page:
    """Return the records of these chunks as one page.

    Args:
        chunks: At least one; where there are several, all of them compressed or none.
        first_event: Event number at which their segment begins.
        unpacked: What `unpack` returned for them; None: not called yet.
        in_place: Whether several that are not compressed stay between what else was read.
        is_sound: Whether their bytes were checked before: then they are, too.

    Raises:
        CorruptLogError: One is not what was written.
    """
    loaded, records = unpack(chunks) if unpacked is None else unpacked
    if len(chunks) == 1:
        assert records is not None, "of one chunk there are"
        return _page_of_one(loaded, first_event, records)
    rows = chunks.rows
    whole, starts = _laid_out(loaded, records, in_place=in_place, is_sound=is_sound)
    ends = starts + rows["size"]
    place = int(rows["offset"][0])
    try:
        scanned = _scanned(loaded, whole, starts, ends, first_event)
    except ChunkDamage as damage:
        raise CorruptLogError(chunks.path, place, str(damage)) from None
    page = Page(whole, first_event, chunks.path, place, scanned)
    violation = _violation(scanned.chunks or invariants.in_chunks(page, ends), rows)
    if violation is not None:
        raise CorruptLogError(chunks.path, int(rows["offset"][violation[0]]), violation[1])
    return page


def _laid_out(
    loaded: LoadedChunks, unpacked: Records | None, *, in_place: bool, is_sound: bool
) -> tuple[Records, NDArray[np.int64]]:
    """Return what holds the records of several chunks, checked, and where those of each begin."""
    sizes = loaded.table.rows["size"]
    joined = np.cumsum(sizes) - sizes
    if unpacked is not None:
        return unpacked, joined
    crcs = _check_heads(loaded)
    starts = loaded.starts + _HEAD.itemsize
    if is_sound:
        return loaded.data, starts
    ends = starts + sizes
    parts = [loaded.data[a:b] for a, b in zip(starts.tolist(), ends.tolist(), strict=True)]
    if list(map(crc32, parts)) != crcs:
        raise _first_misfit_of_crc(loaded.table, parts, crcs)
    return (loaded.data, starts) if in_place else (b"".join(parts), joined)


def _scanned(
    loaded: LoadedChunks,
    records: Records,
    starts: NDArray[np.int64],
    ends: NDArray[np.int64],
    first_event: int,
) -> ScannedRecords:
    """Return what is in the records of chunks.

    Raises:
        ChunkDamage: They are not consecutive messages.
    """
    rows = loaded.table.rows
    index_bytes = int((rows["behind"] - rows["offset"] - rows["length"]).sum())
    expected = index_bytes // mcap.MESSAGE_INDEX_ENTRY_BYTES  # a little more: indexes have heads
    scanned = compiled_scan(records, starts, ends, first_event=first_event, expected=expected)
    if scanned is not None:
        return scanned
    if len(rows) == 1:
        return scan_one(loaded.data, int(loaded.index_starts[0]), records)
    return _walk(loaded, records, starts, ends)


def _walk(
    loaded: LoadedChunks, records: Records, starts: NDArray[np.int64], ends: NDArray[np.int64]
) -> ScannedRecords:
    """Return where the messages of several chunks begin."""
    if int(loaded.table.rows["size"].max()) <= _FEW_RECORDS_BYTES:
        return ScannedRecords(scan_together(records, starts, ends))
    return scan_by_index(loaded.data, loaded.index_starts, records, starts, ends)


def _first_misfit_of_crc(
    chunks: ChunkTable, parts: Sequence[memoryview], crcs: Sequence[int]
) -> CorruptLogError:
    place = next(i for i, crc in enumerate(crcs) if crc32(parts[i]) != crc)
    problem = crc_problem(parts[place], crcs[place])
    return CorruptLogError(chunks.path, int(chunks.rows["offset"][place]), problem)


def _violation(chunks: ScannedChunks, rows: NDArray[np.void]) -> tuple[int, str] | None:
    """Return the place of a chunk that is not what the table says, and what is wrong with it."""
    place = invariants.first_violation(chunks.least_ns, chunks.greatest_ns, rows)
    if place is not None:
        return place, invariants.TIMES_VIOLATION
    wrong = np.flatnonzero(chunks.kinds != rows["kinds"])
    return (int(wrong[0]), invariants.KINDS_MISFIT) if len(wrong) else None


def _page_of_one(loaded: LoadedChunks, first_event: int, records: Records) -> Page:
    chunks = loaded.table
    offset = int(chunks.rows["offset"][0])
    try:
        start, end = np.zeros(1, np.int64), np.array([len(records)])
        scanned = _scanned(loaded, records, start, end, first_event)
        page = Page(records, first_event, chunks.path, offset, scanned)
        _check_rows(page, chunks)
    except ChunkDamage as damage:
        raise CorruptLogError(chunks.path, offset, str(damage)) from None
    return page


def _check_rows(page: Page, chunks: ChunkTable) -> None:
    found = page.scanned.chunks if page.scanned is not None else None
    violation = _violation(
        found or invariants.in_chunks(page, np.array([len(page.records)])), chunks.rows
    )
    if violation is not None:
        raise ChunkDamage(violation[1])


def _check_heads(loaded: LoadedChunks) -> list[int]:
    """Check the heads of uncompressed chunks against the table, and return their CRCs."""
    chunks, rows = loaded.table, loaded.table.rows
    heads = gather(loaded.data, loaded.starts, _HEAD)
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
        chunks.chunk_in(loaded.data, int(loaded.bases[place]), place)  # says what is wrong
        raise CorruptLogError(chunks.path, int(rows["offset"][place]), "a chunk without messages")
    crcs: list[int] = heads["crc"].tolist()
    return crcs
