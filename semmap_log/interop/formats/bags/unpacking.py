"""Unpacking what strangers packed: a few kilobytes of zstd can hold gigabytes of zeros.

What a packed piece (a chunk of a bag, a message) may hold is limited: 128 MiB, and more only up to
a thousand times its packed bytes, and never more than 256 MiB. Nothing is unpacked further. What a
file holds in all is limited by a `Tally`: 1 GiB, and more only up to four thousand times its bytes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

FREE_BYTES = 128 * 2**20
"""A map of a hundred million cells, of which most are unknown, is packed ten-thousandfold."""
MOST_RATIO = 1_000
MOST_BYTES = 256 * 2**20
FREE_FILE_BYTES = 2**30
MOST_FILE_RATIO = 4_000
"""As of a segment of ours: `store.unpacking`."""
PIECE_BYTES = 2**20
FED_BYTES = 256
"""Of zstd: four bytes can stand for 128 KiB, so that at most 8 MiB come of them."""

STATED = "128 MiB, or 1,000 times its packed bytes, and never more than 256 MiB"


class Tally:
    """Counts the bytes that come of a file while it is read once."""

    def __init__(self, file_size: int) -> None:
        self._left = max(FREE_FILE_BYTES, MOST_FILE_RATIO * file_size)

    def add(self, size: int) -> None:
        """Count some more.

        Raises:
            ValueError: They are more than come of any such file.
        """
        self._left -= size
        if self._left < 0:
            raise ValueError(
                f"expected at most 1 GiB, or {MOST_FILE_RATIO:,} times the file's bytes, of chunks "
                "and messages; got more; take out of a copy what is not needed: mcap filter, "
                "rosbag filter"
            )


def most_unpacked(packed: int) -> int:
    """Return how many bytes may come of so many that are packed."""
    return min(MOST_BYTES, max(FREE_BYTES, MOST_RATIO * packed))


def unpack(data: bytes, compression: str, *, declared: int | None = None) -> bytes:
    """Return what was packed, in memory of that size.

    Args:
        data: What is packed.
        compression: "zstd", "lz4" (frames), "bz2"; "" or "none": it is not packed.
        declared: How many bytes have to come of it; None: nobody says.

    Raises:
        ValueError: They are too many, others than declared, or of no such packing.
    """
    most = most_unpacked(len(data))
    if declared is not None and declared > most:
        raise too_much(f"{declared:,} bytes")
    if compression in ("", "none"):
        unpacked = data
    elif compression in _UNPACKERS:
        try:
            unpacked = _UNPACKERS[compression](data, most if declared is None else declared)
        except _MoreError:
            if declared is None:
                raise too_much("more") from None
            raise ValueError(f"expected {declared:,} unpacked bytes, got more") from None
        except (OSError, EOFError, RuntimeError) as error:
            raise ValueError(f"it is no {compression}: {error}") from None
    else:
        raise ValueError(f"expected a chunk packed with zstd, lz4 or bz2, got {compression[:40]!r}")
    if declared is not None and declared != len(unpacked):
        raise ValueError(f"expected {declared:,} unpacked bytes, got {len(unpacked):,}")
    return unpacked


class _MoreError(Exception):
    """More is packed than may be unpacked."""


def too_much(got: str) -> ValueError:
    """Return the error that says that there is more than we unpack."""
    return ValueError(f"expected at most {STATED}, unpacked; got {got}; write it in smaller chunks")


def _unpack_zstd(data: bytes, most: int) -> bytes:
    import zstandard

    try:
        said = zstandard.frame_content_size(data)
        if said > most:
            raise _MoreError
        decompressor = zstandard.ZstdDecompressor()
        return decompressor.decompress(data) if said >= 0 else _unpack_slowly(data, most)
    except zstandard.ZstdError as error:
        raise ValueError(f"it is no zstd: {error}") from None


def _unpack_lz4(data: bytes, most: int) -> bytes:
    from lz4.frame import LZ4FrameDecompressor

    unpacked: bytes = _unpack_with(LZ4FrameDecompressor(), data, most)
    return unpacked


def _unpack_bz2(data: bytes, most: int) -> bytes:
    from bz2 import BZ2Decompressor

    return _unpack_with(BZ2Decompressor(), data, most)


def _unpack_with(decompressor: Any, data: bytes, most: int) -> bytes:
    unpacked: bytes = decompressor.decompress(data, max_length=most + 1)
    if len(unpacked) > most:
        raise _MoreError
    if not decompressor.eof:
        raise EOFError("its end is missing")
    return unpacked


def _unpack_slowly(data: bytes, most: int) -> bytes:
    """Unpack zstd that does not say how much it holds."""
    import zstandard

    stream, unpacked = zstandard.ZstdDecompressor().decompressobj(), bytearray()
    for at in range(0, len(data), FED_BYTES):
        unpacked += stream.decompress(data[at : at + FED_BYTES])
        if len(unpacked) > most:
            raise _MoreError
        if stream.eof:
            return bytes(unpacked)
    raise EOFError("its end is missing")


_UNPACKERS: dict[str, Callable[[bytes, int], bytes]] = {
    "zstd": _unpack_zstd,
    "lz4": _unpack_lz4,
    "bz2": _unpack_bz2,
}
