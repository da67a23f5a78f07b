"""A segment's records, walked byte for byte: its head, its chunks, what lies between and behind.

A closed segment's summary is not asked where the chunks are, and no length is believed that leads
astray: behind a bad place the next whole chunk is found by its bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

from mcap.opcode import Opcode

from semmap_log.log import records as mcap
from semmap_log.log.form import COMMIT_CHANNEL, FLOOR_MAP_CHANNEL, floor_map_topic, topics
from semmap_log.log.segment import channel_record, schema_records
from semmap_log.log.verification.file_bytes import FileBytes
from semmap_log.log.verification.pieces import Piece, examine, find_piece
from semmap_log.log.walking import ChunkDamage
from semmap_log.messages import layout

_CHANNEL = struct.Struct("<BQH")
"""Of a Channel record: opcode, length, channel id."""


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

    def __init__(self, file: FileBytes, header_end: int) -> None:
        """Begin behind the header; 0: it cannot be read."""
        self.file = file
        self.levels: list[int] = []
        """Levels whose channels stand before chunks, ascending as written."""
        self.head_end = 0
        """Where the first chunk must begin; 0: not known."""
        self.pieces_end = 0
        """Once all is walked: where what follows the last chunk begins."""
        self.problem = ""
        """Why no chunk begins there; empty at the file's end."""
        self._header_end = header_end

    def __iter__(self) -> Iterator[Piece | Flaw | Gap]:
        """Yield chunks in file order, and what is wrong between them."""
        if self._header_end:
            yield from self._schemas_and_channels()
        at, size, is_known = self.head_end, len(self.file), self._header_end > 0
        while at < size:
            levels, start = self._floor_map_channels(at)
            piece, self.problem = self._piece(start)
            if piece is not None:
                yield from self._around(piece, levels, is_known=is_known)
                yield piece
                at, is_known = min(piece.end + len(piece.index), size), True
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
            start = piece.end
        return False

    def _schemas_and_channels(self) -> Iterator[Flaw]:
        """Compare every Schema and Channel with ours, byte for byte."""
        at = self._header_end
        for name, data in schemas_and_channels():
            if self.file[at : at + len(data)] != data:
                yield Flaw("schema", at, f"{name} is not ours")
            at += len(data)
        self.head_end = at

    def _floor_map_channels(self, at: int) -> tuple[list[int], int]:
        """Return whose channels stand at `at`, byte for byte as we write them, and their end."""
        levels: list[int] = []
        while at + _CHANNEL.size <= len(self.file):
            opcode, _, channel = _CHANNEL.unpack(self.file[at : at + _CHANNEL.size])
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


@cache
def schemas_and_channels() -> tuple[tuple[str, bytes], ...]:
    """Return the name and the bytes of each Schema and Channel, in order."""
    schemas = [(f"the Schema {one.name}", mcap.record(one)) for one in schema_records()]
    channels = [(f"the Channel {t.topic}", mcap.record(channel_record(t))) for t in topics()]
    return (*schemas, *channels)
