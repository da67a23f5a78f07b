"""A segment's records, walked byte for byte: its head, its chunks, what lies between and behind.

A closed segment's summary is not asked where the chunks are, and no length is believed that leads
astray: behind a bad place the next whole chunk is found by its bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from semmap_log.core.messages import layout
from semmap_log.store import records as mcap
from semmap_log.store.chunk_unpacking import check_sizes
from semmap_log.store.form import COMMIT_CHANNEL, FLOOR_MAP_CHANNEL, floor_map_topic
from semmap_log.store.header import SegmentHeader
from semmap_log.store.newer import Newer, is_later_kind
from semmap_log.store.record_scan import ChunkDamage
from semmap_log.store.segment import Head, channel_record
from semmap_log.store.verification.file_bytes import FileBytes
from semmap_log.store.verification.pieces import Piece, examine, find_piece

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
    """Bytes that are no whole chunk, with whole chunks behind them."""

    start: int
    end: int
    text: str


class SegmentWalk:
    """What lies in a segment behind its header; iterate once, then look at the rest."""

    def __init__(self, file: FileBytes, header_end: int, header: SegmentHeader | None) -> None:
        """Begin behind the header; at 0, and without one, where it cannot be read."""
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
            if is_known:  # else it is the head that cannot be read, and that was said
                yield Gap(start, found.stored.offset, self.problem)
            at, is_known = found.stored.offset, False
        self.pieces_end = min(at, size)

    def is_durable_behind(self, start: int, event: int) -> bool:
        """Tell whether a whole chunk behind `start` proves that `event` was on the disk once."""
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
            if opcode != Opcode.CHANNEL or channel <= FLOOR_MAP_CHANNEL:
                break
            data = mcap.record(channel_record(floor_map_topic(channel - FLOOR_MAP_CHANNEL)))
            if self.file[at : at + len(data)] != data:
                break
            levels.append(channel - FLOOR_MAP_CHANNEL)
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
        """Compare what stands before, in the head of and behind a chunk with its messages."""
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
        if channel == COMMIT_CHANNEL and len(data) == commit.dtype.itemsize:
            yield commit.unpack(data)["durable_before"]


def name_of_record(data: bytes) -> str:
    """Return what a Schema or a Channel is called, for messages."""
    body = data[mcap.FRAME.size :]
    if data[0] == Opcode.SCHEMA:
        return f"the Schema {mcap.read_record(Schema, body).name}"
    return f"the Channel {mcap.read_record(Channel, body).topic}"
