"""A log's bytes read as the specification says, and no line of the product: records, hash chain.

It is the reader at the end of docs/log_format.md, and what Tombstone.msg describes.
"""

from __future__ import annotations

import hashlib
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import zstandard

CHUNK, METADATA = 6, 12
COMMIT, NOTE, KEYFRAME, TOMBSTONE = 90, 91, 92, 93
ZEROS = bytes(32)


@dataclass
class PlainLog:
    """What is in a log's segments."""

    events: dict[int, bytes] = field(default_factory=dict)
    """Number -> whole Message record of each event that is there."""
    notes: list[bytes] = field(default_factory=list)
    hashes: dict[int, bytes] = field(default_factory=dict)
    """Number of the last event -> hash of each commit that is there."""
    next_event: int = 0
    head: bytes = ZEROS
    events_gone: int = 0
    notes_gone: int = 0
    tombstones: list[bytes] = field(default_factory=list)
    """Their messages, without the record's head."""


@dataclass
class _Tombstone:
    first: int
    count: int
    commits: int
    events_gone: int
    notes_gone: int
    previous: bytes
    hash: bytes
    parts: dict[int, tuple[bytes, bytes]]


def read_plainly(folder: Path) -> PlainLog:
    """Return a log, each hash recomputed; an AssertionError where something does not fit."""
    found = [(_head_of(data), data) for data in map(Path.read_bytes, folder.glob("*.mcap"))]
    found.sort(key=lambda one: (int(one[0]["segment"]), -int(one[0]["last_segment"])))
    log, expected = PlainLog(), 0
    for head, data in found:
        if int(head["segment"]) < expected:
            continue
        assert int(head["segment"]) == expected, "a segment is missing"
        assert int(head["first_event"]) == log.next_event, "events are missing"
        assert head["hash_so_far"] == log.head.hex(), "it follows another commit"
        assert head["format_version"] == ("4" if "taken_out" in head else "3")
        _read_segment(log, data, is_trimmed="taken_out" in head)
        expected = int(head["last_segment"]) + 1
        assert int(head.get("next_event", log.next_event)) == log.next_event
    return log


def all_bytes(folder: Path) -> Iterator[tuple[Path, bytes]]:
    """Yield the bytes of every file below a folder; of segments each chunk, unpacked, as well."""
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            yield path, (data := path.read_bytes())
            if path.suffix == ".mcap":
                yield from ((path, chunk) for chunk in _chunks(data))


def _read_segment(log: PlainLog, data: bytes, *, is_trimmed: bool) -> None:
    kept: dict[int, bytearray] = {}
    mine: dict[int, bytes] = {}
    lacks: _Tombstone | None = None
    for record in (record for chunk in _chunks(data) for _, record, _ in _records(chunk, 0)):
        channel, sequence, _log_time, _ = struct.unpack_from("<HIQQ", record, 9)
        if channel == KEYFRAME:
            continue
        if channel == TOMBSTONE:
            assert is_trimmed
            log.tombstones.append(record[31:])
            tombstone = _tombstone(record[31:])
            log.events_gone += tombstone.events_gone
            log.notes_gone += tombstone.notes_gone
            if tombstone.commits:
                assert not kept, "commits that are gone stand within one"
                assert (tombstone.first, tombstone.previous) == (log.next_event, log.head)
                log.next_event, log.head = tombstone.first + tombstone.count, tombstone.hash
            else:
                assert lacks is None
                lacks = tombstone
        elif channel == COMMIT:
            _close(log, record, kept, mine, lacks)
            kept, mine, lacks = {}, {}, None
        else:
            kept.setdefault(channel, bytearray()).extend(record)
            if channel == NOTE:
                log.notes.append(record)
            else:
                mine[sequence] = record
    assert not kept, "a commit is not closed"


def _close(
    log: PlainLog,
    record: bytes,
    kept: dict[int, bytearray],
    mine: dict[int, bytes],
    lacks: _Tombstone | None,
) -> None:
    first, _, count = struct.unpack_from("<QQI", record, 35)
    gone = 0 if lacks is None else lacks.events_gone
    assert lacks is None or (lacks.first, lacks.count) == (first, count)
    assert (first, count) == (log.next_event, len(mine) + gone), "a Commit that miscounts"
    assert all(first <= number < first + count for number in mine)
    assert list(mine) == sorted(mine)
    assert record[-64:-32] == log.head, "a Commit that does not follow the one before"
    digests = {channel: hashlib.sha256(data).digest() for channel, data in kept.items()}
    for channel, (digest, kept_digest) in ({} if lacks is None else lacks.parts).items():
        assert digests.get(channel, ZEROS) == kept_digest
        digests[channel] = digest
    whole = hashlib.sha256(record[:-32])
    for channel in sorted(digests):
        whole.update(struct.pack("<H", channel) + digests[channel])
    assert whole.digest() == record[-32:], "a Commit that does not fit its hash"
    log.next_event, log.head = first + count, record[-32:]
    log.hashes[log.next_event - 1] = log.head
    log.events |= mine


def _tombstone(message: bytes) -> _Tombstone:
    """Take a Tombstone apart, by the rules of CDR."""
    assert message[:4] == b"\0\1\0\0"
    body = message[4:]
    first, count, commits, events_gone, notes_gone, _ = struct.unpack_from("<QQI4xQIB", body)
    previous, its_hash = body[37:69], body[69:101]
    (channels,) = struct.unpack_from("<I", body, at := 104)
    ids = struct.unpack_from(f"<{channels}H", body, at + 4)
    at += 4 + 2 * channels
    digests, at = _bytes_at(body, at + -at % 4)
    kept, at = _bytes_at(body, at + -at % 4)
    assert len(digests) == len(kept) == 32 * channels
    parts = {
        channel: (digests[32 * i : 32 * i + 32], kept[32 * i : 32 * i + 32])
        for i, channel in enumerate(ids)
    }
    return _Tombstone(first, count, commits, events_gone, notes_gone, previous, its_hash, parts)


def _bytes_at(body: bytes, at: int) -> tuple[bytes, int]:
    (length,) = struct.unpack_from("<I", body, at)
    return body[at + 4 : at + 4 + length], at + 4 + length


def _records(data: bytes, at: int) -> Iterator[tuple[int, bytes, bytes]]:
    while at + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        if at + 9 + length > len(data):
            return
        yield opcode, data[at : at + 9 + length], data[at + 9 : at + 9 + length]
        at += 9 + length


def _text(data: bytes, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", data, at)
    return data[at + 4 : at + 4 + length].decode(), at + 4 + length


def _head_of(data: bytes) -> dict[str, str]:
    body = next(body for opcode, _, body in _records(data, 8) if opcode == METADATA)
    name, at = _text(body, 0)
    at, entries = at + 4, {}
    while at < len(body):
        key, at = _text(body, at)
        entries[key], at = _text(body, at)
    digest = entries.pop("sha256")
    lines = "".join(f"{key}\0{entries[key]}\n" for key in sorted(entries))
    assert name == "semmap_log"
    assert digest == hashlib.sha256(lines.encode()).hexdigest(), "the head is damaged"
    return entries


def _chunks(data: bytes) -> Iterator[bytes]:
    for opcode, _, body in _records(data, 8):
        if opcode != CHUNK:
            continue
        _, _, size, crc = struct.unpack_from("<QQQI", body)
        compression, at = _text(body, 28)
        stored = body[at + 8 :]
        if compression == "zstd":
            stored = zstandard.ZstdDecompressor().decompress(stored, max_output_size=size)
        if len(stored) != size or zlib.crc32(stored) != crc:
            return
        yield stored
