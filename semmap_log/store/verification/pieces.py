"""One chunk, examined: everything in it that can be checked without its neighbours.

Nothing is believed here: the messages must tile the records, the CRC must match even where it says
zero, and what stands around them (times, MessageIndex records) is recomputed from them.

A segment's records are walked byte for byte: its head, its chunks, what lies between and after. A
closed segment's summary is not consulted for the places of the chunks, and no length is believed
that leads astray: after a bad place the next whole chunk is found by its bytes.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace

from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Schema

from semmap_log.core.io.checksum import crc32
from semmap_log.core.messages import layout
from semmap_log.store import byte_layout
from semmap_log.store import records as mcap
from semmap_log.store.chunks import NO_SPAN, StoredChunk, read_chunk_head
from semmap_log.store.header import SegmentHeader
from semmap_log.store.newer import Newer, is_later_kind
from semmap_log.store.record_scan import ChunkDamage, check_sizes, unpack_records
from semmap_log.store.segment import Head, channel_record
from semmap_log.store.verification.file_place import WINDOW_BYTES, FileBytes

_NUMBERED = struct.Struct("<BQH")
"""Of a Channel or a Schema: opcode, length, id."""


@dataclass(frozen=True, slots=True)
class Flaw:
    """Bytes around whole chunks that are not what they must be; no event is lost."""

    kind: str
    offset: int
    text: str


@dataclass(frozen=True, slots=True)
class Gap:
    """Bytes that are no whole chunk, followed by whole chunks."""

    start: int
    end: int
    text: str


class SegmentWalk:
    """What lies in a segment after its header; iterate once, then look at the rest."""

    def __init__(self, file: FileBytes, header_end: int, header: SegmentHeader | None) -> None:
        """Begin after the header; at 0, and without one, where it cannot be read."""
        self.file = file
        self.header = header
        """With what a later version has put at the head, once that is walked."""
        self.levels: list[int] = []
        """Levels whose channels stand before chunks, ascending as written."""
        self.head_end = 0
        """Where the first chunk must begin; 0: not known."""
        self.pieces_end = 0
        """Once all is walked: where what follows the last chunk begins."""
        self.problem = ""
        """Why no chunk begins there; empty at the file's end."""
        self._header_end = header_end
        self._size = self._stored_size = 0
        """Of the chunks that were unpacked."""

    def __iter__(self) -> Iterator[Piece | Flaw | Gap]:
        """Yield chunks in file order, and what is wrong between them."""
        if self._header_end:
            yield from self._schemas_and_channels()
        at, size, is_known = self.head_end, len(self.file), self._header_end > 0
        while at < size:
            levels, start = self._floor_map_channels(at)
            piece, self.problem = self._piece(start)
            if piece is not None:
                self.problem = self._too_much(piece)
                if self.problem:
                    break
                yield from self._around(piece, levels, is_known=is_known)
                yield piece
                at, is_known = min(piece.end + len(piece.index), size), True
                piece = None  # the next one is unpacked without it in memory
                continue
            found = find_piece(self.file, at, size)
            if found is None:
                break
            if is_known:  # else it is the head that cannot be read, which was reported
                yield Gap(start, found.stored.offset, self.problem)
            at, is_known = found.stored.offset, False
        self.pieces_end = min(at, size)

    def is_durable_after(self, start: int, event: int) -> bool:
        """Return whether a whole chunk after `start` proves that `event` was on the disk once."""
        while (piece := find_piece(self.file, start, len(self.file))) is not None:
            if any(durable > event for durable in _durable_before(piece)):
                return True
            if self._too_much(piece):
                return False
            start = piece.end
        return False

    def _too_much(self, piece: Piece) -> str:
        """Take in the sizes of a chunk; return what is wrong with those of all."""
        self._size += piece.stored.size
        self._stored_size += piece.stored.stored_size
        try:
            check_sizes(self._size, self._stored_size)
        except ChunkDamage as damage:
            return str(damage)
        return ""

    def _schemas_and_channels(self) -> Iterator[Flaw]:
        """Compare every Schema and Channel that we know with ours, byte for byte."""
        at, newer = self._header_end, list[tuple[int, bytes]]()
        assert self.header is not None, "it is what ends there"
        head = Head.of(self.header)
        for data in (*head.schemas, *head.channels):
            found = self._newer_before(at, data)
            newer += found
            at += sum(len(record) for _, record in found)
            if self.file[at : at + len(data)] != data:
                yield Flaw("schema", at, f"{name_of_record(data)} is not ours")
            at += len(data)
        self.head_end = at
        self.header = replace(self.header, newer=Newer.of(newer))

    def _newer_before(self, at: int, known: bytes) -> list[tuple[int, bytes]]:
        """Return opcode and bytes of the records of later kinds between a place and a known one."""
        found: list[tuple[int, bytes]] = []
        while self.file[at : at + len(known)] != known:
            if at + _NUMBERED.size > len(self.file):
                return []
            opcode, length, number = _NUMBERED.unpack(self.file[at : at + _NUMBERED.size])
            end = at + mcap.FRAME.size + length
            if opcode != known[0] or end > len(self.file) or not is_later_kind(number):
                return []  # what is there is the known one, damaged
            found.append((opcode, bytes(self.file[at:end])))
            at = end
        return found

    def _floor_map_channels(self, at: int) -> tuple[list[int], int]:
        """Return whose channels stand at `at`, byte for byte as we write them, and their end."""
        levels: list[int] = []
        while at + _NUMBERED.size <= len(self.file):
            opcode, _, channel = _NUMBERED.unpack(self.file[at : at + _NUMBERED.size])
            if opcode != Opcode.CHANNEL or channel <= byte_layout.FLOOR_MAP_CHANNEL:
                break
            data = mcap.record(
                channel_record(byte_layout.floor_map_topic(channel - byte_layout.FLOOR_MAP_CHANNEL))
            )
            if self.file[at : at + len(data)] != data:
                break
            levels.append(channel - byte_layout.FLOOR_MAP_CHANNEL)
            at += len(data)
        return levels, at

    def _piece(self, at: int) -> tuple[Piece | None, str]:
        if at + mcap.FRAME.size > len(self.file):
            return None, "a record that is cut"
        opcode, length = mcap.FRAME.unpack(self.file[at : at + mcap.FRAME.size])
        if opcode != Opcode.CHUNK:
            return None, f"expected a chunk, got a record of opcode {opcode:#04x}"
        try:
            return examine(self.file, at, mcap.FRAME.size + length), ""
        except ChunkDamage as damage:
            return None, str(damage)

    def _around(self, piece: Piece, levels: list[int], *, is_known: bool) -> Iterator[Flaw]:
        """Compare the head of a chunk, and what stands before and after it, with its messages."""
        stored = piece.stored
        wanted = [level for level in piece.levels if level and level not in self.levels]
        if is_known and wanted != levels:
            text = f"expected the channels of floor maps {wanted} before it, got {levels}"
            yield Flaw("channel", stored.offset, text)
        self.levels += wanted
        if (stored.start_ns, stored.end_ns) != piece.times:
            text = f"expected the times {piece.times} of its messages, got "
            yield Flaw("times", stored.offset, f"{text}{(stored.start_ns, stored.end_ns)}")
        if self.file[piece.end : piece.end + len(piece.index)] != piece.index:
            text = "the MessageIndex is not that of the chunk's messages"
            yield Flaw("message index", piece.end, text)


