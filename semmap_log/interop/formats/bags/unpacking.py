"""Unpacking foreign data: a few kilobytes of zstd can contain gigabytes of zeros.

What a packed piece (a chunk of a bag, a message) may contain is limited: 128 MiB, and more only up
to a thousand times its packed bytes, and never more than 256 MiB. Nothing is unpacked further. What
a file contains in all is limited by a `Tally`: 1 GiB, and more only up to four thousand times its
bytes.

The records of a foreign MCAP file are read in memory of a chunk's size, whatever the file says. The
mcap library's own readers unpack all of a chunk, skip records of unknown kinds, and read an
attachment of any size; so the records are found here, and the library's classes parse them.
"""

from __future__ import annotations

import sqlite3
from array import array
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from struct import Struct
from typing import Any, BinaryIO
from zlib import crc32

import numpy as np

FRAME = Struct("<BQ")
MESSAGE = Struct("<HIQQ")
"""Channel, sequence, log time, publish time; the data are the rest."""
MOST_SUMMARY_BYTES = 64 * 2**20
"""Of a file of some terabytes."""
BLOCK_BYTES = 2**20
FREE_RECORDS = 50_000
MOST_RECORDS_A_BYTE = {"zstd": 8}
"""Beyond those, of a chunk as it is packed: messages whose times differ take more than half a byte
each in zstd, and others more than one."""


@dataclass(frozen=True, slots=True)
class Record:
    """A record of a file, or of a chunk."""

    opcode: int
    at: int
    """Where it begins."""
    body: bytes
    """Empty if it is not wanted."""


def records(
    file: BinaryIO,
    start: int,
    end: int,
    wanted: Collection[int],
    *,
    hear: Callable[[bytes], None] | None = None,
) -> Iterator[Record]:
    """Yield all records between two places of a file, with the bodies of those that are wanted.

    Args:
        file: The file; others may read it meanwhile.
        start: Where the first record begins.
        end: Where the last one has to end.
        wanted: Opcodes.
        hear: Called with all bytes that are read; with those of a record before it is yielded.

    Raises:
        ValueError: They are no records, or one that is wanted is too long.
    """
    at = start
    while at < end:
        file.seek(at)
        head = file.read(FRAME.size)
        opcode, length = _checked(head, at, end - at)
        behind = at + FRAME.size + length
        body = b""
        if opcode in wanted:
            if length > MOST_BYTES:
                raise ValueError(f"the record at byte {at:,}: expected at most 256 MiB, got "
                                 f"{length:,} bytes")  # fmt: skip
            body = _read(file, length)
        if hear is not None:
            _tell(hear, file, head, body, length)
        yield Record(opcode, at, body)
        at = behind


def _checked(head: bytes | memoryview, at: int, left: int) -> tuple[int, int]:
    """Return opcode and length of a record.

    Raises:
        ValueError: It is none, or does not end where it must.
    """
    if len(head) < FRAME.size:
        raise ValueError(f"expected a record at byte {at:,}, got the end")
    opcode, length = FRAME.unpack(head)
    if not opcode:
        raise ValueError(f"expected a record at byte {at:,}, got one of no kind (opcode 0)")
    if FRAME.size + length > left:
        raise ValueError(
            f"the record at byte {at:,}: expected at most {left - FRAME.size:,} bytes, "
            f"got {length:,}"
        )
    return opcode, length


def _tell(
    hear: Callable[[bytes], None], file: BinaryIO, head: bytes, body: bytes, length: int
) -> None:
    hear(head)
    hear(body)
    left = length - len(body)
    while left > 0:
        block = _read(file, min(left, BLOCK_BYTES))
        hear(block)
        left -= len(block)


def _read(file: BinaryIO, size: int) -> bytes:
    data = file.read(size)
    if len(data) < size:
        raise ValueError(f"expected {size:,} bytes more, got {len(data):,}")
    return data


def parsed(kind: Any, record: Record) -> Any:
    """Return a record as the mcap library's class.

    Raises:
        ValueError: Its bytes are no such record.
    """
    from mcap.data_stream import ReadDataStream

    try:
        return kind.read(ReadDataStream(BytesIO(record.body)))
    except Exception as error:
        raise ValueError(
            f"the {kind.__name__} at byte {record.at:,}: {reason_of(error)}"
        ) from error


@dataclass(slots=True)
class Summary:
    """What a file says of itself at its end."""

    schemas: dict[int, Any] = field(default_factory=dict)
    channels: dict[int, Any] = field(default_factory=dict)
    chunks: list[Any] = field(default_factory=list)
    counts: dict[int, int] = field(default_factory=dict)
    """Channel -> messages; empty: it does not say."""
    channel_count: int | None = None
    """Of the whole file; None: it does not say."""

    @property
    def repeats_channels(self) -> bool:
        """Whether all channels and their schemas are here, too: a writer need not repeat them."""
        indexed = {number for chunk in self.chunks for number in chunk.message_index_offsets}
        schemas = {channel.schema_id for channel in self.channels.values()} - {0}
        return (
            bool(self.channels)
            and indexed | self.counts.keys() <= self.channels.keys()
            and schemas <= self.schemas.keys()
            and self.channel_count in {None, len(self.channels)}
        )


