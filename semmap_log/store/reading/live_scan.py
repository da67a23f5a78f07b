"""A segment without a summary, read by its grammar: nothing counts but what proves itself.

    data = head, { { channel }, chunk, { message index } }, [ closing section ]

Chunks have a CRC (`live_records`), and their messages must follow each other (`grammar`). Whatever
else stands where a chunk must be is a *bad place*. It is damage if some whole commit behind it
says that what is missing was on the disk already; else what lies behind is the torn tail that a
writer leaves which lost its power: sectors of unsynced commits are missing, in any order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import PurePath

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from semmap_log.core.io.byte_source import ByteSource
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.store.chunk_unpacking import check_sizes
from semmap_log.store.header import SegmentHeader
from semmap_log.store.pages import Page
from semmap_log.store.reading.chunk_table import ROW, ChunkTable
from semmap_log.store.reading.happened_spans import SPAN, spans_of_chunks
from semmap_log.store.reading.invariants import Reading, ReadPosition
from semmap_log.store.reading.live_records import ChunkRun, read_part
from semmap_log.store.reading.page_reading import kinds_of_chunks
from semmap_log.store.reading.resync import whole_chunks
from semmap_log.store.record_scan import ChunkDamage, ScannedRecords, frames


@dataclass(frozen=True, slots=True)
class LiveScan:
    """What of a segment proves itself, and what is wrong behind."""

    table: ChunkTable
    """All chunks that fit, those of a commit that is not finished, too."""
    at: int
    """Where the next chunk must begin; beyond the file's end where message indexes are cut."""
    place: ReadPosition
    """Where the log stands behind all of `table`."""
    spans: NDArray[np.void]
    """When the events of each chunk in `table` happened, as `SPAN`."""
    whole: int
    """How many chunks there are up to the end of the last whole commit, or keyframe."""
    whole_at: int
    """As `at`, behind these."""
    whole_place: ReadPosition
    """As `place`, behind these."""
    problem: str = ""
    """Why what lies behind them does not count; empty if nothing of worth lies there."""
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
        start: Where the records behind the head's Metadata begin.

    Raises:
        UnreadableLogError: Some of it cannot be read.
    """
    at = _behind_head(source, start)
    place = ReadPosition(header.first_event, header.first_event, header.hash_so_far)
    nothing = ChunkTable(path, source, np.empty(0, ROW))
    none = np.empty(0, SPAN)
    return go_on(LiveScan(nothing, at, place, none, 0, at, place), header, source)


def go_on(earlier: LiveScan, header: SegmentHeader, source: ByteSource) -> LiveScan:
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


def _behind_head(source: ByteSource, start: int) -> int:
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
        for opcode, offset, length in frames(window, 0, len(window)):
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
        whole_place=places[last],
    )


def _too_much(scan: LiveScan, part: ChunkRun) -> str:
    """Return what is wrong with the sizes of all chunks so far and of a part; empty: nothing."""
    rows, more = scan.table.rows, part.chunks
    try:
        check_sizes(
            int(rows["size"].sum()) + sum(chunk.size for chunk in more),
            int(rows["stored_size"].sum()) + sum(chunk.stored_size for chunk in more),
        )
    except ChunkDamage as damage:
        return str(damage)
    return ""


def _judged(scan: LiveScan, source: ByteSource) -> LiveScan:
    """Return the scan with what lies behind the chunks that fit: harmless, torn, or damage."""
    behind = _Behind.of(source, scan.at, scan.place.committed)
    if not scan.problem and behind.chunks:
        scan = replace(scan, problem="a closing section with chunks behind it")
    if not scan.problem and not scan.place.is_whole:
        scan = replace(scan, problem="a commit that was not finished")
    if not scan.problem and not len(scan.table):
        scan = replace(scan, problem="the keyframe at its head is missing")
    if not scan.problem:
        return scan
    lost = (
        behind.durable_before > scan.place.committed
        or scan.place.committed > scan.whole_place.committed  # only a whole copy has such chunks
        or not scan.whole  # the head and its keyframe were on the disk before the file had its name
    )
    if not lost:
        return scan
    return replace(scan, is_damage=True, problem=f"{scan.problem}; {behind.affected()}")


@dataclass(frozen=True, slots=True)
class _Behind:
    """What whole chunks behind a bad place tell."""

    expected: int
    """Number of the event that should have come at the bad place."""
    chunks: int = 0
    first_event: int | None = None
    """The first later event that lies behind it."""
    durable_before: int = 0
    """Events below this number were on the disk, say the commits behind it."""

    @classmethod
    def of(cls, source: ByteSource, start: int, expected: int) -> _Behind:
        """Search all that lies behind an offset."""
        chunks, first_event, durable_before = 0, None, 0
        for _, records, offsets in whole_chunks(source.read, start, source.size):
            page = Page(records, expected, PurePath(), 0, ScannedRecords(offsets))
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
        return f"{span} affected; whole commits lie behind it"
