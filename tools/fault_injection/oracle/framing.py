"""MCAP as its specification has it: records, chunks, and what a footer leads to."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import zstandard

MAGIC = b"\x89MCAP0\r\n"
FRAME = struct.Struct("<BQ")
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX = 1, 2, 3, 4, 5, 6, 7
STATISTICS, METADATA, DATA_END = 0x0B, 0x0C, 0x0F
FOOTER_BYTES = FRAME.size + 20 + len(MAGIC)
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<QQQI")


class BadBytesError(Exception):
    """The bytes are not what stands here in a log."""


BAD_BYTES = (BadBytesError, ValueError, KeyError, IndexError, struct.error)
"""What is raised where bytes are taken apart that are not what stands here in a log."""


@dataclass(frozen=True)
class Record:
    """A record: where it lies in its file (or chunk), and what is in it."""

    opcode: int
    at: int
    end: int
    body: bytes


@dataclass(frozen=True)
class Message:
    """A Message record, with all its bytes: the hashes are taken over them."""

    channel: int
    sequence: int
    log_time: int
    publish_time: int
    data: bytes
    whole: bytes


def records(data: bytes, start: int, end: int) -> Iterator[Record]:
    """Yield the records that lie whole between two places, one behind the other."""
    at = start
    while at + FRAME.size <= end:
        opcode, length = FRAME.unpack_from(data, at)
        stop = at + FRAME.size + length
        if stop > end:
            return
        yield Record(opcode, at, stop, data[at + FRAME.size : stop])
        at = stop


def text(body: bytes, at: int) -> tuple[str, int]:
    """Return a text with its length before it, and where the next field begins."""
    (length,) = struct.unpack_from("<I", body, at)
    return body[at + 4 : at + 4 + length].decode(), at + 4 + length


def texts_by_name(body: bytes, at: int) -> dict[str, str]:
    """Return a map of texts."""
    (length,) = struct.unpack_from("<I", body, at)
    at, end = at + 4, at + 4 + length
    found = {}
    while at < end:
        key, at = text(body, at)
        found[key], at = text(body, at)
    return found


def schema(body: bytes) -> tuple[int, str, str]:
    """Return the id, the name and the text of a schema."""
    (number,) = struct.unpack_from("<H", body)
    name, at = text(body, 2)
    _, at = text(body, at)
    (length,) = struct.unpack_from("<I", body, at)
    return number, name, body[at + 4 : at + 4 + length].decode()


def channel(body: bytes) -> tuple[int, int, str]:
    """Return the id of a channel, that of its schema, and its topic."""
    number, its_schema = struct.unpack_from("<HH", body)
    return number, its_schema, text(body, 4)[0]


def chunk_messages(record: Record) -> list[Message]:
    """Return the messages of a chunk, its checksum and its times checked.

    Raises:
        BadBytesError: They are not what was written.
    """
    try:
        return list(_messages(_unpacked(record)))
    except (struct.error, zstandard.ZstdError, IndexError, UnicodeDecodeError) as error:
        raise BadBytesError(f"a chunk at byte {record.at}: {error}") from error


def _unpacked(record: Record) -> bytes:
    _, _, size, crc = _CHUNK_HEAD.unpack_from(record.body)
    compression, at = text(record.body, _CHUNK_HEAD.size)
    (stored,) = struct.unpack_from("<Q", record.body, at)
    packed = record.body[at + 8 : at + 8 + stored]
    if compression not in {"", "zstd"}:
        raise BadBytesError(f"a chunk at byte {record.at} with compression {compression!r}")
    plain = zstandard.ZstdDecompressor().decompress(packed, size) if compression else packed
    if len(plain) != size or zlib.crc32(plain) != crc:
        raise BadBytesError(f"a chunk at byte {record.at} that does not fit its checksum")
    return plain


def _messages(plain: bytes) -> Iterator[Message]:
    at = 0
    for record in records(plain, 0, len(plain)):
        if record.opcode != MESSAGE or record.at != at:
            raise BadBytesError("a chunk that holds more than messages")
        head = _MESSAGE_HEAD.unpack_from(record.body)
        yield Message(*head, record.body[_MESSAGE_HEAD.size :], plain[record.at : record.end])
        at = record.end
    if at != len(plain):
        raise BadBytesError("a chunk that ends within a message")


def is_closed(data: bytes) -> bool:
    """Tell whether a file ends with a footer and the magic."""
    if len(data) < FOOTER_BYTES or data[-len(MAGIC) :] != MAGIC:
        return False
    return bool(FRAME.unpack_from(data, len(data) - FOOTER_BYTES) == (FOOTER, 20))


def summary_problem(data: bytes) -> str:
    """Say what is wrong with the checksums of a closed file; empty: nothing."""
    start, _, crc = struct.unpack_from("<QQI", data, len(data) - FOOTER_BYTES + FRAME.size)
    crc_at = len(data) - len(MAGIC) - 4
    if not len(MAGIC) <= start <= crc_at:
        return "a footer that leads nowhere"
    if zlib.crc32(data[start:crc_at]) != crc:
        return "a summary that does not fit its checksum"
    end = start - FRAME.size - 4
    if FRAME.unpack_from(data, end) != (DATA_END, 4):
        return "no end of the data before the summary"
    if struct.unpack_from("<I", data, start - 4)[0] != zlib.crc32(data[:end]):
        return "data that do not fit their checksum"
    return ""


def whole_chunks(data: bytes, start: int) -> Iterator[list[Message]]:
    """Yield the messages of every whole chunk behind a place, wherever it begins."""
    at = start
    while (at := data.find(bytes([CHUNK]), at)) >= 0:
        record = next(records(data, at, len(data)), None)
        messages = _messages_or_none(record)
        if record is None or messages is None:
            at += 1
            continue
        yield messages
        at = record.end


def _messages_or_none(record: Record | None) -> list[Message] | None:
    try:
        return None if record is None else chunk_messages(record)
    except BadBytesError:
        return None
