"""What is read when a log is opened is what the library writes and reads."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from mcap import records as library

from semmap_log.store import opening_records as ours
from semmap_log.store import records as mcap

WRITTEN = [
    library.Header("ros2", "semmap-log"),
    library.Header("", ""),
    library.Metadata("semmap_log", {"log_id": "1", "building": "Büro", "robot": ""}),
    library.Metadata("", {}),
    library.MetadataIndex(2**40, 17, "semmap_index"),
    library.Statistics(
        attachment_count=1, channel_count=2, channel_message_counts={1: 2**40, 300: 4},
        chunk_count=5, message_count=6, message_end_time=2**62, message_start_time=8,
        metadata_count=9, schema_count=10,
    ),
]  # fmt: skip


@pytest.mark.parametrize("record", WRITTEN, ids=repr)
def test_a_record_is_read_as_the_library_reads_it(record: Any) -> None:
    """All fields, by the same names."""
    body = mcap.record(record)[mcap.FRAME.size :]

    read = mcap.read_record(getattr(ours, type(record).__name__), body)

    assert dataclasses.asdict(record) == read._asdict()


@pytest.mark.parametrize("record", WRITTEN, ids=repr)
def test_of_a_record_that_is_cut_the_same_is_said(record: Any) -> None:
    """Wherever it ends."""
    body = mcap.record(record)[mcap.FRAME.size :]
    name = type(record).__name__

    for end in range(len(body)):
        assert _read(getattr(ours, name), body[:end]) == _read(type(record), body[:end])


def _read(kind: type[Any], body: bytes) -> object:
    try:
        read = mcap.read_record(kind, body)
    except ValueError as error:
        return str(error)
    return dataclasses.asdict(read) if dataclasses.is_dataclass(read) else read._asdict()
