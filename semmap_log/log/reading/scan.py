"""A segment being read, closed or live: its header and the chunks of its whole commits."""

from __future__ import annotations

import weakref
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Header, Metadata, Statistics
from numpy.typing import NDArray

from semmap_log.errors import CorruptLogError, NotALogError
from semmap_log.log import records as mcap
from semmap_log.log.folder import LogFolder
from semmap_log.log.form import LOG_METADATA, PROFILE
from semmap_log.log.header import SegmentHeader
from semmap_log.log.reading.chunk_table import ChunkTable
from semmap_log.log.reading.closed_summary import FOOTER_BYTES, ClosedSummary, read_summary
from semmap_log.log.reading.happened_spans import spans_of_summary, total_span
from semmap_log.log.reading.live_scan import LiveScan, go_on, scan_live
from semmap_log.log.reading.mapping import MappedFile, map_file
from semmap_log.log.reading.segment_head import last_commit_in, stored_head
from semmap_log.log.walking import frames


@dataclass(frozen=True, eq=False)
class Segment:
    """What lies in a segment's file.

    Of a closed one only the head was read, and that there is a footer: the rest is looked at when
    it is asked for. Of a live one all that counts was read and checked.
    """

    path: Path
    header: SegmentHeader
    mapped: MappedFile
    """The file as it was when it was opened; stays readable if it is replaced."""
    head_end: int
    """Where the records behind the head's Metadata begin."""
    live: LiveScan | None
    """What a scan of a live segment found; None: it is closed."""

    @property
    def file(self) -> memoryview:
        """All bytes of the file."""
        return self.mapped.data

    @property
    def closed(self) -> bool:
        """With index and footer: complete, never modified again."""
        return self.live is None

    @cached_property
    def summary(self) -> ClosedSummary:
        """What closing a segment wrote behind its data.

        Raises:
            CorruptLogError: It does not fit its CRC, or itself.
        """
        return read_summary(self.path, self.file)

    @cached_property
    def head(self) -> bytes:
        """Hash of its last commit; of the commit before the segment, if it has none.

        Of a closed one as closing wrote it; of one that was closed before that was written, and
        whose last chunk of commits is read for it.

        Raises:
            CorruptLogError: What closed it, or that chunk, is damaged.
        """
        if self.live is not None:
            return self.live.whole_place.hash
        stored = stored_head(self.summary)
        if stored is not None:
            return stored
        last = last_commit_in(self.chunks, self.header)
        return self.header.hash_so_far if last is None else last.hash

    @cached_property
    def counts(self) -> Mapping[int, int] | None:
        """Messages on each channel, as a closed segment counts them; None for a live one.

        Raises:
            CorruptLogError: The summary is damaged.
        """
        if self.live is not None:
            return None
        counts: Mapping[int, int] = self._statistics.channel_message_counts
        return counts

    @property
    def recorded(self) -> tuple[int, int]:
        """The least and the greatest log time in it; (0, 0) if there is no record.

        Raises:
            CorruptLogError: The summary is damaged.
        """
        if self.live is None:
            return self._statistics.message_start_time, self._statistics.message_end_time
        rows = self.chunks.rows
        return (int(rows["start_ns"][0]), int(rows["end_ns"].max())) if len(rows) else (0, 0)

    @cached_property
    def _statistics(self) -> Statistics:
        return self.summary.statistics()

    @property
    def chunks(self) -> ChunkTable:
        """Keyframes and the chunks of whole commits, in file order.

        Raises:
            CorruptLogError: The summary of a closed segment is damaged.
        """
        return self._table if self.live is None else self.live.chunks

    @cached_property
    def _table(self) -> ChunkTable:
        _keep_tables_of(self)
        return self.summary.chunks(self.head_end)

    @property
    def spans(self) -> NDArray[np.void]:
        """How many events each of its chunks has, and when they happened, as `SPAN`.

        Raises:
            CorruptLogError: The index of a closed segment is damaged.
        """
        spans = self._spans if self.live is None else self.live.spans[: self.live.whole]
        if len(spans) != len(self.chunks):
            problem = f"its index tells of {len(spans)} chunks; there are {len(self.chunks)}"
            raise CorruptLogError(self.path, self.whole_end, problem)
        return spans

    @cached_property
    def _spans(self) -> NDArray[np.void]:
        _keep_tables_of(self)
        return spans_of_summary(self.summary)

    @cached_property
    def span(self) -> tuple[int, int]:
        """When its events happened, at the earliest and at the latest; (-1, -1) without any.

        Raises:
            CorruptLogError: The index of a closed segment is damaged.
        """
        if self.live is None and "_spans" not in vars(self):
            return total_span(spans_of_summary(self.summary))  # of a long log's every segment
        return total_span(self.spans)

    @cached_property
    def is_sound(self) -> bool:
        """Whether all of its data are what was written, as one CRC tells, or a scan has found."""
        if self.live is not None:
            return True
        self.mapped.will_need(0, len(self.file))
        return self.summary.fits_data()

    @property
    def whole_end(self) -> int:
        """Where the last whole commit (or keyframe) ends."""
        if self.live is not None:
            return min(self.live.whole_at, len(self.file))
        return self.summary.data_end

    @property
    def problem(self) -> str:
        """Why what lies behind `whole_end` does not count; empty if nothing of worth lies there."""
        return self.live.problem if self.live is not None else ""

    @property
    def torn_bytes(self) -> int:
        """How many bytes lie behind the last whole commit of a live segment, and do not count."""
        return len(self.file) - self.whole_end if self.problem else 0