def read_summary(file: BinaryIO, start: int, end: int) -> Summary:
    """Return the summary that lies between two places of a file.

    Raises:
        ValueError: There is something else, or it is too long.
    """
    from mcap import records as kinds
    from mcap.opcode import Opcode

    if end - start > MOST_SUMMARY_BYTES:
        raise ValueError(f"its summary: expected at most 64 MiB, got {end - start:,} bytes")
    found = Summary()
    wanted = {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.CHUNK_INDEX, Opcode.STATISTICS}
    for record in records(file, start, end, wanted):
        if record.opcode == Opcode.SCHEMA:
            schema = parsed(kinds.Schema, record)
            found.schemas[schema.id] = schema
        elif record.opcode == Opcode.CHANNEL:
            channel = parsed(kinds.Channel, record)
            found.channels[channel.id] = channel
        elif record.opcode == Opcode.CHUNK_INDEX:
            found.chunks.append(parsed(kinds.ChunkIndex, record))
        elif record.opcode == Opcode.STATISTICS:
            statistics = parsed(kinds.Statistics, record)
            found.counts = statistics.channel_message_counts
            found.channel_count = statistics.channel_count
    return found


class OpenChunk:
    """A chunk, unpacked."""

    def __init__(self, record: Record, tally: Tally) -> None:
        """Unpack it, and have that counted.

        Raises:
            ValueError: It is too large, damaged, or no chunk.
        """
        from mcap.records import Chunk

        chunk = parsed(Chunk, record)
        try:
            self.data = unpack(chunk.data, chunk.compression, declared=chunk.uncompressed_size)
        except ValueError as error:
            raise ValueError(f"the chunk at byte {record.at:,}: {error}") from None
        if chunk.uncompressed_crc and crc32(self.data) != chunk.uncompressed_crc:
            raise ValueError(f"the chunk at byte {record.at:,}: its CRC is another")
        tally.add(len(self.data))
        self.at = record.at
        a_byte = MOST_RECORDS_A_BYTE.get(chunk.compression, 1)
        self._most = max(FREE_RECORDS, a_byte * len(record.body))
        """So many records it may have."""

    def records(self, wanted: Collection[int]) -> Iterator[Record]:
        """Yield the records in it that are wanted, with their places in the chunk.

        Raises:
            ValueError: It holds something else.
        """
        view, at, count = memoryview(self.data), 0, 0
        while at < len(view):
            opcode, length = _checked(view[at : at + FRAME.size], at, len(view) - at)
            count += 1
            self._check_count(count)
            if opcode in wanted:
                yield Record(opcode, at, bytes(view[at + FRAME.size : at + FRAME.size + length]))
            at += FRAME.size + length

    def messages(self, channels: Collection[int]) -> Iterator[tuple[int, int, int, bytes]]:
        """Yield (log time, place, channel, data) of these channels' messages, times ascending.

        Raises:
            ValueError: It holds something else.
        """
        times, places = self._places(channels)
        order = np.argsort(np.frombuffer(times, np.uint64), kind="stable") if times else ()
        for number in order:
            at = places[number] + FRAME.size
            _, length = FRAME.unpack_from(self.data, places[number])
            channel, _, _, _ = MESSAGE.unpack_from(self.data, at)
            yield times[number], places[number], channel, self.data[at + MESSAGE.size : at + length]

    def _places(self, channels: Collection[int]) -> tuple[array[int], array[int]]:
        """Return when these channels' messages were logged, and where they are."""
        from mcap.opcode import Opcode

        times, places = array("Q"), array("q")
        data, at, end, message = self.data, 0, len(self.data), int(Opcode.MESSAGE)
        count = 0
        while at < end:
            opcode, length = _checked(data[at : at + FRAME.size], at, end - at)
            count += 1
            self._check_count(count)
            if opcode == message:
                if length < MESSAGE.size:
                    raise ValueError(f"the message at byte {at:,} of a chunk is cut")
                channel, _, time, _ = MESSAGE.unpack_from(data, at + FRAME.size)
                if channel in channels:
                    times.append(time)
                    places.append(at)
            at += FRAME.size + length
        return times, places

    def _check_count(self, count: int) -> None:
        if count > self._most:
            raise ValueError(
                f"the chunk at byte {self.at:,}: expected at most {self._most:,} records in what "
                "it is packed in, got more"
            )


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


_SAYING = (OSError, ValueError, sqlite3.Error)
"""What these say is meant for people; of others it is a key, an offset, or nothing."""


def reason_of(error: BaseException) -> str:
    """Return in words why bytes cannot be read."""
    if isinstance(error, MemoryError):
        return "more memory is needed for it than there is"
    if isinstance(error, RecursionError):
        return "it is nested too deeply"
    if isinstance(error, UnicodeDecodeError):
        return f"expected UTF-8 text, got byte 0x{error.object[error.start]:02x} in it"
    is_librarys = type(error).__module__.split(".")[0] in {"rosbags", "apsw", "zstandard"}
    text = str(error).strip()
    if text and (is_librarys or isinstance(error, _SAYING)):
        return text
    return "its records contradict each other, or are cut"
