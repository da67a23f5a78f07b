"""A segment being read, closed or live: its header and the chunks of its whole commits."""

from __future__ import annotations

import weakref
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from semmap_log.core.io.byte_source import ByteSource
from semmap_log.core.lazily import computed_once
from semmap_log.core.messages import PROFILE
from semmap_log.core.texts import command_line, counted
from semmap_log.errors import CorruptLogError, LogError, NewerLogError, NotALogError
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import LOG_METADATA, MANIFEST_NAME
from semmap_log.store.folder import LogFolder
from semmap_log.store.header import OtherVersionError, SegmentHeader
from semmap_log.store.newer import Newer
from semmap_log.store.opening_records import Header, Metadata, Statistics
from semmap_log.store.pages import UNKNOWN_BIT, bits_of_counts
from semmap_log.store.reading.chunk_table import ChunkTable
from semmap_log.store.reading.closed_summary import (
    FOOTER_BYTES,
    SMALL_BYTES,
    ClosedSummary,
    is_footer,
    next_events_of_summary,
    read_summary,
    spans_of_summary,
    total_span,
)
from semmap_log.store.reading.mapped_file import map_file
from semmap_log.store.reading.segment_head import last_commit_in, stored_head
from semmap_log.store.record_scan import frames

if TYPE_CHECKING:
    from semmap_log.store.manifest import ShippedSegment
    from semmap_log.store.reading.live_scan import LiveScan


