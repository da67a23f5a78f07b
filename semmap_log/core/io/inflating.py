"""What zlib packed, unpacked no further than somebody says that it may be."""

from __future__ import annotations

import zlib


def inflated(data: bytes, most: int) -> bytes:
    """Return what is packed in all of these bytes, in memory of its size.

    Args:
        data: As zlib packs it.
        most: So many bytes there may be.

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
