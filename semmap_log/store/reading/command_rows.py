"""The command index of a segment that is read: as closing wrote it, or else from its commits."""

from __future__ import annotations

import zlib

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Attachment, AttachmentIndex
from numpy.typing import NDArray

from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import COMMAND_ATTACHMENT, COMMIT_CHANNEL
from semmap_log.store.command_index import command_rows
from semmap_log.store.reading.closed_summary import ClosedSummary
from semmap_log.store.reading.segment_reading import pages_of
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.record_scan import frames

_CRC_BYTES = 4


def rows_of(segment: Segment) -> NDArray[np.uint64]:
    """Return the command index of a closed segment, in memory of its own.

    If it has none, since it was closed before there were any, or if the index does not match its
    CRC, the commits are read: they are the truth, and `verify` reports what is wrong with an index.

    Raises:
        CorruptLogError: Its summary is damaged; or, where they are read, its commits are.
    """
    if segment.counts is not None and not segment.counts.get(COMMIT_CHANNEL):
        return np.empty(0, np.uint64)
    stored = _stored_rows(segment.summary)
    return _rows_of_commits(segment) if stored is None else stored


def _stored_rows(summary: ClosedSummary) -> NDArray[np.uint64] | None:
    _, indexes = summary.group(Opcode.ATTACHMENT_INDEX)
    for _, at, length in frames(indexes, 0, len(indexes)):
        index = mcap.read_record(
            AttachmentIndex, indexes[at + mcap.FRAME.size : at + length]
        )  # under the summary's CRC
        end = index.offset + index.length
        if index.name == COMMAND_ATTACHMENT and end <= summary.data_end:
            return _rows_in(bytes(summary.read(index.offset, end)))
    return None


def _rows_in(record: bytes) -> NDArray[np.uint64] | None:
    """Return the rows in an Attachment record; None: its bytes are not what was written."""
    body, crc = record[mcap.FRAME.size : -_CRC_BYTES], record[-_CRC_BYTES:]
    if zlib.crc32(body) != int.from_bytes(crc, "little"):
        return None
    data = mcap.read_record(Attachment, record[mcap.FRAME.size :]).data
    return np.frombuffer(data, "<u8").astype(np.uint64)


def _rows_of_commits(segment: Segment) -> NDArray[np.uint64]:
    ids: list[bytes] = []
    firsts = [np.empty(0, np.uint64)]
    for page in pages_of(segment):
        commits = page.commit_rows(page.commit_places())
        ids.append(commits["command_id"].tobytes())
        firsts.append(commits["first_event"])
    return command_rows(b"".join(ids), np.concatenate(firsts), segment.header.first_event)