def _durable_before(piece: Piece) -> Iterator[int]:
    """Yield what the Commit records of a chunk say of the events before them."""
    commit = layout("Commit")
    for channel, _, _, _, begin, end in piece.messages:
        data = piece.records[begin + mcap.MESSAGE.size : end]
        if channel == byte_layout.COMMIT_CHANNEL and len(data) == commit.dtype.itemsize:
            yield commit.unpack(data)["durable_before"]


def name_of_record(data: bytes) -> str:
    """Return what a Schema or a Channel is called, for messages."""
    body = data[mcap.FRAME.size :]
    if data[0] == Opcode.SCHEMA:
        return f"the Schema {mcap.read_record(Schema, body).name}"
    return f"the Channel {mcap.read_record(Channel, body).topic}"


Message = tuple[int, int, int, int, int, int]
"""Channel, sequence, log time, publish time, start and end in the chunk's records."""

_CHUNK_HEAD = re.compile(
    rb"\x06.{4}\0{4}"  # opcode; a length below 2^32
    rb".{16}.{4}\0{4}"  # start and end time; a size below 2^32
    rb".{4}(?:\0{4}|\x04\0{3}zstd)"  # CRC; the compression's name
    rb".{4}\0{4}",  # a stored size below 2^32
    re.DOTALL,
)
_MOST_HEAD_BYTES = 64
"""No such head is longer."""
_TIMES_END = 2**63  # times are handled as int64


