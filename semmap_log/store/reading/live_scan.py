"""A segment without a summary, read by its grammar: only what proves itself counts.

    data = head, { { channel }, chunk, { message index } }, [ closing section ]

Chunks have a CRC, and their messages must follow each other. Anything else in place
of a chunk is a *bad place*. It is damage if some whole commit after it says that what is missing
was on the disk already. Otherwise the rest is the torn tail of a writer that lost power: sectors of
unsynced commits are missing, in any order.

Message indexes have no CRC: their length follows from the chunk before them, and their bytes are
never read. The Channel of a level stands before the chunk with its first floor map.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import PurePath

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import distinct
from semmap_log.core.io.byte_source import ByteSource
from semmap_log.store import record_scan
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import (
    CHUNK_BYTES,
    FLOOR_MAP_CHANNEL,
    INDEX_METADATA,
    floor_map_topic,
)
from semmap_log.store.chunks import StoredChunk, read_chunk_head
from semmap_log.store.header import SegmentHeader
from semmap_log.store.pages import Page
from semmap_log.store.reading.chunk_table import ROW, ChunkTable
from semmap_log.store.reading.closed_summary import SPAN, spans_of_chunks
from semmap_log.store.reading.invariants import Reading, ReadPosition, kinds_of_chunks
from semmap_log.store.reading.resync import whole_chunks


@dataclass(frozen=True, slots=True)
class LiveScan:
    """What of a segment proves itself, and what is wrong after that."""

    table: ChunkTable
    """All chunks that fit, those of a commit that is not finished, too."""
    at: int
    """Where the next chunk must begin; beyond the file's end where message indexes are cut."""
    place: ReadPosition
    """The reading position after all of `table`."""
    spans: NDArray[np.void]
    """When the events of each chunk in `table` happened, as `SPAN`."""
    whole: int
    """How many chunks there are up to the end of the last whole commit, or keyframe."""
    whole_at: int
    """As `at`, after these."""
    valid_place: ReadPosition
    """As `place`, after these."""
    problem: str = ""
    """Why the bytes after them do not count; empty if nothing of value is there."""
    is_damage: bool = False
    """Whether what is missing was on the disk: then nothing may be cut off unasked."""

    @property
    def chunks(self) -> ChunkTable:
        """The chunks of whole commits, and keyframes."""
        return self.table[: self.whole]


def scan_live(path: PurePath, header: SegmentHeader, source: ByteSource, start: int) -> LiveScan:
    """Read all of a segment.

    Args:
        path: Its file, for messages.
        header: What its head says.
        source: Its bytes.
        start: Where the records after the head's Metadata begin.

    Raises:
        UnreadableLogError: Some of it cannot be read.
    """
    at = _after_head(source, start)
    place = ReadPosition(header.first_event, header.first_event, header.hash_so_far)
    nothing = ChunkTable(path, source, np.empty(0, ROW))
    none = np.empty(0, SPAN)
    return proceed(LiveScan(nothing, at, place, none, 0, at, place), header, source)


def proceed(earlier: LiveScan, header: SegmentHeader, source: ByteSource) -> LiveScan:
    """Read what was added to a segment since an earlier scan: what did fit, still fits.

    Args:
        earlier: The scan of the same file, then shorter.
        header: What its head says.
        source: Its bytes now.

    Raises:
        UnreadableLogError: Some of what was added cannot be read.
    """
    scan = replace(earlier, table=earlier.table.extended(source), problem="", is_damage=False)
    while not scan.problem and (part := read_part(source, scan.at)):
        scan = _with_part(scan, part, header)
    return _judged(scan, source)


def _after_head(source: ByteSource, start: int) -> int:
    """Return where the Schemas and Channels end that begin there."""
    return start + sum(len(record) for _, record in head_records(source, start))


def head_records(source: ByteSource, start: int) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and bytes of the Schemas and Channels that begin there, frames included.

    Raises:
        UnreadableLogError: They cannot be read.
    """
    at, room = start, _HEAD_BYTES
    while True:
        window = source.read(at, at + room)
        begin = at
        for opcode, offset, length in record_scan.frames(window, 0, len(window)):
            if opcode not in (Opcode.SCHEMA, Opcode.CHANNEL):
                return
            yield opcode, bytes(window[offset : offset + length])
            at = begin + offset + length
        if begin + len(window) == source.size:
            return
        room = room if at > begin else 2 * room  # of a record that is longer than that


_HEAD_BYTES = 2**16
"""A head's Schemas and Channels lie within."""


