"""All chunks of a segment as columns: what its summary, or a scan, says of them.

Nothing here is believed when a chunk is read: its own head must agree with its row.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any, overload

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import distinct
from semmap_log.core.io.byte_source import ByteSource
from semmap_log.errors import CorruptLogError
from semmap_log.store import records as mcap
from semmap_log.store.chunks import MOST_HEAD_BYTES, StoredChunk, read_chunk_head
from semmap_log.store.pages import bits_of_channels
from semmap_log.store.record_scan import (
    FREE_CHUNK_BYTES,
    MAX_CHUNK_BYTES,
    MOST_RATIO,
    ChunkDamage,
    check_sizes,
    gather,
)

ROW: np.dtype[np.void] = np.dtype(
    [
        ("offset", "<i8"),
        ("length", "<i8"),
        ("start_ns", "<i8"),
        ("end_ns", "<i8"),
        ("size", "<i8"),
        ("stored_size", "<i8"),
        ("compression", "S4"),
        ("kinds", "<u4"),
        ("behind", "<i8"),
    ]
)
"""As the fields of `StoredChunk`; which kinds of record are in it: `pages`; and where in the
file its message indexes end."""

SMALL_BYTES = 2**15
"""Chunks of fewer records cost more to check one by one than their bytes do."""


GAP_BYTES = 2**10
"""So much between two chunks is read with them: to skip it would take longer."""


@dataclass(frozen=True, slots=True)
class ChunkTable(Sequence[StoredChunk]):
    """Chunks in file order; as a sequence, each with its head read from the file."""

    path: PurePath
    """Their file, for messages."""
    source: ByteSource
    rows: NDArray[np.void]
    """As `ROW`."""

    @classmethod
    def of(
        cls,
        path: PurePath,
        source: ByteSource,
        chunks: Sequence[StoredChunk],
        kinds: NDArray[np.uint32],
        behind: Sequence[int],
    ) -> ChunkTable:
        """Return the table of chunks that were read.

        Args:
            path: Their file.
            source: Its bytes.
            chunks: What their heads say.
            kinds: The kinds of record in each.
            behind: Where the message indexes of each end.
        """
        rows = np.zeros(len(chunks), ROW)
        for i, chunk in enumerate(chunks):
            rows[i] = (*_head_of(chunk), 0, 0)
        rows["kinds"], rows["behind"] = kinds, behind
        return cls(path, source, rows)

    def __len__(self) -> int:
        return len(self.rows)

    @overload
    def __getitem__(self, place: int) -> StoredChunk: ...
    @overload
    def __getitem__(self, place: slice) -> ChunkTable: ...
    def __getitem__(self, place: int | slice) -> StoredChunk | ChunkTable:
        """Return a chunk, or the table of some.

        Raises:
            CorruptLogError: The chunk's head does not agree with the table.
        """
        if isinstance(place, slice):
            return self.chosen(place)
        offset = int(self.rows["offset"][place])
        head = self.source.read(offset, offset + MOST_HEAD_BYTES)
        return self.chunk_in(head, offset, place)

    def __iter__(self) -> Iterator[StoredChunk]:
        return (self[i] for i in range(len(self)))

    def chunk_in(self, data: memoryview, base: int, place: int) -> StoredChunk:
        """Return a chunk whose head is at hand.

        Args:
            data: Bytes of the file, its head among them.
            base: Where in the file they begin.
            place: The chunk's.

        Raises:
            CorruptLogError: The head does not agree with the table.
        """
        try:
            return _chunk_in(data, base, self.rows[place])
        except ChunkDamage as damage:
            raise CorruptLogError(self.path, int(self.rows["offset"][place]), str(damage)) from None

    def loaded(self) -> LoadedChunks:
        """Return them, at least one, with their bytes, and those of their message indexes.

        Raises:
            UnreadableLogError: Some cannot be read.
        """
        starts, ends = self.rows["offset"], self.rows["behind"]
        is_gap = starts[1:] - ends[:-1] > GAP_BYTES
        if not is_gap.any():
            start, end = self.span()
            return LoadedChunks(self, self.source.read(start, end), np.full(len(self), start))
        firsts = np.append(0, np.flatnonzero(is_gap) + 1)
        counts = np.diff(firsts, append=len(starts))
        starts, ends = starts[firsts], ends[firsts + counts - 1]
        data = self.source.read_ranges(list(zip(starts.tolist(), ends.tolist(), strict=True)))
        bases = starts - np.cumsum(ends - starts) + (ends - starts)
        return LoadedChunks(self, data, np.repeat(bases, counts))

    def chosen(self, places: slice | NDArray[Any]) -> ChunkTable:
        """Return the table of some: their places, or for each whether it is wanted."""
        return ChunkTable(self.path, self.source, self.rows[places])

    def extended(self, source: ByteSource, more: ChunkTable | None = None) -> ChunkTable:
        """Return this table with more chunks appended, in a file that may have grown."""
        rows = self.rows if more is None else np.concatenate((self.rows, more.rows))
        return ChunkTable(self.path, source, rows)

    def having(self, kinds: int) -> NDArray[np.intp]:
        """Return the places of those with a record of one of these kinds: `pages`."""
        return np.flatnonzero(self.rows["kinds"] & np.uint32(kinds))

    @property
    def are_plain(self) -> NDArray[np.bool_]:
        """Whether each is uncompressed."""
        plain: NDArray[np.bool_] = self.rows["compression"] == b""
        return plain

    @property
    def are_small(self) -> bool:
        """Whether they are uncompressed, and small on the average."""
        small = int(self.rows["size"].sum()) < SMALL_BYTES * len(self)
        return small and bool(self.are_plain.all())

    def span(self) -> tuple[int, int]:
        """Return where the first one begins in the file, and where all of the last one ends."""
        return int(self.rows["offset"][0]), int(self.rows["behind"][-1])

    def starting_by(self, time_ns: int) -> int:
        """Return how many chunks start at or before that log time."""
        return int(np.searchsorted(self.rows["start_ns"], time_ns, "right"))

    def groups(self, most_bytes: int) -> Iterator[ChunkTable]:
        """Yield them in order, in groups of so many bytes at most: all compressed, or none.

        One that is larger is alone.
        """
        reached, is_plain = np.cumsum(self.rows["size"]), self.are_plain
        turns = np.flatnonzero(is_plain[1:] != is_plain[:-1]) + 1
        at = 0
        while at < len(self):
            before = int(reached[at] - self.rows["size"][at])
            end = max(at + 1, int(np.searchsorted(reached, before + most_bytes, "right")))
            turn = int(np.searchsorted(turns, at, "right"))
            end = min(end, *turns[turn : turn + 1].tolist(), len(self))
            yield self[at:end]
            at = end


@dataclass(frozen=True, slots=True)
class LoadedChunks:
    """Chunks with their bytes, and those of their message indexes, in memory."""

    table: ChunkTable
    data: memoryview
    bases: NDArray[np.int64]
    """For each chunk: where in the file `data` would begin if all before it were in there, too."""

    @property
    def starts(self) -> NDArray[np.int64]:
        """Where each Chunk record begins in `data`."""
        starts: NDArray[np.int64] = self.table.rows["offset"] - self.bases
        return starts

    @property
    def index_starts(self) -> NDArray[np.int64]:
        """Where the message indexes of each begin in `data`."""
        behind: NDArray[np.int64] = self.starts + self.table.rows["length"]
        return behind

    def records(self, place: int, into: memoryview | None = None) -> bytes | memoryview:
        """Return the records of one, CRC checked.

        Args:
            place: The chunk's.
            into: Where to put them, of their size; None: anywhere.

        Raises:
            CorruptLogError: Its head does not agree with the table.
            ChunkDamage: They are not what was written.
        """
        base = int(self.bases[place])
        return self.table.chunk_in(self.data, base, place).records(self.data, base, into)


def _chunk_in(data: memoryview, base: int, row: np.void) -> StoredChunk:
    offset, length = int(row["offset"]), int(row["length"])
    if mcap.FRAME.unpack_from(data, offset - base) != (Opcode.CHUNK, length - mcap.FRAME.size):
        raise ChunkDamage("no chunk of the length that the segment's summary says")
    chunk = read_chunk_head(data, offset, length, base)
    if _head_of(chunk) != row.item()[:-2]:
        raise ChunkDamage("its head is not what the segment's summary says")
    return chunk


def _head_of(chunk: StoredChunk) -> tuple[int, int, int, int, int, int, bytes]:
    return (
        chunk.offset,
        chunk.length,
        chunk.start_ns,
        chunk.end_ns,
        chunk.size,
        chunk.stored_size,
        chunk.compression.encode(),
    )


_INDEX_HEAD: np.dtype[np.void] = np.dtype(
    {
        "names": ["opcode", "start_ns", "end_ns", "offset", "length", "map_size"],
        "formats": ["u1", "<i8", "<i8", "<i8", "<i8", "<u4"],
        "offsets": [0, 9, 17, 25, 33, 41],
        "itemsize": 45,
    }
)
"""The fixed beginning of a ChunkIndex record."""
_INDEXES_BYTES: np.dtype[np.void] = np.dtype([("size", "<i8")])
"""Follows its map: the length of the chunk's message indexes."""
_INDEX_TAIL: np.dtype[np.void] = np.dtype([("stored_size", "<i8"), ("size", "<i8")])
"""Its fixed end; the compression's name lies before."""
_MAP_ENTRY: np.dtype[np.void] = np.dtype(
    {"names": ["channel_id"], "formats": ["<u2"], "offsets": [0], "itemsize": 10}
)
"""A channel, and where its MessageIndex lies; such entries follow the fixed beginning."""
_INDEX_FIXED_BYTES = 64
"""Of a ChunkIndex's body: all but the map of message indexes and the compression's name."""
LEAST_INDEX_BYTES = mcap.FRAME.size + _INDEX_FIXED_BYTES
"""No ChunkIndex record is shorter."""
_CHUNK_HEAD_BYTES = mcap.FRAME.size + 40
"""Of a Chunk record, the compression's name left out."""


