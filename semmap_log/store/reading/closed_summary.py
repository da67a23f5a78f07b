"""What closing a segment wrote behind its data: by this it is opened without reading the rest."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import PurePath

from mcap.opcode import Opcode

from semmap_log.core.io.byte_source import ByteSource, blocks
from semmap_log.core.io.checksum import crc32
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.errors import CorruptLogError
from semmap_log.store import records as mcap
from semmap_log.store.opening_records import Statistics
from semmap_log.store.reading.chunk_table import LEAST_INDEX_BYTES, ChunkTable, rows_of_indexes
from semmap_log.store.record_scan import ChunkDamage

_FOOTER = struct.Struct("<QQI")
"""Where the summary begins, where its offsets begin, CRC of both and of the footer before it."""
_CRC = struct.Struct("<I")
_GROUP = struct.Struct("<BQBQQ")
"""A SummaryOffset: opcode, length; the group's opcode, where it begins, its length."""
FOOTER_BYTES = mcap.FRAME.size + _FOOTER.size + len(mcap.MAGIC)
DATA_END_BYTES = mcap.FRAME.size + 4


@dataclass(frozen=True, slots=True)
class ClosedSummary:
    """The summary of a closed segment, its CRC checked."""

    path: PurePath
    source: ByteSource
    tail: memoryview
    """The file's last bytes, as many as are in memory."""
    data_end: int
    """Where the DataEnd record begins."""
    data_crc: int
    """What that says of all bytes before it."""
    groups: Mapping[int, tuple[int, int]]
    """Opcode -> where the records of that kind begin and end in the file."""

    @property
    def most_chunks(self) -> int:
        """How many chunks the summary has room to tell of."""
        start, end = self.groups.get(Opcode.CHUNK_INDEX, (0, 0))
        return (end - start) // LEAST_INDEX_BYTES

    def group(self, opcode: int) -> tuple[int, memoryview]:
        """Return where the records of a kind begin in the file, and their bytes; often none."""
        start, end = self.groups.get(opcode, (self.data_end, self.data_end))
        return start, self.read(start, end)

    def read(self, start: int, end: int) -> memoryview:
        """Return bytes of the file: from memory, if they lie there already.

        Raises:
            UnreadableLogError: Some cannot be read.
        """
        base = self.source.size - len(self.tail)
        if start < base:
            return self.source.read(start, end)
        return self.tail[start - base : end - base]

    def chunks(self, data_start: int) -> ChunkTable:
        """Return the segment's chunks.

        Args:
            data_start: They lie behind this offset.

        Raises:
            CorruptLogError: What is said of them cannot be.
        """
        start, indexes = self.group(Opcode.CHUNK_INDEX)
        try:
            rows = rows_of_indexes(indexes, data_start=data_start, data_end=self.data_end)
        except ChunkDamage as damage:
            problem = f"its summary does not fit it: {damage}"
            raise CorruptLogError(self.path, start, problem) from None
        return ChunkTable(self.path, self.source, rows)

    def fits_data(self) -> bool:
        """Tell whether the data are what was written, by their CRC; reads them all.

        Raises:
            UnreadableLogError: Some cannot be read.
        """
        crc = 0
        for block in blocks(self.source, 0, self.data_end):
            crc = crc32(block, crc)
        return crc == self.data_crc

    def statistics(self) -> Statistics:
        """Return the segment's Statistics.

        Raises:
            CorruptLogError: There are none.
        """
        start, record = self.group(Opcode.STATISTICS)
        try:
            found: Statistics = mcap.read_record(Statistics, record[mcap.FRAME.size :])
        except ValueError as error:
            raise CorruptLogError(self.path, start, f"its summary: {error}") from None
        return found


_USUAL_BYTES = 2**15
"""A summary lies within, with the index of what happened, if its segment is small or compacted."""


def is_footer(data: memoryview) -> bool:
    """Tell whether a file's last bytes are a footer and the magic: no live segment's are."""
    if len(data) < FOOTER_BYTES or data[-len(mcap.MAGIC) :] != mcap.MAGIC:
        return False
    return bool(mcap.FRAME.unpack_from(data) == (Opcode.FOOTER, 20))


def read_summary(path: PurePath, source: ByteSource) -> ClosedSummary:
    """Return the summary of a closed segment.

    Raises:
        CorruptLogError: It is damaged.
    """
    tail = source.read(max(0, source.size - _USUAL_BYTES), source.size)
    footer_at = source.size - FOOTER_BYTES
    start, offsets_start, crc = _FOOTER.unpack_from(
        tail, len(tail) - FOOTER_BYTES + mcap.FRAME.size
    )
    if not DATA_END_BYTES < start <= offsets_start <= footer_at:
        raise CorruptLogError(path, footer_at, "its footer points outside the file")
    data_end = start - DATA_END_BYTES
    if source.size - len(tail) > data_end:
        tail = source.read(data_end, source.size)
    data = tail[data_end - source.size :]
    if crc32(data[DATA_END_BYTES : len(data) - len(mcap.MAGIC) - 4]) != crc:
        raise CorruptLogError(path, start, "its summary does not fit its CRC")
    if mcap.FRAME.unpack_from(data) != (Opcode.DATA_END, 4):
        raise CorruptLogError(path, data_end, "no DataEnd where its summary begins")
    groups = {}
    for at in range(offsets_start, footer_at, _GROUP.size):
        if at + _GROUP.size > footer_at:
            raise CorruptLogError(path, at, "its summary's offsets are cut")
        opcode, length, group, begins, size = _GROUP.unpack_from(data, at - data_end)
        if (opcode, length) != (Opcode.SUMMARY_OFFSET, _GROUP.size - mcap.FRAME.size):
            raise CorruptLogError(path, at, "no SummaryOffset where one must be")
        if not start <= begins <= begins + size <= offsets_start:
            raise CorruptLogError(path, at, "its summary's offsets point outside of it")
        groups[group] = (begins, begins + size)
    (data_crc,) = _CRC.unpack_from(data, mcap.FRAME.size)
    begin = min(groups.get(kind, (source.size, 0))[0] for kind in _WANTED)
    if source.size - begin <= SMALL_BYTES:
        tail = memoryview(bytes(tail[begin - source.size :]))
    return ClosedSummary(path, source, tail, data_end, data_crc, groups)


_WANTED = (
    Opcode.STATISTICS, Opcode.CHUNK_INDEX, Opcode.METADATA_INDEX, Opcode.ATTACHMENT_INDEX,
)  # fmt: skip
"""What is looked at of a summary; Schemas and Channels lie before it."""
SMALL_BYTES = 2**12
"""No more is kept of the summary of a segment of few chunks."""