@dataclass(frozen=True, slots=True)
class Piece:
    """A chunk whose messages are as they were written, as far as its CRC can see."""

    stored: StoredChunk
    records: bytes | memoryview
    messages: list[Message]
    index: bytes
    """The MessageIndex records that must follow it."""
    index_offsets: dict[int, int]
    """Channel id -> where its MessageIndex must begin, counted from the chunk's start."""
    counts: dict[int, int]
    """Channel id -> messages."""
    times: tuple[int, int]
    """Least and greatest log time of its messages."""
    happened: tuple[int, int]
    """The same of its events' happened times; `NO_SPAN` if it has no event."""

    @property
    def end(self) -> int:
        """Where in the file its MessageIndex records begin."""
        return self.stored.offset + self.stored.length

    @property
    def levels(self) -> list[int]:
        """The levels whose floor map is in it, ascending."""
        return [
            c - byte_layout.FLOOR_MAP_CHANNEL
            for c in self.counts
            if c >= byte_layout.FLOOR_MAP_CHANNEL
        ]

    def is_compressed_as_usual(self, file: FileBytes) -> bool:
        """Return whether its stored bytes are those that this zstd makes of its records.

        Some bits of a zstd frame mean nothing; only a closed segment's data CRC covers them.
        """
        import zstandard

        stored = self.stored
        if stored.compression != "zstd":
            return True
        usual = zstandard.ZstdCompressor(level=byte_layout.ZSTD_LEVEL).compress(self.records)
        return bool(file[stored.data_offset : stored.data_offset + stored.stored_size] == usual)

    def chunk_index(self) -> ChunkIndex:
        """Return what the summary must say of it."""
        stored = self.stored
        return ChunkIndex(
            chunk_length=stored.length,
            chunk_start_offset=stored.offset,
            compression=stored.compression,
            compressed_size=stored.stored_size,
            message_end_time=self.times[1],
            message_index_length=len(self.index),
            message_index_offsets={c: stored.offset + at for c, at in self.index_offsets.items()},
            message_start_time=self.times[0],
            uncompressed_size=stored.size,
        )