def rows_of_indexes(indexes: memoryview, *, data_start: int, data_end: int) -> NDArray[np.void]:
    """Return the chunks that the ChunkIndex records of a summary list, as `ROW`.

    Args:
        indexes: These records; their CRC was checked.
        data_start: Chunks lie from here on …
        data_end: … to here.

    Raises:
        ChunkDamage: They contradict themselves, or each other.
    """
    offsets, lengths = _frames_of_indexes(indexes, 0, len(indexes))
    rows = _rows_of_indexes(indexes, offsets, lengths)
    _check_rows(rows, data_start, data_end)
    return rows


def _frames_of_indexes(
    file: memoryview, start: int, end: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return where each ChunkIndex begins, and the length of its body."""
    offsets: list[int] = []
    lengths: list[int] = []
    at, same, unpack = start, 0, struct.Struct("<xQ").unpack_from
    while at < end:
        if at + mcap.FRAME.size > end:
            raise ChunkDamage("a ChunkIndex is cut")
        (length,) = unpack(file, at)
        if not _INDEX_FIXED_BYTES <= length <= end - at - mcap.FRAME.size:
            raise ChunkDamage("a ChunkIndex has a wrong length")
        same = same + 1 if lengths and lengths[-1] == length else 0
        count = 1
        if same == _PATIENCE:
            count, same = _alike(file, at, end, length), 0
        stride = mcap.FRAME.size + length
        offsets += range(at, at + count * stride, stride)
        lengths += [length] * count
        at += count * stride
    return np.array(offsets, np.int64), np.array(lengths, np.int64)


_PATIENCE = 16
"""After so many records of one length it is looked whether there are many more."""


def _alike(file: memoryview, at: int, end: int, length: int) -> int:
    """Return how many consecutive records have that length, from one that does."""
    stride = mcap.FRAME.size + length
    lengths = np.ndarray((end - at) // stride, "<i8", file, at + 1, strides=(stride,))
    count, step = 1, _PATIENCE
    while count < len(lengths):
        is_other = lengths[count : count + step] != length
        if is_other.any():
            return count + int(is_other.argmax())
        count, step = min(count + step, len(lengths)), 4 * step
    return count


def _rows_of_indexes(
    file: memoryview, offsets: NDArray[np.int64], lengths: NDArray[np.int64]
) -> NDArray[np.void]:
    head = gather(file, offsets, _INDEX_HEAD)
    if (head["opcode"] != Opcode.CHUNK_INDEX).any():
        raise ChunkDamage("a record among the ChunkIndexes that is not a ChunkIndex")
    ends = offsets + mcap.FRAME.size + lengths
    tail = gather(file, ends - _INDEX_TAIL.itemsize, _INDEX_TAIL)
    rows = np.zeros(len(offsets), ROW)
    for name in ("offset", "length", "start_ns", "end_ns"):
        rows[name] = head[name]
    for name in ("stored_size", "size"):
        rows[name] = tail[name]
    name_sizes = lengths - _INDEX_FIXED_BYTES - head["map_size"].astype(np.int64)
    for size in distinct(name_sizes).tolist():
        if not 0 <= size <= ROW["compression"].itemsize:
            raise ChunkDamage("a ChunkIndex names an unknown compression")
        if size:
            mine = name_sizes == size
            places = ends[mine] - _INDEX_TAIL.itemsize - size
            names = gather(file, places, np.dtype([("name", f"S{size}")]))
            rows["compression"][mine] = names["name"]
    map_sizes = head["map_size"]
    rows["kinds"] = _kinds_of_indexes(file, offsets, map_sizes)
    sizes_at = offsets + _INDEX_HEAD.itemsize + map_sizes
    rows["behind"] = (
        rows["offset"] + rows["length"] + gather(file, sizes_at, _INDEXES_BYTES)["size"]
    )
    fixed = rows["stored_size"] + _CHUNK_HEAD_BYTES + name_sizes
    if (fixed != rows["length"]).any():
        raise ChunkDamage("a ChunkIndex whose sizes contradict each other")
    return rows


def _kinds_of_indexes(
    file: memoryview, offsets: NDArray[np.int64], map_sizes: NDArray[np.uint32]
) -> NDArray[np.uint32]:
    """Return the kinds of record in each chunk: it has a message index for each channel."""
    counts = (map_sizes // _MAP_ENTRY.itemsize).astype(np.int64)
    if (map_sizes % _MAP_ENTRY.itemsize).any():
        raise ChunkDamage("a ChunkIndex with a part of an entry")
    owners = np.repeat(np.arange(len(offsets)), counts)
    within = np.arange(len(owners)) - np.repeat(np.cumsum(counts) - counts, counts)
    places = offsets[owners] + _INDEX_HEAD.itemsize + within * _MAP_ENTRY.itemsize
    kinds = np.zeros(len(offsets), np.uint32)
    channels = gather(file, places, _MAP_ENTRY)["channel_id"]
    np.bitwise_or.at(kinds, owners, bits_of_channels(channels))
    return kinds


def _check_rows(rows: NDArray[np.void], data_start: int, data_end: int) -> None:
    offset, length = rows["offset"], rows["length"]
    plain = rows["compression"] == b""
    if (rows["stored_size"] < 0).any() or (length < 0).any():
        raise ChunkDamage("a chunk of negative size")
    if (offset > data_end).any() or (length > data_end).any():
        raise ChunkDamage("a chunk outside the data")
    by_ratio = MOST_RATIO * np.minimum(rows["stored_size"], MAX_CHUNK_BYTES)
    most = np.minimum(np.maximum(by_ratio, FREE_CHUNK_BYTES), MAX_CHUNK_BYTES)
    if ((rows["size"] < 0) | (rows["size"] > most)).any():
        raise ChunkDamage("a chunk larger than any is")
    check_sizes(int(rows["size"].sum()), int(rows["stored_size"].sum()))
    if (rows["size"] != rows["stored_size"])[plain].any():
        raise ChunkDamage("an uncompressed chunk of two sizes")
    behind = rows["behind"]
    if len(rows) and (offset[0] < data_start or behind[-1] > data_end):
        raise ChunkDamage("a chunk outside the data")
    if (offset + length > behind).any():
        raise ChunkDamage("message indexes of negative size")
    if (behind[:-1] > offset[1:]).any():
        raise ChunkDamage("chunks that overlap")