def _with_part(scan: LiveScan, part: ChunkRun, header: SegmentHeader) -> LiveScan:
    """Return the scan with those chunks of a part that fit, up to the first that does not."""
    if not part.chunks:
        return replace(scan, problem=part.problem)
    if too_much := _too_much(scan, part):
        return replace(scan, problem=too_much)
    page = part.page(scan.table.path, header.first_event)
    ends = np.cumsum([len(offsets) for offsets in part.offsets])
    source, kinds = scan.table.source, kinds_of_chunks(page, ends)
    more = ChunkTable.of(scan.table.path, source, part.chunks, kinds, part.ends)
    reading = Reading(page, ends, more.rows)
    fits, problem = reading.whole_chunks(scan.place)
    problem = problem or part.problem
    if not fits:
        return replace(scan, problem=problem)
    places = reading.places_after(scan.place)
    scan_with = replace(
        scan,
        table=scan.table.extended(source, more[:fits]),
        spans=np.concatenate((scan.spans, spans_of_chunks(page, ends)[:fits])),
        at=part.ends[fits - 1],
        place=places[fits - 1],
        problem=problem,
    )
    last = places.last_whole(fits)
    if last is None:
        return scan_with
    return replace(
        scan_with,
        whole=len(scan.table) + last + 1,
        whole_at=part.ends[last],
        valid_place=places[last],
    )


def _too_much(scan: LiveScan, part: ChunkRun) -> str:
    """Return what is wrong with the sizes of all chunks so far and of a part; empty: nothing."""
    rows, more = scan.table.rows, part.chunks
    try:
        record_scan.check_sizes(
            int(rows["size"].sum()) + sum(chunk.size for chunk in more),
            int(rows["stored_size"].sum()) + sum(chunk.stored_size for chunk in more),
        )
    except record_scan.ChunkDamage as damage:
        return str(damage)
    return ""


def _judged(scan: LiveScan, source: ByteSource) -> LiveScan:
    """Return the scan with what comes after the chunks that fit: harmless, torn, or damage."""
    behind = _LaterChunks.of(source, scan.at, scan.place.committed)
    if not scan.problem and behind.chunks:
        scan = replace(scan, problem="a closing section followed by chunks")
    if not scan.problem and not scan.place.is_whole:
        scan = replace(scan, problem="a commit that was not finished")
    if not scan.problem and not len(scan.table):
        scan = replace(scan, problem="the keyframe at its head is missing")
    if not scan.problem:
        return scan
    lost = (
        behind.durable_before > scan.place.committed
        or scan.place.committed > scan.valid_place.committed  # only a whole copy has such chunks
        or not scan.whole  # the head and its keyframe were on the disk before the file had its name
    )
    if not lost:
        return scan
    return replace(scan, is_damage=True, problem=f"{scan.problem}; {behind.affected()}")


@dataclass(frozen=True, slots=True)
class _LaterChunks:
    """What whole chunks after a bad place show."""

    expected: int
    """Number of the event that should have come at the bad place."""
    chunks: int = 0
    first_event: int | None = None
    """The first later event that lies after it."""
    durable_before: int = 0
    """Events below this number were on the disk, according to the commits after it."""

    @classmethod
    def of(cls, source: ByteSource, start: int, expected: int) -> _LaterChunks:
        """Search everything after an offset."""
        chunks, first_event, durable_before = 0, None, 0
        for _, records, offsets in whole_chunks(source.read, start, source.size):
            page = Page(records, expected, PurePath(), 0, record_scan.ScannedRecords(offsets))
            later = [n for n in page.event_numbers()[:1].tolist() if n > expected]
            first_event = first_event or next(iter(later), None)
            commits = page.commit_rows(page.commit_places())
            durable_before = max([durable_before, *commits["durable_before"].tolist()])
            chunks += 1
        return cls(expected, chunks, first_event, durable_before)

    def affected(self) -> str:
        """Say which events the bad place holds."""
        if self.first_event is None:
            return f"events from {self.expected} on are affected"
        last = self.first_event - 1
        span = (
            f"event {last} is" if last == self.expected else f"events {self.expected} to {last} are"
        )
        return f"{span} affected; whole commits follow it"


SMALL_BYTES = 2**14
"""Smaller chunks are walked in Python; for larger ones numpy pays."""


@dataclass(slots=True)
class ChunkRun:
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

    def page(self, path: PurePath, first_event: int) -> Page:
        """Return all records as one page."""
        starts = np.cumsum([0, *(len(records) for records in self.records[:-1])])
        offsets = [own + start for own, start in zip(self.offsets, starts, strict=True)]
        records = self.records[0] if len(self.records) == 1 else b"".join(self.records)
        place = self.chunks[0].offset
        return Page(
            records, first_event, path, place, record_scan.ScannedRecords(np.concatenate(offsets))
        )


def read_part(source: ByteSource, at: int) -> ChunkRun:
    """Read chunks from an offset on, until they are many, or nothing more is there.

    Raises:
        UnreadableLogError: Some of them cannot be read.
    """
    part, size = ChunkRun(), 0
    window = _Window(source, at)
    while size < CHUNK_BYTES:
        try:
            start = _after_channels(window, at)
            chunk = _chunk_at(window, start)
            if chunk is None:
                break
            records = chunk.records(window.data, window.start)
            offsets, channels = _messages(window, chunk, records)
        except _PastWindow as behind:
            if not part.chunks:
                window = _Window(source, at, behind.end)
                continue
            break
        except record_scan.ChunkDamage as damage:
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


