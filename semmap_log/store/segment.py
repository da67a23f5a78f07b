"""A segment being written: from its head to its footer."""

from __future__ import annotations

import errno
import os
import threading
from collections import Counter
from collections.abc import Hashable
from collections.abc import Set as AbstractSet
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    DataEnd,
    Footer,
    Header,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from semmap_log.core.io.checksum import crc32
from semmap_log.core.io.disk import write_all
from semmap_log.core.io.reserved_blocks import ReservedBlocks
from semmap_log.core.messages import LIBRARY, PROFILE, offered_qos, schema_text, type_hash
from semmap_log.store import byte_layout
from semmap_log.store import records as mcap
from semmap_log.store.bag_metadata import ClosedSegment
from semmap_log.store.chunks import BuiltChunk, ChunkFacts
from semmap_log.store.command_index import WrittenCommits, attachment
from semmap_log.store.folder import LogFolder, Version, version_of
from semmap_log.store.header import SegmentHeader, index_metadata


def channel_record(topic: byte_layout.Topic) -> Channel:
    """Return the MCAP Channel of a topic."""
    return Channel(
        id=topic.channel_id,
        topic=topic.topic,
        message_encoding="cdr",
        metadata={
            "offered_qos_profiles": offered_qos(topic.durability),
            "topic_type_hash": type_hash(topic.ros_type),
            **({byte_layout.CHANGES_KEY: byte_layout.NOTHING} if topic.changes_nothing else {}),
        },
        schema_id=topic.schema_id,
    )


def attachment_index(record: Attachment, length: int, offset: int) -> AttachmentIndex:
    """Return what the summary says of an attachment of so many bytes, at that place."""
    return AttachmentIndex(
        offset=offset,
        length=length,
        log_time=record.log_time,
        create_time=record.create_time,
        data_size=len(record.data),
        name=record.name,
        media_type=record.media_type,
    )


@dataclass(frozen=True, slots=True)
class Head:
    """The Schemas and Channels of every segment of a log, as records; ids ascending."""

    schemas: tuple[bytes, ...]
    channels: tuple[bytes, ...]

    @classmethod
    def of(cls, header: SegmentHeader) -> Head:
        """Return those of a version, and what a later one has added."""
        is_trimmed = header.trimmed is not None
        schemas, channels = _known_head(
            min(header.minor, byte_layout.FORMAT_MINOR), is_trimmed=is_trimmed
        )
        return cls(
            _in_order(schemas, header.newer.schemas), _in_order(channels, header.newer.channels)
        )


def _in_order(
    known: tuple[tuple[int, bytes], ...], newer: tuple[tuple[int, bytes], ...]
) -> tuple[bytes, ...]:
    return tuple(record for _, record in sorted((*known, *newer)))


@cache
def _known_head(
    minor: int, *, is_trimmed: bool
) -> tuple[tuple[tuple[int, bytes], ...], tuple[tuple[int, bytes], ...]]:
    """Return id and record of each Schema, and of each Channel, of a minor version."""
    known = byte_layout.trimmed_topics() if is_trimmed else byte_layout.topics()
    there = [topic for topic in known if topic.since_minor <= minor]
    schemas = {topic.schema_id: topic.ros_type for topic in there}
    return (
        tuple((number, mcap.record(schema_record(number, schemas[number]))) for number in schemas),
        tuple((topic.channel_id, mcap.record(channel_record(topic))) for topic in there),
    )


def schema_record(number: int, ros_type: str) -> Schema:
    """Return the MCAP Schema of a type."""
    return Schema(id=number, name=ros_type, encoding="ros2msg", data=schema_text(ros_type).encode())


MOST_HELD_BACK_BYTES = 2**16
"""So much of a log with durability `none` waits in memory before it is written."""


