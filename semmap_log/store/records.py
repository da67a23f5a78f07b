"""The hot MCAP records as bytes: messages, chunks and message indexes. The rest: `mcap.records`.

Every record is `opcode u8, length u64, body`, little endian.
"""

from __future__ import annotations

import struct
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode

if TYPE_CHECKING:
    from mcap.records import McapRecord

MAGIC = b"\x89MCAP0\r\n"
FRAME = struct.Struct("<BQ")
"""Opcode and length before each body."""

MESSAGE = struct.Struct("<BQHIQQ")
"""Opcode, length, channel id, sequence, log time, publish time; the CDR bytes follow."""
MESSAGE_BODY_HEAD = MESSAGE.size - FRAME.size

MESSAGE_DTYPE: np.dtype[np.void] = np.dtype(
    {
        "names": ["opcode", "length", "channel_id", "sequence", "log_time", "publish_time"],
        "formats": ["u1", "<u8", "<u2", "<u4", "<i8", "<i8"],
        "offsets": [0, 1, 9, 11, 15, 23],
        "itemsize": MESSAGE.size,
    }
)
"""The same for numpy; times are below 2^63."""

_CHUNK_OPCODE = int(Opcode.CHUNK)
_MESSAGE_INDEX_OPCODE = int(Opcode.MESSAGE_INDEX)
MESSAGE_INDEX = struct.Struct("<BQHI")
"""Opcode, length, channel id, bytes of entries; entries of (log time u64, offset u64) follow."""
MESSAGE_INDEX_HEAD_BYTES = MESSAGE_INDEX.size
MESSAGE_INDEX_ENTRY_BYTES = 16


def message(channel_id: int, sequence: int, log_time: int, publish_time: int, data: bytes) -> bytes:
    """Return a Message record."""
    head = MESSAGE.pack(
        Opcode.MESSAGE,
        MESSAGE_BODY_HEAD + len(data),
        channel_id,
        sequence & 0xFFFF_FFFF,
        log_time,
        publish_time,
    )
    return head + data


def chunk_head(
    *, stored_size: int, size: int, compression: str, crc: int, start: int, end: int
) -> bytes:
    """Return a Chunk record up to its stored records.

    Args:
        stored_size: Bytes of the records as they are stored.
        size: Bytes of the records as they are.
        compression: "" or "zstd".
        crc: CRC-32 of the records as they are.
        start: Least log time.
        end: Greatest log time.
    """
    name = compression.encode()
    whole = _chunk_head(len(name))
    length = whole.size - FRAME.size + stored_size
    return whole.pack(_CHUNK_OPCODE, length, start, end, size, crc, len(name), name, stored_size)


@cache
def _chunk_head(name_length: int) -> struct.Struct:
    """Return opcode, length, times, uncompressed size, CRC, the compression's name, stored size."""
    return struct.Struct(f"<BQQQQII{name_length}sQ")


def message_index_head(channel_id: int, entry_bytes: int) -> bytes:
    """Return a MessageIndex record up to its entries of (log time u64, offset in the chunk u64)."""
    return MESSAGE_INDEX.pack(_MESSAGE_INDEX_OPCODE, 6 + entry_bytes, channel_id, entry_bytes)


def record(*records: McapRecord) -> bytes:
    """Return the bytes of records that the mcap library writes."""
    builder = RecordBuilder()
    for one in records:
        one.write(builder)
    data: bytes = builder.end()
    return data


def read_record(kind: type[Any], body: bytes | memoryview) -> Any:
    """Return the record of that class which the mcap library reads from a body.

    Raises:
        ValueError: The body is not such a record.
    """
    from io import BytesIO

    from mcap.data_stream import ReadDataStream

    try:
        return kind.read(ReadDataStream(BytesIO(body)))
    except Exception as error:  # the library's readers raise whatever they meet
        raise ValueError(f"not a {kind.__name__} record: {type(error).__name__} {error}") from error