WINDOW_BYTES = 5 * CHUNK_BYTES // 4
"""So much is read for a part: a MiB of records with their message indexes."""


class _PastWindow(Exception):  # noqa: N818  # a turn of events: the caller reads more
    """A record extends past the bytes that were read."""

    def __init__(self, end: int) -> None:
        super().__init__(end)
        self.end = end


class _Window:
    """Bytes of a file from an offset on, and where they lie."""

    def __init__(self, source: ByteSource, start: int, end: int = 0) -> None:
        """Read them, at least up to `end`."""
        self.start = start
        self.data = source.read(start, max(start + WINDOW_BYTES, end))
        self.size = source.size
        """Of the file."""

    def get(self, start: int, end: int) -> memoryview:
        """Return bytes, by their offsets in the file; fewer where it ends.

        Raises:
            _PastWindow: They lie past the window's end, but not past the file's.
        """
        if min(end, self.size) > self.start + len(self.data):
            raise _PastWindow(end)
        return self.data[start - self.start : end - self.start]


def _chunk_at(window: _Window, at: int) -> StoredChunk | None:
    """Return the chunk at an offset, all of it in the window; None at the end of the data.

    Raises:
        ChunkDamage: Something else is there, or a part of a chunk.
        _PastWindow: It is not all in the window.
    """
    if at >= window.size or _is_closing_section(window, at):
        return None
    frame = window.get(at, at + mcap.FRAME.size)
    if frame[0] != Opcode.CHUNK:
        raise record_scan.ChunkDamage("no chunk where one must be")
    if len(frame) < mcap.FRAME.size:
        raise record_scan.ChunkDamage("a chunk that is cut")
    length = mcap.FRAME.size + mcap.FRAME.unpack(frame)[1]
    if at + length > window.size:
        raise record_scan.ChunkDamage("a chunk that is cut, or has a wrong length")
    window.get(at, at + length)
    return read_chunk_head(window.data, at, length, window.start)


def _messages(
    window: _Window, chunk: StoredChunk, records: bytes | memoryview
) -> tuple[NDArray[np.int64], int]:
    """Return where a chunk's messages begin, and on how many channels they are."""
    if chunk.size >= SMALL_BYTES:
        behind = chunk.offset + chunk.length
        window.get(behind, behind + _most_index_bytes(chunk.size))
        offsets = record_scan.scan_one(window.data, behind - window.start, records).offsets
        channels = len(distinct(record_scan.heads_of(records, offsets)["channel_id"]))
    else:
        offsets = record_scan.walk(records)
        channel_at = _CHANNEL_ID.unpack_from
        channels = len({channel_at(records, offset) for offset in offsets.tolist()})
    if not channels:
        raise record_scan.ChunkDamage("a chunk without messages")
    return offsets, channels


_CHANNEL_ID = struct.Struct("<9xH")


def _most_index_bytes(size: int) -> int:
    """Return how long the message indexes of so many bytes of records can usually be."""
    return size // mcap.MESSAGE.size * mcap.MESSAGE_INDEX_ENTRY_BYTES + _INDEX_HEADS_BYTES


_INDEX_HEADS_BYTES = 2**10


def _after_channels(window: _Window, at: int) -> int:
    """Return where the Channel records end that stand before a chunk with new floor maps.

    Raises:
        ChunkDamage: One is cut, or not of a floor map.
        _PastWindow: One is not all in the window.
    """
    while at < window.size:
        frame = window.get(at, at + mcap.FRAME.size)
        if frame[0] != Opcode.CHANNEL:
            break
        end = window.size + 1
        if len(frame) == mcap.FRAME.size:
            end = at + mcap.FRAME.size + mcap.FRAME.unpack(frame)[1]
        if end > window.size:
            raise record_scan.ChunkDamage("a Channel that is cut, or has a wrong length")
        _check_channel(window.get(at + mcap.FRAME.size, end))
        at = end
    return at


def _check_channel(body: memoryview) -> None:
    try:
        channel = mcap.read_record(Channel, body)
    except ValueError as error:
        raise record_scan.ChunkDamage(str(error)) from None
    if channel.id < FLOOR_MAP_CHANNEL:
        raise record_scan.ChunkDamage(
            f"a Channel {channel.id} where only those of floor maps may be"
        )
    topic = floor_map_topic(channel.id - FLOOR_MAP_CHANNEL)
    if (channel.topic, channel.schema_id) != (topic.topic, topic.schema_id):
        raise record_scan.ChunkDamage(f"a Channel {channel.id} that is not the floor map's")


def _is_closing_section(window: _Window, at: int) -> bool:
    """Return whether a closing section, or as much of it as exists, begins at an offset."""
    start = window.get(at, at + mcap.FRAME.size)
    if start[0] == Opcode.METADATA:
        name_at = at + mcap.FRAME.size + 4
        name = bytes(window.get(name_at, name_at + len(INDEX_METADATA)))
        return INDEX_METADATA.encode().startswith(name)
    return _DATA_END.startswith(bytes(start))


_DATA_END = mcap.FRAME.pack(Opcode.DATA_END, 4)
