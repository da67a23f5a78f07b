"""The records of a segment without a summary: chunk after chunk, each whole by itself.

Message indexes have no CRC: how long they are follows from the chunk before them, and their bytes
are never looked at. Before a chunk with the first floor map of a level stands its Channel.
"""

from __future__ import annotations

import struct
from dataclasses import field
from pathlib import PurePath

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel
from numpy.typing import NDArray

from semmap_log.core.batches.distinct import distinct
from semmap_log.core.io.byte_source import ByteSource
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.store import records as mcap
from semmap_log.store.chunks import StoredChunk, read_chunk_head
from semmap_log.store.form import CHUNK_BYTES, FLOOR_MAP_CHANNEL, INDEX_METADATA, floor_map_topic
from semmap_log.store.pages import Page
from semmap_log.store.record_scan import ChunkDamage, ScannedRecords, heads_of, scan_one, walk

SMALL_BYTES = 2**14
"""Smaller chunks are walked in Python; for larger ones numpy pays."""


@dataclass(slots=True)
class ChunkRun:
    """Chunks that follow each other, about a MiB of records, each whole by itself."""

    chunks: list[StoredChunk] = field(default_factory=list)
    records: list[bytes | memoryview] = field(default_factory=list)
    offsets: list[NDArray[np.int64]] = field(default_factory=list)
    """Where each chunk's messages begin in its records."""
    ends: list[int] = field(default_factory=list)
    """Where in the file its message indexes end."""
    problem: str = ""
    """What is wrong with the chunk that should follow."""

    def __bool__(self) -> bool:
        return bool(self.chunks or self.problem)

    def page(self, path: PurePath, first_event: int) -> Page:
        """Return all records as one page."""
        starts = np.cumsum([0, *(len(records) for records in self.records[:-1])])
        offsets = [own + start for own, start in zip(self.offsets, starts, strict=True)]
        records = self.records[0] if len(self.records) == 1 else b"".join(self.records)
        place = self.chunks[0].offset
        return Page(records, first_event, path, place, ScannedRecords(np.concatenate(offsets)))


def read_part(source: ByteSource, at: int) -> ChunkRun:
    """Read chunks from an offset on, until they are many, or nothing more is there.

    Raises:
        UnreadableLogError: Some of them cannot be read.
    """
    part, size = ChunkRun(), 0
    window = _Window(source, at)
    while size < CHUNK_BYTES:
        try:
            start = _behind_channels(window, at)
            chunk = _chunk_at(window, start)
            if chunk is None:
                break
            records = chunk.records(window.data, window.start)
            offsets, channels = _messages(window, chunk, records)
        except _BehindWindow as behind:
            if not part.chunks:
                window = _Window(source, at, behind.end)
                continue
            break
        except ChunkDamage as damage:
            part.problem = str(damage)
            break
        at = chunk.offset + chunk.length + channels * mcap.MESSAGE_INDEX_HEAD_BYTES
        at += len(offsets) * mcap.MESSAGE_INDEX_ENTRY_BYTES
        part.chunks.append(chunk)
        part.records.append(records)
        part.offsets.append(offsets)
        part.ends.append(at)
        size += chunk.size
    return part


WINDOW_BYTES = 5 * CHUNK_BYTES // 4
"""So much is read for a part: a MiB of records with their message indexes."""


class _BehindWindow(Exception):  # noqa: N818  # a turn of events: the caller reads more
    """A record reaches behind what was read."""

    def __init__(self, end: int) -> None:
        super().__init__(end)
        self.end = end


class _Window:
    """Bytes of a file from an offset on, and where they lie."""

    def __init__(self, source: ByteSource, start: int, end: int = 0) -> None:
        """Read them, at least up to `end`."""
        self.start = start
        self.data = source.read(start, max(start + WINDOW_BYTES, end))
        self.size = source.size
        """Of the file."""

    def get(self, start: int, end: int) -> memoryview:
        """Return bytes, by their offsets in the file; fewer where it ends.

        Raises:
            _BehindWindow: They lie behind the window's end, and not behind the file's.
        """
        if min(end, self.size) > self.start + len(self.data):
            raise _BehindWindow(end)
        return self.data[start - self.start : end - self.start]


