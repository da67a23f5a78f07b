"""The records of a segment without a summary: chunk after chunk, each whole by itself.

Message indexes have no CRC: how long they are follows from the chunk before them, and their bytes
are never looked at. Before a chunk with the first floor map of a level stands its Channel.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel
from numpy.typing import NDArray

from semmap_log.log import records as mcap
from semmap_log.log.chunks import StoredChunk, read_chunk_head
from semmap_log.log.form import (
    CHUNK_BYTES,
    FLOOR_MAP_CHANNEL,
    INDEX_METADATA,
    floor_map_topic,
)
from semmap_log.log.pages import Page
from semmap_log.log.walking import ChunkDamage, Walked, frames, heads_of, walk, walk_one

SMALL_BYTES = 2**14
"""Smaller chunks are walked in Python; for larger ones numpy pays."""


@dataclass(slots=True)
class Part:
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

    def page(self, path: Path, first_event: int) -> Page:
        """Return all records as one page."""
        starts = np.cumsum([0, *(len(records) for records in self.records[:-1])])
        offsets = [own + start for own, start in zip(self.offsets, starts, strict=True)]
        records = self.records[0] if len(self.records) == 1 else b"".join(self.records)
        place = self.chunks[0].offset
        return Page(records, first_event, path, place, Walked(np.concatenate(offsets)))


def read_part(file: memoryview, at: int) -> Part:
    """Read chunks from an offset on, until they are many, or nothing more is there."""
    part, size = Part(), 0
    while size < CHUNK_BYTES:
        try:
            chunk = _chunk_at(file, _behind_channels(file, at))
            if chunk is None:
                break
            records = chunk.records(file)
            offsets, channels = _messages(file, chunk, records)
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


def _chunk_at(file: memoryview, at: int) -> StoredChunk | None:
    """Return the chunk at an offset; None at the end of the data.

    Raises:
        ChunkDamage: Something else is there, or a part of a chunk.
    """
    if at >= len(file) or _is_closing_section(file, at):
        return None
    if file[at] != Opcode.CHUNK:
        raise ChunkDamage("no chunk where one must be")
    if at + mcap.FRAME.size > len(file):
        raise ChunkDamage("a chunk that is cut")
    length = mcap.FRAME.size + mcap.FRAME.unpack_from(file, at)[1]
    if at + length > len(file):
        raise ChunkDamage("a chunk that is cut, or has a wrong length")
    return read_chunk_head(file, at, length)


def _messages(
    file: memoryview, chunk: StoredChunk, records: bytes | memoryview
) -> tuple[NDArray[np.int64], int]:
    """Return where a chunk's messages begin, and on how many channels they are."""
    if chunk.size >= SMALL_BYTES:
        offsets = walk_one(file, chunk.offset + chunk.length, records).offsets
        channels = len(np.unique(heads_of(records, offsets)["channel_id"]))
    else:
        offsets = walk(records)
        channel_at = _CHANNEL_ID.unpack_from
        channels = len({channel_at(records, offset) for offset in offsets.tolist()})
    if not channels:
        raise ChunkDamage("a chunk without messages")
    return offsets, channels


_CHANNEL_ID = struct.Struct("<9xH")


def _behind_channels(file: memoryview, at: int) -> int:
    """Return where the Channel records end that stand before a chunk with new floor maps.

    Raises:
        ChunkDamage: One is cut, or not of a floor map.
    """
    while at < len(file) and file[at] == Opcode.CHANNEL:
        found = next(frames(file, at, len(file)), None)
        if found is None:
            raise ChunkDamage("a Channel that is cut, or has a wrong length")
        end = at + found[2]
        _check_channel(file[at + mcap.FRAME.size : end])
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


def _is_closing_section(file: memoryview, at: int) -> bool:
    """Tell whether what closes a segment begins at an offset, or as much of it as is there."""
    if file[at] == Opcode.METADATA:
        name_at = at + mcap.FRAME.size + 4
        name = bytes(file[name_at : name_at + len(INDEX_METADATA)])
        return INDEX_METADATA.encode().startswith(name)
    return _DATA_END.startswith(bytes(file[at : at + len(_DATA_END)]))


_DATA_END = mcap.FRAME.pack(Opcode.DATA_END, 4)
