"""The records of a foreign MCAP file, in memory of a chunk's size, whatever the file says.

The mcap library's own readers unpack what a chunk holds, however much, take records of no kind for
such as are to be passed over, and read an attachment of any size; so its records are found here,
and its classes read them.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from struct import Struct
from typing import Any, BinaryIO
from zlib import crc32

import numpy as np

from semmap_log.interop.formats.bags.damage import reason_of
from semmap_log.interop.formats.bags.unpacking import MOST_BYTES, Tally, unpack

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
    """Empty if it was not asked for."""


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
        hear: Told all bytes that are passed, those of a record before it is yielded.

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
