"""The MCAP records that are read of each closed segment when a log is opened.

Their classes are named as in `mcap.records` and have the same attributes. That module knows all
kinds of record, reads the rest and writes all; importing it takes longer than replaying a small
log, so reading does without it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from mcap.data_stream import ReadDataStream


class Header(NamedTuple):
    """What begins a file."""

    profile: str
    library: str

    @classmethod
    def read(cls, stream: ReadDataStream) -> Header:
        """Return the record whose body follows."""
        return cls(stream.read_prefixed_string(), stream.read_prefixed_string())


class Metadata(NamedTuple):
    """Texts by their keys, under a name."""

    name: str
    metadata: dict[str, str]

    @classmethod
    def read(cls, stream: ReadDataStream) -> Metadata:
        """Return the record whose body follows."""
        name, entries = stream.read_prefixed_string(), dict[str, str]()
        end = stream.read4() + stream.count
        while stream.count < end:
            key = stream.read_prefixed_string()
            entries[key] = stream.read_prefixed_string()
        return cls(name, entries)


class MetadataIndex(NamedTuple):
    """Where a Metadata lies in the file."""

    offset: int
    length: int
    name: str

    @classmethod
    def read(cls, stream: ReadDataStream) -> MetadataIndex:
        """Return the record whose body follows."""
        return cls(stream.read8(), stream.read8(), stream.read_prefixed_string())


class Statistics(NamedTuple):
    """What is in a file."""

    message_count: int
    schema_count: int
    channel_count: int
    attachment_count: int
    metadata_count: int
    chunk_count: int
    message_start_time: int
    message_end_time: int
    channel_message_counts: dict[int, int]

    @classmethod
    def read(cls, stream: ReadDataStream) -> Statistics:
        """Return the record whose body follows."""
        messages, schemas = stream.read8(), stream.read2()
        channels, attachments, metadata, chunks = (stream.read4() for _ in range(4))
        start, last, counts = stream.read8(), stream.read8(), dict[int, int]()
        end = stream.read4() + stream.count
        while stream.count < end:
            channel = stream.read2()
            counts[channel] = stream.read8()
        told = (messages, schemas, channels, attachments, metadata, chunks, start, last)
        return cls(*told, counts)
