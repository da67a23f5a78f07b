"""What closing a segment wrote after its data: opens it without reading the rest.

For each chunk it states how many events it has, and when the earliest and the latest happened. A
live segment's spans are found by scanning it; closing writes them as `semmap_index`. With them a
question about a moment skips what cannot matter, however late the events came.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import PurePath

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from semmap_log.core.io.byte_source import ByteSource, blocks
from semmap_log.core.io.checksum import crc32
from semmap_log.errors import CorruptLogError
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import INDEX_METADATA, kinds_of
from semmap_log.store.chunks import NO_SPAN
from semmap_log.store.header import next_events_in_index, read_index
from semmap_log.store.opening_records import Metadata, MetadataIndex, Statistics
from semmap_log.store.pages import Page
from semmap_log.store.reading.chunk_table import LEAST_INDEX_BYTES, ChunkTable, rows_of_indexes
from semmap_log.store.record_scan import ChunkDamage, frames

SPAN: np.dtype[np.void] = np.dtype([("events", "<i8"), ("least", "<i8"), ("greatest", "<i8")])
"""How many; times in nanoseconds UTC, inclusive, never after recording; -1 where there are none."""

_LAST = np.iinfo(np.int64).max


def spans_of_chunks(page: Page, ends: NDArray[np.intp]) -> NDArray[np.void]:
    """Return the span of each chunk of a page, as `SPAN`.

    Args:
        page: Their records.
        ends: How many messages there are to the end of each; each has at least one.
    """
    heads = page.heads
    happened = np.minimum(heads["publish_time"], heads["log_time"])
    is_event = kinds_of(heads["channel_id"]) > 0
    starts = np.append(0, ends[:-1])
    spans = np.empty(len(ends), SPAN)
    spans["events"] = np.add.reduceat(is_event, starts, dtype=np.int64)
    greatest = np.maximum.reduceat(np.where(is_event, happened, -1), starts)
    least = np.minimum.reduceat(np.where(is_event, happened, _LAST), starts)
    spans["least"] = np.where(greatest < 0, NO_SPAN[0], least)
    spans["greatest"] = greatest
    return spans


def spans_of_summary(summary: ClosedSummary) -> NDArray[np.void]:
    """Return the span of each chunk of a closed segment, as `SPAN`.

    Raises:
        CorruptLogError: Its index is missing or damaged.
    """
    at, index = index_of(summary)
    try:
        columns = read_index(index, most=summary.most_chunks)
        if len({len(column) for column in columns}) > 1:  # one of one value would fit any other
            raise ValueError("its columns are not of one length")  # noqa: TRY301
        spans = np.empty(len(columns[0]), SPAN)
        spans["events"], spans["least"], spans["greatest"] = columns
    except (ValueError, KeyError) as error:
        raise CorruptLogError(summary.path, at, f"its {INDEX_METADATA}: {error}") from None
    return spans


def next_events_of_summary(summary: ClosedSummary) -> NDArray[np.int64]:
    """Return the number of the first event after each chunk of a trimmed segment.

    Raises:
        CorruptLogError: Its index is missing or damaged, or the numbers do not rise.
    """
    at, index = index_of(summary)
    try:
        found = next_events_in_index(index, most=summary.most_chunks)
        if found is None or (np.diff(found) < 0).any():
            raise ValueError("it lacks the event numbers after its chunks")  # noqa: TRY301
    except ValueError as error:
        raise CorruptLogError(summary.path, at, f"its {INDEX_METADATA}: {error}") from None
    return found


def total_span(spans: NDArray[np.void]) -> tuple[int, int]:
    """Return the least and the greatest happened time of all; `NO_SPAN` where no chunk has any."""
    filled = spans[spans["events"] > 0]
    if not len(filled):
        return NO_SPAN
    return int(filled["least"].min()), int(filled["greatest"].max())


def index_of(summary: ClosedSummary) -> tuple[int, Metadata]:
    """Return where the Metadata `semmap_index` of a closed segment lies, and the record.

    Raises:
        CorruptLogError: It is missing, or no Metadata.
    """
    at, end = _index_place(summary)
    record = summary.read(at, end)
    if _frame_of(record) != (Opcode.METADATA, len(record) - mcap.FRAME.size):
        raise CorruptLogError(summary.path, at, f"no {INDEX_METADATA} where its summary says")
    try:
        return at, mcap.read_record(Metadata, record[mcap.FRAME.size :])
    except ValueError as error:
        raise CorruptLogError(summary.path, at, f"its {INDEX_METADATA}: {error}") from None


def _frame_of(record: memoryview) -> tuple[int, int] | None:
    """Return opcode and length that a record says; None: it is too short for that."""
    return mcap.FRAME.unpack_from(record) if len(record) >= mcap.FRAME.size else None


def _index_place(summary: ClosedSummary) -> tuple[int, int]:
    """Return where the Metadata `semmap_index` begins and ends in the file."""
    start, indexes = summary.group(Opcode.METADATA_INDEX)
    for _, at, length in frames(indexes, 0, len(indexes)):
        index = mcap.read_record(
            MetadataIndex, indexes[at + mcap.FRAME.size : at + length]
        )  # under the summary's CRC
        end = index.offset + index.length
        if index.name == INDEX_METADATA and end <= summary.data_end:
            return index.offset, end
    raise CorruptLogError(summary.path, start, f"its summary names no {INDEX_METADATA}")


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
        """How many chunks the summary has room for."""
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
            data_start: They lie after this offset.

        Raises:
            CorruptLogError: What it states about them is impossible.
        """
        start, indexes = self.group(Opcode.CHUNK_INDEX)
        try:
            rows = rows_of_indexes(indexes, data_start=data_start, data_end=self.data_end)
        except ChunkDamage as damage:
            problem = f"its summary does not fit it: {damage}"
            raise CorruptLogError(self.path, start, problem) from None
        return ChunkTable(self.path, self.source, rows)

    def fits_data(self) -> bool:
        """Return whether the data are what was written, judged by their CRC; reads them all.

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
    """Return whether a file's last bytes are a footer and the magic: no live segment's are."""
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