class SegmentWriter:
    """A segment under a temporary name, until `install` gives it its own.

    Every method but `abandon` may raise OSError; after that the file's end is unknown, and every
    method but `abandon` refuses. One thread adds; any may `flush` and `sync` meanwhile.
    """

    def __init__(self, folder: LogFolder, name: str, header: SegmentHeader) -> None:
        """Begin a segment in a folder: write its head."""
        self.folder = folder
        self.name = name
        self.header = header = header.as_written()
        self._head = Head.of(header)
        self.size = 0
        """Of the file, with what is held back."""
        self.commits = 0
        self.written = WrittenCommits(header.hash_so_far)
        """Of what commands the commits are, and the hash of the last."""
        self.levels: set[int] = {0}
        self.command_rows = np.empty(0, np.uint64)
        """Once it is closed: the index of its commands."""
        self._chunks: list[tuple[int, ChunkFacts]] = []
        """Where each chunk lies, and what the summary says of it."""
        self._next_events: list[int] = []
        self._held_back: list[bytes] = []
        self._held_back_size = 0
        self._metadata: list[MetadataIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._crc = 0
        self._writing = threading.Lock()
        """Held while bytes go to the file or wait for it: in one order, whoever hands them on."""
        self._is_broken = False
        """A write failed or was interrupted: what follows it would lie after a gap."""
        self._version: Version
        """The file as it was when it was closed, or is before it gets its name."""
        self.temporary: str | None
        self.temporary, self._fd = folder.new_file(name)
        self._blocks = ReservedBlocks(self._fd)
        try:
            self._write(mcap.MAGIC + mcap.record(Header(profile=PROFILE, library=LIBRARY)))
            self._write_metadata(byte_layout.LOG_METADATA, mcap.record(header.to_metadata()))
            self._write(b"".join((*self._head.schemas, *self._head.channels)))
        except BaseException:
            self.abandon()
            raise

    @property
    def path(self) -> Path:
        """The file's path, for messages."""
        return self.folder / self.name

    def add(
        self,
        chunk: BuiltChunk,
        *,
        levels: AbstractSet[int] = frozenset(),
        hold_back: bool = False,
        next_event: int = -1,
    ) -> None:
        """Append a chunk, after the channels of levels that are new to this segment: one write.

        Args:
            chunk: The chunk.
            levels: Levels whose floor maps are in it.
            hold_back: Keep the bytes in memory until there are many, or `flush` is called.
            next_event: In a trimmed segment the number of the first event after the chunk.
        """
        data = chunk.data
        offset = self.size
        if not levels <= self.levels:
            new = sorted(levels - self.levels)
            channels = mcap.record(
                *(channel_record(byte_layout.floor_map_topic(level)) for level in new)
            )
            data = channels + data
            offset += len(channels)
            self.levels.update(new)
        with self._writing:
            self._begin_write()
            if hold_back:
                self._hold_back(data)
            else:
                self._write(data)
            self._is_broken = False
        facts = chunk.facts
        self._chunks.append((offset, facts))
        self._next_events.append(next_event)
        self.commits += facts.counts.get(byte_layout.COMMIT_CHANNEL, 0)
        self.written.add(chunk)

    def flush(self) -> None:
        """Hand to the kernel what is held back: it then survives the end of the process."""
        with self._writing:
            self._begin_write()
            self._flush()
            self._is_broken = False

    def sync(self) -> None:
        """Return once all that was added survives a power cut.

        Raises:
            OSError: As the kernel says; or the file was removed, and ends with this process.
        """
        with self._writing:  # and whoever is just writing what was held back is waited for
            self._begin_write()
            self._flush()
            written = self.size
            self._is_broken = False
        os.fdatasync(self._fd)
        status = os.fstat(self._fd)
        if not status.st_nlink:
            raise FileNotFoundError(errno.ENOENT, "it was removed while it was written")
        if status.st_size < written:
            raise OSError(errno.EIO, "it was cut, or written over, while it was written")
        self._blocks.synced(status.st_size)

    def install(self, *, replacing: Hashable | None = None) -> None:
        """Give the file its name; it survives a power cut.

        Args:
            replacing: Device and inode of the file that it replaces, of which it is a copy; None:
                the name is free.

        Raises:
            OSError: As the system reports it; the name is taken, or by another file than that.
        """
        assert self.temporary is not None
        if self._fd >= 0:
            os.fsync(self._fd)
            self._version = version_of(os.fstat(self._fd))
        if self.folder.version(self.temporary) != self._version or self._version[2] != self.size:
            raise FileNotFoundError(errno.ENOENT, f"{self.temporary} was exchanged, or written to")
        if replacing is None:
            self.folder.put_new(self.temporary, self.name)
        elif self.folder.identity(self.name) == replacing:
            self.folder.put(self.temporary, self.name)
        else:
            raise FileExistsError(errno.EEXIST, f"{self.name} was exchanged for another file")
        self.temporary = None

    def close(self) -> None:
        """Write index, summary and footer, and sync.

        The magic at the end says that all the rest is there, so all the rest is synced before: a
        power cut may keep the last sector of a file and lose those before it.

        Raises:
            OSError: As the kernel says; or another file has its name now, or none.
        """
        with self._writing:
            self._begin_write()
            self._close()
        self._version = version_of(os.fstat(self._fd))
        os.close(self._fd)
        self._fd = -1

    def _close(self) -> None:
        facts = [facts for _, facts in self._chunks]
        index = index_metadata(
            [byte_layout.count_events(one.counts) for one in facts],
            [one.happened[0] for one in facts],
            [one.happened[1] for one in facts],
            self.written.head,
            None if self.header.trimmed is None else self._next_events,
        )
        self._write_metadata(byte_layout.INDEX_METADATA, mcap.record(index))
        self._write_command_index()
        self._write(mcap.record(DataEnd(data_section_crc=self._crc)))
        self._write(self._summary())
        os.fsync(self._fd)
        self._write(mcap.MAGIC)
        os.fsync(self._fd)
        if self.temporary is None and not self.folder.is_there(self.name, self._fd):
            raise FileNotFoundError(
                errno.ENOENT, f"{self.name} was removed or exchanged while it was written"
            )
        if os.fstat(self._fd).st_size != self.size:
            problem = f"{self.name} was cut, or written over, while it was written"
            raise OSError(errno.EIO, problem)
        self._blocks.release(self.size)

    def abandon(self) -> None:
        """Let go of the file as it is; one that was never installed is removed."""
        self._held_back, self._held_back_size = [], 0
        if self._fd >= 0:
            with suppress(OSError):
                os.close(self._fd)
            self._fd = -1
        if self.temporary is not None:
            with suppress(OSError):
                self.folder.remove(self.temporary)
            self.temporary = None

    @property
    def start_ns(self) -> int:
        """Log time of the first record."""
        return self._chunks[0][1].times[0]

    def _hold_back(self, data: bytes) -> None:
        self._held_back.append(data)
        self._held_back_size += len(data)
        self._crc = crc32(data, self._crc)
        self.size += len(data)
        if self._held_back_size >= MOST_HELD_BACK_BYTES:
            self._flush()

    def _begin_write(self) -> None:
        """Refuse to write after a gap; a write that succeeds resets `_is_broken`."""
        if self._is_broken:
            raise OSError(errno.EIO, "an earlier write failed, or was interrupted")
        self._is_broken = True

    def _flush(self) -> None:
        if self._held_back:
            data = b"".join(self._held_back)
            self._held_back, self._held_back_size = [], 0
            write_all(self._fd, data)

    def _write(self, data: bytes) -> None:
        self._flush()
        write_all(self._fd, data)
        self._crc = crc32(data, self._crc)
        self.size += len(data)

    def _write_metadata(self, name: str, data: bytes) -> None:
        self._metadata.append(MetadataIndex(length=len(data), name=name, offset=self.size))
        self._write(data)

    def _write_command_index(self) -> None:
        """Write by what a command of this segment is found, if there is any."""
        if not len(self.written):
            return
        self.command_rows = self.written.rows(self.header.first_event)
        index = attachment(self.command_rows, self.statistics().message_end_time)
        data = mcap.record(index)
        self._attachments.append(attachment_index(index, len(data), self.size))
        self._write(data)

    def statistics(self) -> Statistics:
        """Return the MCAP Statistics of what was written so far."""
        counts: Counter[int] = Counter()
        for _, facts in self._chunks:
            counts.update(facts.counts)
        times = [facts.times for _, facts in self._chunks]
        return Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._head.channels) + len(self.levels - {0}),
            channel_message_counts=dict(sorted(counts.items())),
            chunk_count=len(self._chunks),
            message_count=counts.total(),
            message_end_time=max((end for _, end in times), default=0),
            message_start_time=min((start for start, _ in times), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self._head.schemas),
        )

    def closed_segment(self) -> ClosedSegment:
        """Return what metadata.yaml is to say of it."""
        return ClosedSegment.of(self.path, self.statistics(), self.header)

    def _summary(self) -> bytes:
        """Return what stands between DataEnd and the magic: summary, summary offsets, footer."""
        maps = [
            channel_record(byte_layout.floor_map_topic(level))
            for level in sorted(self.levels - {0})
        ]
        indexes = [facts.index_at(offset) for offset, facts in self._chunks]
        groups = [
            (Opcode.SCHEMA, b"".join(self._head.schemas)),
            (Opcode.CHANNEL, b"".join(self._head.channels) + mcap.record(*maps)),
            (Opcode.STATISTICS, mcap.record(self.statistics())),
            (Opcode.CHUNK_INDEX, mcap.record(*indexes)),
            (Opcode.ATTACHMENT_INDEX, mcap.record(*self._attachments)),
            (Opcode.METADATA_INDEX, mcap.record(*self._metadata)),
        ]
        summary, offsets = b"", b""
        for opcode, data in groups:
            if not data:
                continue
            offset = SummaryOffset(
                group_opcode=opcode,
                group_start=self.size + len(summary),
                group_length=len(data),
            )
            summary += data
            offsets += mcap.record(offset)
        footer = Footer(
            summary_start=self.size, summary_offset_start=self.size + len(summary), summary_crc=0
        )
        everything = summary + offsets + mcap.record(footer)
        crc = crc32(everything[:-4])
        return everything[:-4] + crc.to_bytes(4, "little")
