"""Chunks that hold very much in few bytes: honest ones are read, others end where they show it."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import zstandard

import semmap_log as sl
from semmap_log.core.model.events import FloorMap
from semmap_log.errors import CorruptLogError
from semmap_log.log.replay.maintenance import verify
from semmap_log.store import record_scan
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import KEYFRAME_CHANNEL, NO_HASH
from semmap_log.store.chunks import NO_SPAN, BuiltChunk, ChunkFacts, assemble_chunk
from semmap_log.store.folder import LogFolder
from semmap_log.store.header import LogInfo, SegmentHeader
from semmap_log.store.reading.chunk_table import rows_of_indexes
from semmap_log.store.record_scan import (
    CLOSE_RATIO,
    FREE_SEGMENT_BYTES,
    MOST_AT_ONCE,
    MOST_SEGMENT_RATIO,
    PIECE_BYTES,
    ChunkDamage,
    check_sizes,
    scan_together,
    unpack_records,
    walk,
)
from semmap_log.store.segment import SegmentWriter
from tests.store.logs import empty_keyframe

MIB = 2**20
HEADER = SegmentHeader(LogInfo("ab" * 16, "UTC"), 0, 0, NO_HASH)
FLOOR = FloorMap(resolution=0.05, origin_x=0.0, origin_y=0.0, cells=np.zeros((2000, 2000), np.int8))


def _message(time_ns: int, size: int = 0, *, channel: int = 4) -> bytes:
    return mcap.message(channel, 0, time_ns, time_ns, bytes(size))


def _unpacked(records: bytes) -> bytes | memoryview:
    packed = zstandard.compress(records)
    assert len(records) > CLOSE_RATIO * len(packed)
    return unpack_records(memoryview(packed), "zstd", len(records))


ALIKE = _message(9) * 100_000
BAD = {
    "zeros": (bytes(8 * MIB), "no message at byte 0 of the chunk's records"),
    "zeros behind a long message": (
        _message(9, 3 * MIB) + bytes(5 * MIB), f"no message at byte {31 + 3 * MIB} of the chunk's"
    ),
    "messages of one time": (ALIKE, f"{MOST_AT_ONCE + 1:,} messages not after the one"),
    "a head that lies across two pieces": (
        _message(9, PIECE_BYTES - 40) + b"\5" + bytes(MIB), f"no message at byte {PIECE_BYTES - 9}"
    ),
}  # fmt: skip


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
@pytest.mark.parametrize("name", BAD)
def test_records_that_are_packed_very_small_are_looked_at(name: str, compression: str) -> None:
    """They are messages, one after the other, each later than the one before."""
    records, expected = BAD[name]
    if compression == "lz4":
        packed = pytest.importorskip("lz4.frame").compress(records)
    else:
        packed = zstandard.compress(records)

    with pytest.raises(ChunkDamage, match=expected):
        unpack_records(memoryview(packed), compression, len(records))


def test_what_is_no_record_is_not_unpacked_further(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 128 MiB of zeros in 12 kB a MiB is."""
    taken = []

    def pieces(stored: memoryview, usual=record_scan._pieces) -> Iterator[bytes]:  # type: ignore[no-untyped-def]
        for piece in usual(stored):
            taken.append(len(piece))
            yield piece

    monkeypatch.setattr(record_scan, "_pieces", pieces)
    with pytest.raises(ChunkDamage, match="no message"):
        _unpacked(bytes(128 * MIB))

    assert [PIECE_BYTES] == taken


def test_honest_records_that_are_packed_very_small_are_read() -> None:
    """Long messages, whose heads may lie anywhere."""
    sizes = (PIECE_BYTES - 31, 3 * MIB + 7, 0, PIECE_BYTES - 1, 5)
    records = b"".join(_message(9 + i, size) for i, size in enumerate(sizes))
    records += _message(20, 2 * MIB, channel=KEYFRAME_CHANNEL) * 3

    assert records == bytes(_unpacked(records))