def examine(file: FileBytes, offset: int, length: int) -> Piece:
    """Return the chunk whose record lies at `offset`.

    Args:
        file: The file's bytes.
        offset: Where the record begins.
        length: Bytes of the record, frame included.

    Raises:
        ChunkDamage: It is not as it was written.
    """
    if offset + length > len(file):
        raise ChunkDamage("a chunk that ends after the file's end")
    try:
        data = file[offset : offset + length]
        stored = read_chunk_head(data, offset, length, offset)
    except struct.error:
        raise ChunkDamage("a chunk whose head does not fit into it") from None
    records = _records(data, stored)
    if crc32(records) != stored.crc:
        raise ChunkDamage(f"its CRC says {stored.crc:08x}, its bytes {crc32(records):08x}")
    messages = _messages(records)
    if not messages:
        raise ChunkDamage("a chunk without messages")
    log_times = [m[2] for m in messages]
    happened = [
        min(m[2], m[3])
        for m in messages
        if m[0] <= byte_layout.LAST_EVENT_CHANNEL or m[0] >= byte_layout.FLOOR_MAP_CHANNEL
    ]
    entries: dict[int, list[int]] = {}
    for channel, _, log_time, _, start, _ in messages:
        entries.setdefault(channel, []).extend((log_time, start))
    index, offsets = _message_indexes(entries, length)
    return Piece(
        stored=stored,
        records=records,
        messages=messages,
        index=index,
        index_offsets=offsets,
        counts={channel: len(entries[channel]) // 2 for channel in sorted(entries)},
        times=(min(log_times), max(log_times)),
        happened=(min(happened), max(happened)) if happened else NO_SPAN,
    )


def find_piece(file: FileBytes, start: int, end: int) -> Piece | None:
    """Return the next whole chunk that begins in start..end, found by its bytes alone."""
    while start < end:
        window = file[start : min(start + WINDOW_BYTES, end)]
        for at in _heads_in(window):
            length = mcap.FRAME.size + mcap.FRAME.unpack_from(window, at)[1]
            if start + at + length <= end:
                try:
                    return examine(file, start + at, length)
                except ChunkDamage:
                    pass
        start += max(1, len(window) - _MOST_HEAD_BYTES)  # a head may lie across the window's end
    return None


def _heads_in(data: memoryview) -> Iterator[int]:
    """Yield where what looks like a chunk's head begins, overlapping ones, too."""
    found = _CHUNK_HEAD.search(data)
    while found is not None:
        yield found.start()
        found = _CHUNK_HEAD.search(data, found.start() + 1)


def _records(record: memoryview, stored: StoredChunk) -> bytes | memoryview:
    if stored.compression not in ("", "zstd"):
        raise ChunkDamage(f"unknown compression {stored.compression!r}")
    start = stored.data_offset - stored.offset
    data = record[start : start + stored.stored_size]
    return unpack_records(data, stored.compression, stored.size)


def _messages(records: bytes | memoryview) -> list[Message]:
    """Return the messages of a chunk; they tile its records."""
    found = []
    at, end = 0, len(records)
    size, least, unpack = mcap.MESSAGE.size, mcap.MESSAGE_BODY_HEAD, mcap.MESSAGE.unpack_from
    while at < end:
        if at + size > end:
            raise ChunkDamage(f"a record is cut at byte {at} of the chunk's records")
        opcode, length, channel, sequence, log_time, publish_time = unpack(records, at)
        if opcode != Opcode.MESSAGE or length < least:
            raise ChunkDamage(f"no message at byte {at} of the chunk's records")
        if log_time >= _TIMES_END or publish_time >= _TIMES_END:
            raise ChunkDamage(f"a time beyond the year 2262 at byte {at} of the chunk's records")
        behind = at + mcap.FRAME.size + length
        found.append((channel, sequence, log_time, publish_time, at, behind))
        at = behind
    if at != end:
        raise ChunkDamage(f"the last record ends at byte {at} of {end}")
    return found


def _message_indexes(entries: dict[int, list[int]], start: int) -> tuple[bytes, dict[int, int]]:
    """Return the MessageIndex records of a chunk, and where each lies when they begin at start."""
    parts: list[bytes] = []
    offsets: dict[int, int] = {}
    for channel in sorted(entries):
        values = entries[channel]
        offsets[channel] = start
        packed = struct.pack(f"<{len(values)}Q", *values)
        parts += (mcap.message_index_head(channel, len(packed)), packed)
        start += mcap.MESSAGE_INDEX_HEAD_BYTES + len(packed)
    return b"".join(parts), offsets
