"""A chunk that is being filled: records one by one, and whole blocks of them."""

from __future__ import annotations

import hashlib
import struct
from dataclasses import dataclass, field
from itertools import accumulate, count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.store.batch_records import Block
from semmap_log.store.chunks import NO_SPAN, BuiltChunk, assemble_chunk


@dataclass(slots=True)
class ChunkBuilder:
    """Message records for a chunk, whose log times are one nanosecond apart."""

    start_ns: int
    time: int = -1
    """Log time of the next record."""
    size: int = 0
    span: tuple[int, int] = NO_SPAN
    """Least and greatest happened time of its events."""
    _records: list[bytes] = field(default_factory=list)
    """Single records added since the last block."""
    _channels: list[int] = field(default_factory=list)
    _blocks: list[Block] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.time = self.start_ns

    def add(self, channel: int, record: bytes) -> None:
        """Add one record."""
        self._records.append(record)
        self._channels.append(channel)
        self.size += len(record)
        self.time += 1

    def add_block(self, block: Block) -> None:
        """Add many, whose first has the time that is next."""
        self._close_block()
        self._blocks.append(block)
        self.size += len(block.records)
        self.time += block.count
        self.span = wider(wider(self.span, block.span[0]), block.span[1])

    def hash_into(self, digests: dict[int, Any]) -> None:
        """Take its records into the digests of their channels."""
        for channel, records in self._by_channel():
            known = digests.get(channel)
            if known is None:
                digests[channel] = hashlib.sha256(records)
            else:
                known.update(records)

    def chunk(self) -> BuiltChunk:
        """Return the chunk."""
        built = assemble_chunk(
            b"".join([*(block.records for block in self._blocks), *self._records]),
            dict(sorted(self._entries().items())),
            times=(self.start_ns, self.time - 1),
            happened=self.span,
        )
        if self._blocks:
            built.offsets = self._offsets()
        return built

    def _by_channel(self) -> list[tuple[int, bytes]]:
        """Return (channel, records in order) of its blocks and of the records that follow them."""
        found = [pair for block in self._blocks for pair in block.of_channel.items()]
        return found + list(_of_channels(self._records, self._channels).items())

    def _entries(self) -> dict[int, bytes]:
        """Return the MessageIndex entries of each channel: log time and offset of each record."""
        entries: dict[int, list[bytes]] = {}
        time, offset = self.start_ns, 0
        for block in self._blocks:
            for channel, (steps, offsets) in block.places.items():
                rows = np.empty((len(steps), 2), "<i8")
                rows[:, 0], rows[:, 1] = steps + time, offsets + offset
                entries.setdefault(channel, []).append(rows.tobytes())
            time += block.count
            offset += len(block.records)
        for channel, known in _places(self._records, self._channels, time, offset).items():
            entries.setdefault(channel, []).append(struct.pack(f"<{len(known)}Q", *known))
        return {channel: b"".join(parts) for channel, parts in entries.items()}

    def _offsets(self) -> NDArray[np.int64]:
        """Return where each record begins."""
        sizes = [block.sizes for block in self._blocks]
        sizes.append(np.fromiter(map(len, self._records), np.int64))
        joined = np.concatenate(sizes)
        offsets: NDArray[np.int64] = np.cumsum(joined) - joined
        return offsets

    def _close_block(self) -> None:
        """Make the records that came one by one a block, since another will follow."""
        if not self._records:
            return
        places = _places(self._records, self._channels, 0, 0)
        pairs = {c: np.array(known, np.int64).reshape(-1, 2) for c, known in places.items()}
        self._blocks.append(
            Block(
                b"".join(self._records),
                _of_channels(self._records, self._channels),
                {channel: (rows[:, 0], rows[:, 1]) for channel, rows in pairs.items()},
                np.fromiter(map(len, self._records), np.int64),
                self.span,
            )
        )
        self._records, self._channels = [], []


def wider(span: tuple[int, int], time: int) -> tuple[int, int]:
    """Return a span that holds a time, too."""
    if span is NO_SPAN:
        return time, time
    low, high = span
    return (time, high) if time < low else (low, time) if time > high else span


def _of_channels(records: list[bytes], channels: list[int]) -> dict[int, bytes]:
    """Return the records of each channel, concatenated."""
    if channels and len(channels) == channels.count(channels[0]):
        return {channels[0]: b"".join(records) if len(records) > 1 else records[0]}
    return {
        channel: b"".join([r for r, its in zip(records, channels, strict=True) if its == channel])
        for channel in sorted(set(channels))
    }


def _places(
    records: list[bytes], channels: list[int], time: int, offset: int
) -> dict[int, list[int]]:
    """Return log time and offset of each record, by channel; the first's are given."""
    entries: dict[int, list[int]] = {}
    for channel, its_time, its_offset in zip(
        channels, count(time), accumulate(map(len, records), initial=offset)
    ):  # the offsets are one more: where the next record would begin
        known = entries.get(channel)
        if known is None:
            entries[channel] = [its_time, its_offset]
        else:
            known += (its_time, its_offset)
    return entries
