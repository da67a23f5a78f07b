"""What closes a segment: index, DataEnd, summary and footer, recomputed from its chunks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    Metadata,
    MetadataIndex,
    Statistics,
    SummaryOffset,
)

from semmap_log.core.io.checksum import crc32
from semmap_log.core.messages import layout
from semmap_log.store import byte_layout
from semmap_log.store import records as mcap
from semmap_log.store.bag_metadata import ClosedSegment
from semmap_log.store.chunks import NO_SPAN
from semmap_log.store.command_index import attachment, command_rows
from semmap_log.store.gone_commands import Tombstone
from semmap_log.store.header import (
    LogInfo,
    SegmentHeader,
    head_in_index,
    next_events_in_index,
    read_index,
)
from semmap_log.store.manifest import ShippedSegment
from semmap_log.store.segment import Head, attachment_index, channel_record
from semmap_log.store.verification.file_heads import FOOTER_BYTES, first_bytes
from semmap_log.store.verification.file_place import FileBytes
from semmap_log.store.verification.hash_chain import SEQUENCE_RANGE
from semmap_log.store.verification.pieces import Flaw, Piece, name_of_record

SECTOR = 512
MOST_UNKNOWN_CHUNKS = 2**16
"""Where not all chunks can be read, an index may list so many: our segments roll far sooner."""
DATA_CRC = "the data's CRC"


@dataclass(slots=True)
class Contents:
    """What the chunks of a segment hold, as far as its summary must say it."""

    header_end: int
    header: SegmentHeader | None = None
    """None: it cannot be read."""
    is_complete: bool = True
    """Whether all of its chunks are known; else its summary can be checked by itself only."""
    is_flawless: bool = True
    """Whether all bytes of its data section were right so far."""
    chunks: list[ChunkIndex] = field(default_factory=list)
    spans: list[tuple[int, int, int]] = field(default_factory=list)
    """How many events each has, and their least and greatest happened time."""
    counts: Counter[int] = field(default_factory=Counter)
    levels: set[int] = field(default_factory=set)
    command_ids: bytearray = field(default_factory=bytearray)
    """Of all commits, concatenated."""
    first_events: list[int] = field(default_factory=list)
    """Of each commit."""
    head_hash: bytes = b""
    """Of the last commit; empty without one."""
    next_events: list[int] = field(default_factory=list)
    """In a trimmed segment, the number of the first event after each chunk."""

    def add(self, piece: Piece) -> None:
        """Take the next chunk in."""
        self.chunks.append(piece.chunk_index())
        self.spans.append((byte_layout.count_events(piece.counts), *piece.happened))
        self.counts.update(piece.counts)
        self.levels.update(level for level in piece.levels if level)
        for commit in _commits(piece):
            self.command_ids += commit["command_id"]
            self.first_events.append(commit["first_event"])
            self.head_hash = commit["hash"]
        if self.header is not None and self.header.trimmed is not None:
            self.head_hash = _hash_at_end(piece) or self.head_hash
            before = self.next_events[-1] if self.next_events else self.header.first_event
            self.next_events.append(_next_event(piece, before))

    def closing_head(self) -> bytes:
        """Return the hash that the closing must state: of the last commit, or of the one before."""
        return self.head_hash or (b"" if self.header is None else self.header.hash_so_far)

    @property
    def head(self) -> Head:
        """Its Schemas and Channels."""
        header = self.header or SegmentHeader(LogInfo("", ""), 0, 0, b"")
        return Head.of(header)

    def command_attachment(self) -> Attachment | None:
        """Return the index of its commands; None: it has no commit."""
        if not self.first_events or self.header is None:
            return None
        firsts = np.array(self.first_events, np.uint64)
        rows = command_rows(bytes(self.command_ids), firsts, self.header.first_event)
        return attachment(rows, max(c.message_end_time for c in self.chunks))

    def statistics(self, metadata_count: int, attachment_count: int = 0) -> Statistics:
        """Return the Statistics of it all."""
        return Statistics(
            attachment_count=attachment_count,
            channel_count=len(self.head.channels) + len(self.levels),
            channel_message_counts=dict(sorted(self.counts.items())),
            chunk_count=len(self.chunks),
            message_count=self.counts.total(),
            message_end_time=max((c.message_end_time for c in self.chunks), default=0),
            message_start_time=min((c.message_start_time for c in self.chunks), default=0),
            metadata_count=metadata_count,
            schema_count=len(self.head.schemas),
        )

    def closed_segment(self, name: str) -> ClosedSegment:
        """Return what metadata.yaml says of it."""
        header = self.header
        assert header is not None, "a segment that is closed, and whole, has one"
        return ClosedSegment.of(PurePath(name), self.statistics(2), header)

    def manifest_entry(self, name: str, size: int) -> ShippedSegment:
        """Return the manifest entry that it must have; the SHA-256 is left out.

        Args:
            name: Of its object.
            size: Bytes of the file.
        """
        header, said = self.header, self.statistics(2)
        assert header is not None, "a segment that is closed, and whole, has one"
        spans = [(least, greatest) for count, least, greatest in self.spans if count]
        happened = (min(s[0] for s in spans), max(s[1] for s in spans)) if spans else NO_SPAN
        recorded = said.message_start_time, said.message_end_time
        trimmed, counted = (
            header.trimmed,
            header.first_event + byte_layout.count_events(self.counts),
        )
        next_event = counted if trimmed is None else trimmed.next_event
        return ShippedSegment(
            name, size, "", header, self.header_end, next_event, self.closing_head(),
            dict(self.counts), recorded, happened,
        )  # fmt: skip


def closing_flaws(file: FileBytes, at: int, contents: Contents) -> list[Flaw]:
    """Compare the bytes after the last chunk, from `at` on, with what they must be.

    Args:
        file: All bytes.
        at: Where the records that close the segment begin.
        contents: What its chunks hold.
    """
    index, index_length, flaws = _index(file, at, contents)
    if index is None:
        return flaws
    start = at + index_length
    for name, data in _records_after(file, at, index_length, index, contents):
        is_data_crc = name == DATA_CRC
        if file[start : start + len(data)] != data and not (
            is_data_crc and (flaws or not contents.is_flawless)  # then it cannot fit
        ):
            flaws.append(Flaw("summary", start, f"{name} is not what the chunks say"))
        start += len(data)
    if start != len(file):
        flaws.append(Flaw("summary", len(file), f"expected the file's end at byte {start}"))
    return flaws


def is_whole_closing(file: FileBytes, at: int, contents: Contents) -> bool:
    """Return whether the bytes from `at` on are as long as what must close the segment."""
    index, length, _ = _index(file, at, contents)
    behind = _records_after(file, at, length, index, contents) if index else ()
    return at + length + sum(len(data) for _, data in behind) == len(file)


def is_torn_closing(file: FileBytes, at: int, contents: Contents) -> bool:
    """Return whether a crash during the closing of a segment can have left these bytes.

    They are a part of what closes it, whole sectors of zeros in place of some of it.
    """
    index, length, flaws = _index(file, at, contents)
    if index is None:
        first = bytes(file[at : at + 1])
        return first in (b"", bytes([Opcode.METADATA])) and len(file) < at + length
    if flaws:
        return False
    start = at + length
    for _, data in _records_after(file, at, length, index, contents):
        got = bytes(file[start : start + len(data)])
        if got != data[: len(got)] and not _differs_by_lost_sectors(start, got, data):
            return False
        start += len(data)
    return start >= len(file)


def summary_flaws(file: FileBytes) -> list[Flaw]:
    """Check a summary by itself, where the chunks that it speaks of are not all there."""
    at = len(file) - FOOTER_BYTES + mcap.FRAME.size
    footer = mcap.read_record(Footer, file[at : at + 20])
    if not 0 < footer.summary_start < at:
        return [Flaw("summary", at, "its footer points outside the file")]
    if crc32(file[footer.summary_start : at + 16]) != footer.summary_crc:
        return [Flaw("summary", footer.summary_start, "the summary does not fit its CRC")]
    return []


def _differs_by_lost_sectors(start: int, got: bytes, expected: bytes) -> bool:
    """Return whether all sectors of these bytes are as expected, or zeros."""
    at = 0
    while at < len(got):
        end = min(at + SECTOR - (start + at) % SECTOR, len(got))
        if got[at:end] != expected[at:end] and any(got[at:end]):
            return False
        at = end
    return True


def _index(file: FileBytes, at: int, contents: Contents) -> tuple[Metadata | None, int, list[Flaw]]:
    """Return the Metadata `semmap_index` at `at`, its length, and what is wrong with it.

    Its bytes depend on the zlib that packed them, so it is what it says that is compared.
    """
    if at + mcap.FRAME.size > len(file):
        return None, mcap.FRAME.size, [Flaw("closing", at, "the file ends before its index")]
    opcode, body = mcap.FRAME.unpack(file[at : at + mcap.FRAME.size])
    length = mcap.FRAME.size + body
    if opcode != Opcode.METADATA:
        name = byte_layout.INDEX_METADATA
        text = f"expected the Metadata {name}, got a record of opcode {opcode:#04x}"
        return None, 0, [Flaw("closing", at, text)]
    if at + length > len(file):
        return None, length, [Flaw("closing", at, "its index ends after the file's end")]
    most = max(len(contents.chunks), MOST_UNKNOWN_CHUNKS)
    try:
        record = mcap.read_record(Metadata, file[at + mcap.FRAME.size : at + length])
        index = [column.tolist() for column in read_index(record, most=most)]
        behind = next_events_in_index(record, most=most)
        index += [] if behind is None else [behind.tolist()]
        head = head_in_index(record)
        expected = mcap.record(record)  # the length in the frame is believed no more
    except (ValueError, KeyError) as error:
        return (
            None,
            length,
            [Flaw("index", at, f"the Metadata {byte_layout.INDEX_METADATA}: {error}")],
        )
    flaws = []
    if expected != file[at : at + len(expected)] or record.name != byte_layout.INDEX_METADATA:
        flaws.append(
            Flaw("index", at, f"not the Metadata {byte_layout.INDEX_METADATA} as we write it")
        )
    if index != _columns_of(contents):
        text = "the index of the chunks' events is not what they are"
        flaws.append(Flaw("index", at, text))
    if head is not None and head != contents.closing_head():
        text = (
            f"its last commit has the hash {contents.closing_head().hex()[:16]}…, but the index "
            f"says {head.hex()[:16]}…"
        )
        flaws.append(Flaw("index", at, text))
    return record, len(expected), flaws


def _columns_of(contents: Contents) -> list[list[int]]:
    """Return what the index must say of the chunks."""
    columns = [list(column) for column in zip(*contents.spans, strict=True)]
    is_trimmed = contents.header is not None and contents.header.trimmed is not None
    return [*columns, contents.next_events] if is_trimmed else columns


def _next_event(piece: Piece, before: int) -> int:
    """Return the number of the first event after a chunk of a trimmed segment.

    Args:
        piece: The chunk.
        before: The same of the chunk before it.
    """
    for channel, sequence, *_, start, end in piece.messages:
        if channel == byte_layout.TOMBSTONE_CHANNEL and not _stands_for_commits(piece, start, end):
            continue  # it stands in the middle of its commit
        if channel not in (byte_layout.KEYFRAME_CHANNEL, byte_layout.NOTE_CHANNEL):
            before += (sequence + 1 - before) % SEQUENCE_RANGE
    return before


def _hash_at_end(piece: Piece) -> bytes:
    """Return the hash of the last commit of a chunk that ends with commits that are gone."""
    channel, *_, start, end = piece.messages[-1]
    if channel == byte_layout.TOMBSTONE_CHANNEL and _stands_for_commits(piece, start, end):
        return Tombstone.in_record(piece.records[start:end]).hash
    return b""


def _stands_for_commits(piece: Piece, start: int, end: int) -> bool:
    with suppress(ValueError):
        return Tombstone.in_record(piece.records[start:end]).commits > 0
    return False


def _records_after(
    file: FileBytes, at: int, index_length: int, index: Metadata, contents: Contents
) -> Iterator[tuple[str, bytes]]:
    """Yield the name and the bytes of each record that must follow the index."""
    data_end = at + index_length
    crc = file.crc_to(data_end)
    # What names no head was closed before there was an index of commands.
    commands = None if head_in_index(index) is None else contents.command_attachment()
    attachments = []
    if commands is not None:
        data = mcap.record(commands)
        yield "the index of commands", data
        attachments.append(attachment_index(commands, len(data), data_end))
        data_end += len(data)
        crc = crc32(data, crc)  # as it must be: in a torn closing it may have lost sectors
    yield DATA_CRC, mcap.record(DataEnd(data_section_crc=crc))
    start = data_end + len(mcap.record(DataEnd(data_section_crc=0)))
    head = len(first_bytes())
    metadata = [
        MetadataIndex(
            length=contents.header_end - head, name=byte_layout.LOG_METADATA, offset=head
        ),
        MetadataIndex(length=index_length, name=byte_layout.INDEX_METADATA, offset=at),
    ]
    levels = [
        channel_record(byte_layout.floor_map_topic(level)) for level in sorted(contents.levels)
    ]
    said = contents.statistics(len(metadata), len(attachments))
    groups: list[tuple[Opcode, list[tuple[str, bytes]]]] = [
        (Opcode.SCHEMA, _of_head(contents.head.schemas)),
        (Opcode.CHANNEL, _of_head(contents.head.channels) + _named("a Channel", levels)),
        (Opcode.STATISTICS, _named("the Statistics", [said])),
        (Opcode.CHUNK_INDEX, _named("a ChunkIndex", contents.chunks)),
        (Opcode.ATTACHMENT_INDEX, _named("an AttachmentIndex", attachments)),
        (Opcode.METADATA_INDEX, _named("a MetadataIndex", metadata)),
    ]
    parts: list[bytes] = []
    offsets, end = b"", start
    for opcode, group in groups:
        group_start = end
        for name, data in group:
            yield f"{name} of the summary", data
            parts.append(data)
            end += len(data)
        if group:
            offsets += mcap.record(SummaryOffset(opcode, group_start, end - group_start))
    yield "a SummaryOffset", offsets
    footer = Footer(summary_start=start, summary_offset_start=end, summary_crc=0)
    behind = mcap.record(footer)
    crc = crc32(b"".join((*parts, offsets, behind[:-4])))
    yield "the Footer", behind[:-4] + crc.to_bytes(4, "little") + mcap.MAGIC


def _commits(piece: Piece) -> Iterator[dict[str, Any]]:
    """Yield the fields of its Commit records, as far as they are of the right size."""
    commit = layout("Commit")
    for channel, _, _, _, start, end in piece.messages:
        if (
            channel == byte_layout.COMMIT_CHANNEL
            and end - start == mcap.MESSAGE.size + commit.dtype.itemsize
        ):
            yield commit.unpack(piece.records, start + mcap.MESSAGE.size)


def _of_head(records: Sequence[bytes]) -> list[tuple[str, bytes]]:
    return [(name_of_record(record), record) for record in records]


def _named(name: str, records: Sequence[McapRecord]) -> list[tuple[str, bytes]]:
    return [(name, mcap.record(one)) for one in records]