@dataclass(frozen=True, eq=False)
class Segment:
    """What lies in a segment's file.

    Of a closed one only the head and the presence of a footer were read: the rest is read on
    request. Of a live one everything that counts was read and checked.
    """

    path: PurePath
    header: SegmentHeader
    source: ByteSource
    """The file's bytes as it was when it was opened; to be had still if it is replaced."""
    head_end: int
    """Where the records after the head's Metadata begin."""
    live: LiveScan | None
    """What a scan of a live segment found; None: it is closed."""
    told: ShippedSegment | None = None
    """What a manifest says of it: believed until its summary is read."""

    @property
    def size(self) -> int:
        """Bytes of the file."""
        return self.source.size

    @computed_once
    def newer(self) -> Newer:
        """What a later version has put at its head.

        Raises:
            UnreadableLogError: It cannot be read.
        """
        from semmap_log.store.reading.live_scan import head_records

        return Newer.of(head_records(self.source, self.head_end))

    @property
    def full_header(self) -> SegmentHeader:
        """Its header with all that whoever writes it again must keep."""
        return replace(self.header, newer=self.newer)

    @property
    def has_unknown_events(self) -> bool:
        """Whether events of kinds that a later version has added are in it.

        Raises:
            CorruptLogError: The summary of a closed segment is damaged.
        """
        if self.counts is not None:
            return bool(bits_of_counts(self.counts) & UNKNOWN_BIT)
        return bool(len(self.chunks.having(UNKNOWN_BIT)))

    @property
    def closed(self) -> bool:
        """With index and footer: complete, never modified again."""
        return self.live is None

    @computed_once
    def summary(self) -> ClosedSummary:
        """What closing a segment wrote after its data.

        Raises:
            CorruptLogError: It does not fit its CRC, or itself.
        """
        if self.told is not None:  # both ends at once
            self.source.read_ranges([(0, self.head_end), (self.size - 1, self.size)])
        found = read_summary(self.path, self.source)
        if self.told is not None:
            self._check_manifest(self.told, found)
        if len(found.tail) > SMALL_BYTES:
            _with_summary.add(self)
        return found

    @computed_once
    def head(self) -> bytes:
        """Hash of its last commit; of the commit before the segment, if it has none.

        Of a closed one as closing wrote it; of one that was closed before that was written, and
        whose last chunk of commits is read for it.

        Raises:
            CorruptLogError: What closed it, or that chunk, is damaged.
        """
        if self.live is not None:
            return self.live.valid_place.hash
        if self.told is not None:
            return self.told.head
        stored = stored_head(self.summary)
        if stored is not None:
            return stored
        last = last_commit_in(self.chunks, self.header)
        return self.header.hash_so_far if last is None else last.hash

    @computed_once
    def counts(self) -> Mapping[int, int] | None:
        """Messages on each channel, as a closed segment counts them; None for a live one.

        Raises:
            CorruptLogError: The summary is damaged.
        """
        if self.live is not None:
            return None
        if self.told is not None:
            return self.told.counts
        counts: Mapping[int, int] = self.statistics.channel_message_counts
        return counts

    @property
    def recorded(self) -> tuple[int, int]:
        """The least and the greatest log time in it; (0, 0) if there is no record.

        Raises:
            CorruptLogError: The summary is damaged.
        """
        if self.told is not None:
            return self.told.recorded
        if self.live is None:
            return self.statistics.message_start_time, self.statistics.message_end_time
        rows = self.chunks.rows
        return (int(rows["start_ns"][0]), int(rows["end_ns"].max())) if len(rows) else (0, 0)

    @computed_once
    def statistics(self) -> Statistics:
        """What a closed segment counts of itself.

        Raises:
            CorruptLogError: The summary is damaged.
        """
        return self.summary.statistics()

    @property
    def chunks(self) -> ChunkTable:
        """Keyframes and the chunks of whole commits, in file order.

        Raises:
            CorruptLogError: The summary of a closed segment is damaged.
        """
        return self._table if self.live is None else self.live.chunks

    @computed_once
    def _table(self) -> ChunkTable:
        _with_tables.add(self)
        return self.summary.chunks(self.head_end)

    @property
    def spans(self) -> NDArray[np.void]:
        """How many events each of its chunks has, and when they happened, as `SPAN`.

        Raises:
            CorruptLogError: The index of a closed segment is damaged.
        """
        spans = self._spans if self.live is None else self.live.spans[: self.live.whole]
        if len(spans) != len(self.chunks):
            told = counted(len(spans), "chunk")
            problem = f"its index lists {told}; the file has {len(self.chunks)}"
            raise CorruptLogError(self.path, self.valid_end, problem)
        return spans

    @computed_once
    def _spans(self) -> NDArray[np.void]:
        _with_tables.add(self)
        return spans_of_summary(self.summary)

    @computed_once
    def next_events(self) -> NDArray[np.int64]:
        """Number of the first event after each of its chunks.

        Raises:
            CorruptLogError: The index of a closed segment is damaged.
        """
        if self.header.trimmed is None:
            ends: NDArray[np.int64] = self.header.first_event + np.cumsum(self.spans["events"])
            return ends
        ends = next_events_of_summary(self.summary)
        if len(ends) != len(self.chunks) or len(self.spans) != len(ends):
            problem = f"its index does not list its {counted(len(self.chunks), 'chunk')}"
            raise CorruptLogError(self.path, self.valid_end, problem)
        return ends

    @computed_once
    def span(self) -> tuple[int, int]:
        """When its events happened, at the earliest and at the latest; (-1, -1) without any.

        Raises:
            CorruptLogError: The index of a closed segment is damaged.
        """
        if self.told is not None:
            return self.told.happened
        if self.live is None and "_spans" not in vars(self):
            return total_span(spans_of_summary(self.summary))  # of a long log's every segment
        return total_span(self.spans)

    @computed_once
    def is_sound(self) -> bool:
        """Whether all of its data are what was written, as one CRC or a scan has shown."""
        if self.live is not None:
            return True
        self.source.will_need(0, self.size)
        return self.summary.fits_data()

    @property
    def valid_end(self) -> int:
        """Where the last whole commit (or keyframe) ends."""
        if self.live is not None:
            return min(self.live.whole_at, self.size)
        return self.summary.data_end

    @property
    def problem(self) -> str:
        """Why the bytes after `valid_end` do not count; empty if nothing of value is there."""
        return self.live.problem if self.live is not None else ""

    @property
    def torn_bytes(self) -> int:
        """How many bytes follow the last whole commit of a live segment, and do not count."""
        return self.size - self.valid_end if self.problem else 0

    def _check_manifest(self, told: ShippedSegment, found: ClosedSummary) -> None:
        """Compare what a manifest says with what the segment says itself.

        Raises:
            CorruptLogError: They differ.
        """
        said = found.statistics()
        stored = stored_head(found)
        header, head_end = read_head(self.path, self.source)
        ours = (told.header, told.head_end, told.recorded, dict(told.counts), told.head)
        theirs = (
            header, head_end, (said.message_start_time, said.message_end_time),
            dict(said.channel_message_counts), told.head if stored is None else stored,
        )  # fmt: skip
        if ours != theirs or total_span(spans_of_summary(found)) != told.happened:
            problem = f"it differs from its entry in {MANIFEST_NAME}"
            raise CorruptLogError(self.path, None, problem)


