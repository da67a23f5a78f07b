"""Unpacks zlib data, but no further than the caller allows."""

from __future__ import annotations

import zlib


def inflated(data: bytes, most: int) -> bytes:
    """Return what is packed in all of these bytes, in memory of its size.

    Args:
        data: As zlib packs it.
        most: The most bytes that it may unpack to.

    Raises:
        ValueError: There are more, or it is damaged.
    """
    unpacker = zlib.decompressobj()
    try:
        unpacked = unpacker.decompress(data, most + 1)
    except zlib.error as error:
        raise ValueError(f"expected zlib data: {error}") from None
    if len(unpacked) > most:
        raise ValueError(f"expected at most {most} bytes unpacked, got more")
    if not unpacker.eof or unpacker.unused_data:
        raise ValueError("it does not end where what is packed ends")
    return unpacked
