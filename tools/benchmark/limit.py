"""The physical limit: the same bytes checked by CRC and seen as numbers, and nothing made of them.

zstd is part of it where the log is compressed. A live log's small chunks are taken together, file
by file, since a limit does not pay for each of them.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from pathlib import Path

from benchmark.mcap_fold import stored_chunks

_FROM_HEAD = 40
"""From a Chunk record's begin to its compression: frame, times, size, CRC, length of the text."""
_CRC_AT = 33
_BLOCK = 2**20

Checked = tuple[int, int]
"""Bytes, and the sum of the CRCs."""


def whole_files(files: tuple[Path, ...]) -> Checked:
    """Return what is found by reading the files from end to end, a MiB at a time."""
    return _checked(_blocks(files))


def whole_files_expected(files: tuple[Path, ...]) -> Checked:
    """Return the same in another way: each file at once, cut afterwards."""
    size = crcs = 0
    for path in files:
        data = path.read_bytes()
        size += len(data)
        crcs += sum(zlib.crc32(data[at : at + _BLOCK]) for at in range(0, len(data), _BLOCK))
    return size, crcs


def all_records(places: tuple[tuple[Path, int, str, int, int], ...]) -> Checked:
    """Return what is found in the records of all chunks, decompressed."""
    return _checked(_records(places))


def all_records_expected(files: tuple[Path, ...]) -> Checked:
    """Return the same as the files say it: each chunk holds its size and its CRC."""
    size = crcs = 0
    for path, at, _, _, records in stored_chunks(files):
        with path.open("rb") as file:
            file.seek(at + _CRC_AT)
            crcs += int.from_bytes(file.read(4), "little")
        size += records
    return size, crcs


def _checked(pieces: Iterator[bytes | memoryview]) -> Checked:
    import numpy as np

    size = crcs = 0
    for piece in pieces:
        crcs += zlib.crc32(piece)
        seen = np.frombuffer(piece, "u8", len(piece) // 8)
        size += 8 * len(seen) + len(piece) % 8
    return size, crcs


def _blocks(files: tuple[Path, ...]) -> Iterator[memoryview]:
    block = bytearray(_BLOCK)
    for path in files:
        with path.open("rb", buffering=0) as file:
            while got := file.readinto(block):
                yield memoryview(block)[:got]


def _records(places: tuple[tuple[Path, int, str, int, int], ...]) -> Iterator[bytes | memoryview]:
    import zstandard

    inflate = zstandard.ZstdDecompressor()
    handles = {path: path.open("rb", buffering=0) for path, *_ in places}
    try:
        for path, at, compression, stored, size in places:
            file = handles[path]
            file.seek(at + _FROM_HEAD + len(compression) + 8 + 1)
            data = file.read(stored)
            yield inflate.decompress(data, max_output_size=size) if compression else data
    finally:
        for file in handles.values():
            file.close()