class _Keepers:
    """Segments that keep what can be read again: only the last ones, since a long log has many."""

    def __init__(self, most: int, *names: str) -> None:
        self._most = most
        self._names = names
        """Under which attributes they keep it."""
        self._segments: deque[weakref.ref[Segment]] = deque()

    def add(self, segment: Segment) -> None:
        """Add a segment that begins to keep something; the oldest one releases what it keeps."""
        self._segments.append(weakref.ref(segment))
        if len(self._segments) > self._most:
            oldest = self._segments.popleft()()
            if oldest is not None:
                for name in self._names:
                    vars(oldest).pop(name, None)


_with_tables = _Keepers(64, "_table", "_spans")
_with_summary = _Keepers(4, "summary")


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
        NewerLogError: A later major version has written it.
        CorruptLogError: It was, and is damaged: in its head; a live one, in what was on the disk.
        LogAccessError: It cannot be read.
    """
    return segment_in(path, map_file(path, folder), earlier=earlier)


def segment_in(path: PurePath, source: ByteSource, *, earlier: Segment | None = None) -> Segment:
    """Return the segment whose bytes a source gives; as `open_segment`.

    Args:
        path: For messages.
        source: Its bytes.
        earlier: As for `open_segment`.

    Raises:
        LogError: As `open_segment`.
    """
    ends = source.read_ranges(
        ((0, _USUAL_HEADER_BYTES), (max(0, source.size - FOOTER_BYTES), source.size))
    )
    header, head_end = read_head(path, source, ends[: min(_USUAL_HEADER_BYTES, source.size)])
    if is_footer(ends[-FOOTER_BYTES:]):
        return Segment(path, header, source, head_end, live=None)
    from semmap_log.store.reading.live_scan import proceed, scan_live

    live = _known_scan(earlier, source, header)
    source.will_need(0 if live is None else min(live.at, source.size), source.size)
    if live is None:
        live = scan_live(path, header, source, head_end)
    else:
        live = proceed(live, header, source)
    if live.is_damage:
        raise CorruptLogError(path, min(live.at, source.size), live.problem)
    return Segment(path, header, source, head_end, live)


def _known_scan(
    earlier: Segment | None, source: ByteSource, header: SegmentHeader
) -> LiveScan | None:
    """Return the scan of the same file when it was shorter; None if it is another file."""
    if (
        earlier is None
        or earlier.source.identity != source.identity
        or earlier.header != header
        or earlier.size > source.size
    ):
        return None
    return earlier.live


_USUAL_HEADER_BYTES, MOST_HEADER_BYTES = 2**12, 2**16
"""A segment's own header lies within the first, but for very long names; within the second, else
it is none of ours."""


def read_head(
    path: PurePath, source: ByteSource, start: memoryview | None = None
) -> tuple[SegmentHeader, int]:
    """Return a segment's own header and where the records after it begin.

    Args:
        path: Its file.
        source: The file's bytes.
        start: The first of them; None: not read yet.

    Raises:
        NotALogError: Not an MCAP file, or one that somebody else wrote.
        NewerLogError: A later major version has written it.
        CorruptLogError: The header is damaged.
    """
    file = source.read(0, _USUAL_HEADER_BYTES) if start is None else start
    is_mcap = file[: len(mcap.MAGIC)] == mcap.MAGIC
    if is_mcap and len(list(islice(frames(file, len(mcap.MAGIC), len(file)), 2))) < 2:
        file = source.read(0, MOST_HEADER_BYTES)
    return head_in(path, file)


def head_in(path: PurePath, file: memoryview) -> tuple[SegmentHeader, int]:
    """Return a segment's own header and where the records after it begin.

    Args:
        path: Its file, for messages.
        file: The first bytes of it; `MOST_HEADER_BYTES` are enough.

    Raises:
        LogError: As `read_head`.
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
            line = command_line("import", "LOG", path)
            raise NotALogError(
                f"{path}: an MCAP file, but not of a semmap log. "
                f"To take its doors into a log: {line}"
            )
        return SegmentHeader.from_metadata(metadata), second[1] + second[2]
    except OtherVersionError as error:
        raise (NewerLogError if error.is_newer else LogError)(f"{path}: {error}.") from None
    except ValueError as error:
        raise CorruptLogError(path, second[1], str(error)) from None


def numbers_of(segment: Segment) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return, for each chunk, the number of its first event and the number after its last."""
    ends = segment.next_events
    return np.append(segment.header.first_event, ends)[: len(ends)], ends
