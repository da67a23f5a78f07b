"""What closing a segment wrote behind its data: by this it is opened without reading the rest."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Statistics

from semmap_log.errors import CorruptLogError
from semmap_log.log import records as mcap
from semmap_log.log.reading.chunk_table import ChunkTable, table_of_indexes

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

    path: Path
    file: memoryview
    data_end: int
    """Where the DataEnd record begins."""
    groups: Mapping[int, tuple[int, int]]
    """Opcode -> where the records of that kind begin and end."""

    def chunks(self, data_start: int) -> ChunkTable:
        """Return the segment's chunks.

        Args:
            data_start: They lie behind this offset.

        Raises:
            CorruptLogError: What is said of them cannot be.
        """
        start, end = self.groups.get(Opcode.CHUNK_INDEX, (self.data_end, self.data_end))
        return table_of_indexes(
            self.path, self.file, start, end, data_start=data_start, data_end=self.data_end
        )

    def fits_data(self) -> bool:
        """Tell whether the data are what was written, by their CRC; reads them all."""
        (crc,) = _CRC.unpack_from(self.file, self.data_end + mcap.FRAME.size)
        return bool(zlib.crc32(self.file[: self.data_end]) == crc)

    def statistics(self) -> Statistics:
        """Return the segment's Statistics.

        Raises:
            CorruptLogError: There are none.
        """
        start, end = self.groups.get(Opcode.STATISTICS, (0, 0))
        try:
            return mcap.read_record(Statistics, self.file[start + mcap.FRAME.size : end])
        except ValueError as error:
            raise CorruptLogError(self.path, start, f"its summary: {error}") from None


def read_summary(path: Path, file: memoryview) -> ClosedSummary:
    """Return the summary of a closed segment.

    Raises:
        CorruptLogError: It is damaged.
    """
    footer_at = len(file) - FOOTER_BYTES
    start, offsets_start, crc = _FOOTER.unpack_from(file, footer_at + mcap.FRAME.size)
    if not DATA_END_BYTES < start <= offsets_start <= footer_at:
        raise CorruptLogError(path, footer_at, "its footer points outside the file")
    if zlib.crc32(file[start : len(file) - len(mcap.MAGIC) - 4]) != crc:
        raise CorruptLogError(path, start, "its summary does not fit its CRC")
    data_end = start - DATA_END_BYTES
    if mcap.FRAME.unpack_from(file, data_end) != (Opcode.DATA_END, 4):
        raise CorruptLogError(path, data_end, "no DataEnd where its summary begins")
    groups = {}
    for at in range(offsets_start, footer_at, _GROUP.size):
        if at + _GROUP.size > footer_at:
            raise CorruptLogError(path, at, "its summary's offsets are cut")
        opcode, length, group, begins, size = _GROUP.unpack_from(file, at)
        if (opcode, length) != (Opcode.SUMMARY_OFFSET, _GROUP.size - mcap.FRAME.size):
            raise CorruptLogError(path, at, "no SummaryOffset where one must be")
        if not start <= begins <= begins + size <= offsets_start:
            raise CorruptLogError(path, at, "its summary's offsets point outside of it")
        groups[group] = (begins, begins + size)
    return ClosedSummary(path, file, data_end, groups)
