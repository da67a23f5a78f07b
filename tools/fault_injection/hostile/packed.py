"""Zeros packed very small, in each format that our readers unpack."""

from __future__ import annotations

import bz2
import gzip
import io
import zlib
from functools import cache

import lz4.frame
import zstandard

_BLOCK = bytes(2**20)


@cache
def zstd_zeros(mib: int, *, says_size: bool) -> bytes:
    """Return so many MiB of zeros as a zstd frame.

    Args:
        mib: How many.
        says_size: Whether the frame's head tells how many bytes it holds.
    """
    size = mib * 2**20 if says_size else -1
    packing = zstandard.ZstdCompressor(level=1).compressobj(size=size)
    return b"".join(packing.compress(_BLOCK) for _ in range(mib)) + packing.flush()


@cache
def lz4_zeros(mib: int) -> bytes:
    """Return so many MiB of zeros as an lz4 frame."""
    with lz4.frame.LZ4FrameCompressor(block_size=lz4.frame.BLOCKSIZE_MAX4MB) as packing:
        parts = [packing.begin()]
        parts += [packing.compress(_BLOCK) for _ in range(mib)]
        return b"".join([*parts, packing.flush()])


@cache
def bz2_zeros(mib: int) -> bytes:
    """Return so many MiB of zeros as bz2 has them."""
    packing = bz2.BZ2Compressor(9)
    return b"".join(packing.compress(_BLOCK) for _ in range(mib)) + packing.flush()


@cache
def gzip_of(block: bytes, times: int) -> bytes:
    """Return a block of bytes so many times over, as gzip has it."""
    out = io.BytesIO()
    with gzip.GzipFile(fileobj=out, mode="wb", compresslevel=6, mtime=0) as file:
        for _ in range(times):
            file.write(block)
    return out.getvalue()


@cache
def zlib_zeros(mib: int) -> bytes:
    """Return so many MiB of zeros as zlib has them."""
    packing = zlib.compressobj(9)
    return b"".join(packing.compress(_BLOCK) for _ in range(mib)) + packing.flush()


@cache
def crc_of_zeros(mib: int) -> int:
    """Return the CRC-32 of so many MiB of zeros."""
    crc = 0
    for _ in range(mib):
        crc = zlib.crc32(_BLOCK, crc)
    return crc
