"""Of each chunk: how many events it has, and when they happened, at the earliest and latest.

A live segment's spans are found when it is scanned; closing one writes them as `semmap_index`. By
them a question about a moment leaves out what cannot matter, however late the events came.
"""

from __future__ import annotations

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from semmap_log.errors import CorruptLogError
from semmap_log.store import records as mcap
from semmap_log.store.chunks import NO_SPAN
from semmap_log.store.event_fields import kinds_of
from semmap_log.store.form import INDEX_METADATA
from semmap_log.store.header import next_events_in_index, read_index
from semmap_log.store.opening_records import Metadata, MetadataIndex
from semmap_log.store.pages import Page
from semmap_log.store.reading.closed_summary import ClosedSummary
from semmap_log.store.record_scan import frames

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
    """Return the number of the first event behind each chunk of a trimmed segment.

    Raises:
        CorruptLogError: Its index is missing or damaged, or the numbers do not rise.
    """
    at, index = index_of(summary)
    try:
        found = next_events_in_index(index, most=summary.most_chunks)
        if found is None or (np.diff(found) < 0).any():
            raise ValueError("it does not tell which events are behind its chunks")  # noqa: TRY301
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