def test_a_log_of_a_large_empty_floor_is_good(tmp_path: Path) -> None:
    """Of four million cells in 1 kB, as a robot that has just begun its map has it."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.append([FLOOR])
    (segment,) = (tmp_path / "log").glob("*.mcap")

    found = verify(tmp_path / "log")

    assert segment.stat().st_size < 2**16
    assert ((), 1) == (found.findings, found.events)
    (entry,) = sl.read(tmp_path / "log").history()
    assert entry.event.cells.shape == (2000, 2000)  # type: ignore[attr-defined]


def test_the_chunks_of_a_segment_hold_so_much_together() -> None:
    """A GiB, and more where it is packed in enough bytes."""
    check_sizes(FREE_SEGMENT_BYTES, 1)
    check_sizes(MOST_SEGMENT_RATIO * 2**20, 2**20)
    for size, stored in ((FREE_SEGMENT_BYTES + 1, 1), (MOST_SEGMENT_RATIO * 2**20 + 1, 2**20)):
        with pytest.raises(ChunkDamage, match=f"expected chunks that hold .* got {size}"):
            check_sizes(size, stored)


def _log_of(folder: Path, chunks: list[BuiltChunk], *, closed: bool) -> Path:
    folder.mkdir()
    writer = SegmentWriter(LogFolder(folder), "log_000000.mcap", HEADER)
    writer.add(empty_keyframe(1))
    for chunk in chunks:
        writer.add(chunk)
    writer.install()
    (writer.close if closed else writer.abandon)()
    return folder


@pytest.mark.parametrize("closed", [False, True])
def test_a_segment_of_too_much_is_refused_before_it_is_unpacked(
    tmp_path: Path, closed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By its summary, or where the chunk lies that is one too many; `verify` says so, too."""
    path, expected = tmp_path / "log", "expected chunks that hold at most 9000000 bytes together"
    log = sl.create(path, tz="UTC", compact=False)
    for level in range(3):
        log.append([replace(FLOOR, level=level)])
    if closed:
        log.close()
    monkeypatch.setattr(record_scan, "FREE_SEGMENT_BYTES", 9_000_000)

    assert any(expected in finding.text for finding in verify(path).findings)
    if closed:
        with pytest.raises(CorruptLogError, match=expected):
            list(sl.read(path).history())
    else:
        assert sl.read(path)._reader.segments[-1].problem.startswith(expected)
        monkeypatch.undo()
        log.close()


def test_a_summary_of_too_much_is_refused() -> None:
    """Whatever each chunk says by itself."""
    facts = ChunkFacts(1000, "zstd", 951 - 44 - 4 - 40, 2**27, (1, 1), NO_SPAN, {})
    facts.chunk_length = facts.stored_size + mcap.FRAME.size + 44
    length = facts.chunk_length
    indexes = b"".join(mcap.record(facts.index_at(i * length)) for i in range(9))

    assert 8 == len(_rows(indexes[: len(indexes) // 9 * 8], 8 * length))
    with pytest.raises(ChunkDamage, match="expected chunks that hold at most"):
        _rows(indexes, 9 * length)


def _rows(indexes: bytes, end: int) -> np.ndarray:  # type: ignore[type-arg]
    return rows_of_indexes(memoryview(indexes), data_start=0, data_end=end)


def test_one_long_chunk_among_short_ones_is_walked_by_itself(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """All are walked together only as long as they are many."""
    rounds = []
    monkeypatch.setattr(record_scan, "gather", _counting(record_scan.gather, rounds))
    parts = [_message(9) * 3] * 20 + [_message(9) * 5000]
    records = b"".join(parts)
    ends = np.cumsum([len(part) for part in parts])

    found = scan_together(records, ends - [len(part) for part in parts], ends)

    assert walk(records).tolist() == found.tolist()
    assert 3 == len(rounds)


def _counting(usual, rounds: list[int]):  # type: ignore[no-untyped-def]
    def gather(*arguments):  # type: ignore[no-untyped-def]
        rounds.append(1)
        return usual(*arguments)

    return gather


CHILD = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (2**30, 2**30))
resource.setrlimit(resource.RLIMIT_CPU, (20, 20))
from semmap_log.cli import main
main(sys.argv[1:])
"""


@pytest.mark.slow
@pytest.mark.parametrize(("verb", "closed"), [("verify", True), ("replay", False)])
@pytest.mark.parametrize("name", ["zeros", "alike", "keyframes"])
def test_a_small_log_that_holds_very_much_takes_little_memory(
    tmp_path: Path, verb: str, name: str, closed: bool
) -> None:
    """Chunks of 128 MiB in a log of some ten kilobytes."""
    size = 128 * MIB
    message = _message(1000, channel=KEYFRAME_CHANNEL if name == "keyframes" else 4)
    records = bytes(size) if name == "zeros" else message * (size // len(message))
    index = mcap.message_index_head(4, 16) + struct.pack("<QQ", 1000, 0)
    times = (1000, 1000)
    built = assemble_chunk(records, index, {4: 1}, times=times, happened=times, compression="zstd")
    log = _log_of(tmp_path / "log", [built] * 3, closed=closed)
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}

    done = subprocess.run(
        [sys.executable, "-c", CHILD, verb, log], env=environment, capture_output=True, text=True,
        timeout=200, check=False,
    )  # fmt: skip

    assert done.returncode in (0, 1, 3, 4)
    assert "Traceback" not in done.stderr
    assert "MemoryError" not in done.stderr