def _chunk_at(window: _Window, at: int) -> StoredChunk | None:
    """Return the chunk at an offset, all of it in the window; None at the end of the data.

    Raises:
        ChunkDamage: Something else is there, or a part of a chunk.
        _BehindWindow: It is not all in the window.
    """
    if at >= window.size or _is_closing_section(window, at):
        return None
    frame = window.get(at, at + mcap.FRAME.size)
    if frame[0] != Opcode.CHUNK:
        raise ChunkDamage("no chunk where one must be")
    if len(frame) < mcap.FRAME.size:
        raise ChunkDamage("a chunk that is cut")
    length = mcap.FRAME.size + mcap.FRAME.unpack(frame)[1]
    if at + length > window.size:
        raise ChunkDamage("a chunk that is cut, or has a wrong length")
    window.get(at, at + length)
    return read_chunk_head(window.data, at, length, window.start)


def _messages(
    window: _Window, chunk: StoredChunk, records: bytes | memoryview
) -> tuple[NDArray[np.int64], int]:
    """Return where a chunk's messages begin, and on how many channels they are."""
    if chunk.size >= SMALL_BYTES:
        behind = chunk.offset + chunk.length
        window.get(behind, behind + _most_index_bytes(chunk.size))
        offsets = scan_one(window.data, behind - window.start, records).offsets
        channels = len(distinct(heads_of(records, offsets)["channel_id"]))
    else:
        offsets = walk(records)
        channel_at = _CHANNEL_ID.unpack_from
        channels = len({channel_at(records, offset) for offset in offsets.tolist()})
    if not channels:
        raise ChunkDamage("a chunk without messages")
    return offsets, channels


_CHANNEL_ID = struct.Struct("<9xH")


def _most_index_bytes(size: int) -> int:
    """Return how long the message indexes of so many bytes of records can usually be."""
    return size // mcap.MESSAGE.size * mcap.MESSAGE_INDEX_ENTRY_BYTES + _INDEX_HEADS_BYTES


_INDEX_HEADS_BYTES = 2**10


def _behind_channels(window: _Window, at: int) -> int:
    """Return where the Channel records end that stand before a chunk with new floor maps.

    Raises:
        ChunkDamage: One is cut, or not of a floor map.
        _BehindWindow: One is not all in the window.
    """
    while at < window.size:
        frame = window.get(at, at + mcap.FRAME.size)
        if frame[0] != Opcode.CHANNEL:
            break
        end = window.size + 1
        if len(frame) == mcap.FRAME.size:
            end = at + mcap.FRAME.size + mcap.FRAME.unpack(frame)[1]
        if end > window.size:
            raise ChunkDamage("a Channel that is cut, or has a wrong length")
        _check_channel(window.get(at + mcap.FRAME.size, end))
        at = end
    return at


def _check_channel(body: memoryview) -> None:
    try:
        channel = mcap.read_record(Channel, body)
    except ValueError as error:
        raise ChunkDamage(str(error)) from None
    if channel.id < FLOOR_MAP_CHANNEL:
        raise ChunkDamage(f"a Channel {channel.id} where only those of floor maps may be")
    topic = floor_map_topic(channel.id - FLOOR_MAP_CHANNEL)
    if (channel.topic, channel.schema_id) != (topic.topic, topic.schema_id):
        raise ChunkDamage(f"a Channel {channel.id} that is not the floor map's")


def _is_closing_section(window: _Window, at: int) -> bool:
    """Tell whether what closes a segment begins at an offset, or as much of it as is there."""
    start = window.get(at, at + mcap.FRAME.size)
    if start[0] == Opcode.METADATA:
        name_at = at + mcap.FRAME.size + 4
        name = bytes(window.get(name_at, name_at + len(INDEX_METADATA)))
        return INDEX_METADATA.encode().startswith(name)
    return _DATA_END.startswith(bytes(start))


_DATA_END = mcap.FRAME.pack(Opcode.DATA_END, 4)