_with_tables: deque[weakref.ref[Segment]] = deque()
_MOST_TABLES = 64


def _keep_tables_of(segment: Segment) -> None:
    """Let go of the tables of the segment that has had some longest: a long log has many."""
    _with_tables.append(weakref.ref(segment))
    if len(_with_tables) > _MOST_TABLES:
        oldest = _with_tables.popleft()()
        if oldest is not None:
            vars(oldest).pop("_table", None)
            vars(oldest).pop("_spans", None)


def open_segment(
    path: Path, *, earlier: Segment | None = None, folder: LogFolder | None = None
) -> Segment:
    """Return the segment in that file.

    Args:
        path: The file, for messages.
        folder: Where it is found by its name; None: where its path says.
        earlier: The same segment as it was: a live one is read on from where it ended then.

    Raises:
        NotALogError: The file is not a segment of ours.
        CorruptLogError: It was, and is damaged: in its head; a live one, in what was on the disk.
        LogAccessError: It cannot be read.
    """
    mapped = map_file(path, folder)
    header, head_end = read_head(path, mapped.data)
    if is_closed(mapped.data):
        return Segment(path, header, mapped, head_end, live=None)
    live = _known_scan(earlier, mapped, header)
    mapped.will_need(0 if live is None else min(live.at, len(mapped.data)), len(mapped.data))
    if live is None:
        live = scan_live(path, header, mapped.data, head_end)
    else:
        live = go_on(live, header, mapped.data)
    if live.is_damage:
        raise CorruptLogError(path, min(live.at, len(mapped.data)), live.problem)
    return Segment(path, header, mapped, head_end, live)


def _known_scan(
    earlier: Segment | None, mapped: MappedFile, header: SegmentHeader
) -> LiveScan | None:
    """Return the scan of the same file when it was shorter; None if it is another file."""
    if (
        earlier is None
        or earlier.mapped.identity != mapped.identity
        or earlier.header != header
        or len(earlier.file) > len(mapped.data)
    ):
        return None
    return earlier.live


def read_head(path: Path, file: memoryview) -> tuple[SegmentHeader, int]:
    """Return a segment's own header and where the records behind it begin.

    Raises:
        NotALogError: Not an MCAP file, or one that somebody else wrote.
        CorruptLogError: The header is damaged.
    """
    if file[: len(mcap.MAGIC)] != mcap.MAGIC:
        raise NotALogError(f"{path}: not an MCAP file.")
    records = frames(file, len(mcap.MAGIC), len(file))
    first, second = next(records, None), next(records, None)
    if first is None or second is None or first[0] != Opcode.HEADER:
        raise NotALogError(f"{path}: an MCAP file without a header.")
    frame = mcap.FRAME.size
    try:
        profile = mcap.read_record(Header, file[first[1] + frame : first[1] + first[2]]).profile
        metadata = (
            mcap.read_record(Metadata, file[second[1] + frame : second[1] + second[2]])
            if second[0] == Opcode.METADATA
            else None
        )
        if profile != PROFILE or metadata is None or metadata.name != LOG_METADATA:
            raise NotALogError(
                f"{path}: an MCAP file, but not of a semmap log. "
                "To take its doors into a log: semmap-log import LOG FILE."
            )
        return SegmentHeader.from_metadata(metadata), second[1] + second[2]
    except ValueError as error:
        raise CorruptLogError(path, second[1], str(error)) from None


def is_closed(file: memoryview) -> bool:
    """Tell whether the file ends in a footer and the magic: no live segment does."""
    if len(file) < FOOTER_BYTES or file[-len(mcap.MAGIC) :] != mcap.MAGIC:
        return False
    opcode, length = mcap.FRAME.unpack_from(file, len(file) - FOOTER_BYTES)
    return bool(opcode == Opcode.FOOTER and length == 20)
