"""Guards that no random damage reaches, since a checksum before them would notice: forged bytes."""

from __future__ import annotations

import hashlib
import random
import struct
import tracemalloc
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from mcap.records import ChunkIndex

import semmap_log as sl
from semmap_log.core.messages import layout
from semmap_log.core.model.commits import MOST_NOTE_CHARACTERS, Note
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded, DoorObserved
from semmap_log.errors import CorruptLogError, LogPoisonedError
from semmap_log.interop.formats.files.floor_plan import MOST_CELLS
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import CHUNK_BYTES, COMMIT_CHANNEL, KEYFRAME_CHANNEL, NO_HASH
from semmap_log.store.chunks import (
    FREE_CHUNK_BYTES,
    MAX_CHUNK_BYTES,
    MOST_RATIO,
    StoredChunk,
    build_chunk,
    most_unpacked,
    read_chunk_head,
)
from semmap_log.store.commit_records import MOST_EVENT_BYTES, CommitBuilder, Stamp
from semmap_log.store.compaction import compact
from semmap_log.store.folder import LogFolder
from semmap_log.store.header import LogInfo, SegmentHeader
from semmap_log.store.reading.chunk_table import rows_of_indexes
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import last_commit
from semmap_log.store.reading.segment_scan import open_segment
from semmap_log.store.reading.segment_set import check_follows
from semmap_log.store.record_scan import ChunkDamage, scan_by_index, walk
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.writing.durability import SharedSync
from tests.store.logs import empty_keyframe

HEADER = SegmentHeader(LogInfo("ab" * 16, "UTC"), 0, 0, NO_HASH)
STAMP = Stamp(0, 1000, NO_HASH, bytes(16), 1000, 0, bytes(16))
SIZE_AT, STORED_SIZE_AT = 25, 41
"""Where these fields of an uncompressed Chunk record lie."""

Forge = Callable[[Stamp], Stamp]


def _forged(folder: Path, forge: Forge, *, closed: bool) -> Path:
    """Write a log of two commits, the second forged, all checksums right."""
    folder.mkdir()
    writer = SegmentWriter(LogFolder(folder), "log_000000.mcap", HEADER)
    writer.add(empty_keyframe(1))
    writer.install()
    stamp = STAMP
    for door in (1, 2):
        builder = CommitBuilder(stamp, Note(), random.Random(door).randbytes)
        for chunk in builder.chunks([DoorAdded(door_id=DoorId(door))]):
            writer.add(chunk)
        commit = builder.commit
        stamp = forge(replace(STAMP, first_event=1, recorded_ns=2000, previous_hash=commit.hash,
                              durable_before=1))  # fmt: skip
    if closed:
        writer.close()
    writer.abandon()
    return folder


def _forged_second(folder: Path, recorded_ns: int) -> Path:
    """Write a log of two segments of a commit, the second recorded then, all hashes right."""
    folder.mkdir()
    header, stamp = HEADER, STAMP
    for number in range(2):
        writer = SegmentWriter(LogFolder(folder), f"log_{number:06d}.mcap", header)
        builder = CommitBuilder(stamp, Note(), random.Random(number).randbytes)
        for chunk in builder.chunks([DoorAdded(door_id=DoorId(number + 1))]):
            writer.add(chunk)
        commit = builder.commit
        writer.close()
        writer.install()
        header = header.next(1, commit.hash)
        stamp = replace(STAMP, first_event=1, recorded_ns=recorded_ns, previous_hash=commit.hash)
    return folder


def test_a_segment_that_was_recorded_before_the_last_is_named(tmp_path: Path) -> None:
    """Questions look segments up by their times: all of them are refused, whatever they read."""
    right = _forged_second(tmp_path / "right", 2000)
    wrong = _forged_second(tmp_path / "wrong", 1001)

    assert 4 == _read_all(right)
    asks: list[Callable[[LogReader], object]] = [
        lambda log: log.find_commit(1),
        lambda log: log.event(1),
        lambda log: log.event_known_at(5000),
        lambda log: list(log.pages()),
    ]
    for ask in asks:
        with pytest.raises(CorruptLogError, match=r"last of log_000000"):
            ask(LogReader(wrong))


FORGERIES: dict[str, Forge] = {
    "another hash before": lambda stamp: replace(stamp, previous_hash=bytes(range(32))),
    "a number left out": lambda stamp: replace(stamp, first_event=2),
    "a number given twice": lambda stamp: replace(stamp, first_event=0),
    "a time that goes back": lambda stamp: replace(stamp, recorded_ns=1001),
}


def _read_all(log: Path) -> int:
    opened = sl.read(log)
    return sum(len(batch) for batch in opened.batches()) + len(list(opened.commits()))


@pytest.mark.parametrize("forgery", FORGERIES)
def test_a_forged_commit_is_named_or_does_not_count(forgery: str, tmp_path: Path) -> None:
    """Numbers and hashes are compared, though every checksum is right."""
    for closed in (True, False):
        honest = _forged(tmp_path / f"honest {closed}", lambda stamp: stamp, closed=closed)
        assert 4 == _read_all(honest)
    live = _forged(tmp_path / "live", FORGERIES[forgery], closed=False)
    with suppress(CorruptLogError):
        assert 2 == _read_all(live)
    if forgery != "a time that goes back":
        closed_log = _forged(tmp_path / "closed", FORGERIES[forgery], closed=True)
        with pytest.raises(CorruptLogError, match=r"log_000000.mcap: damaged"):
            _read_all(closed_log)


def _chunk() -> bytearray:
    """Return an uncompressed Chunk record of one message."""
    record = mcap.message(4, 0, 1000, 1000, bytes(40))
    built = build_chunk(record, np.zeros(1, np.int64), compression="")
    return bytearray(built.data[: mcap.FRAME.size + mcap.FRAME.unpack_from(built.data)[1]])


def test_a_chunk_says_its_own_sizes() -> None:
    """Before anything is allocated."""
    for field, value, problem in (
        (SIZE_AT, 3, "expected 3 bytes of records"),
        (SIZE_AT, FREE_CHUNK_BYTES + 1, "more than any chunk has"),
        (STORED_SIZE_AT, 3, "3 stored bytes do not fit"),
    ):
        data = _chunk()
        struct.pack_into("<Q", data, field, value)

        with pytest.raises(ChunkDamage, match=problem):
            read_chunk_head(bytes(data), 0, len(data)).records(bytes(data))


def test_a_chunk_holds_so_many_times_its_packed_bytes_beyond_what_is_free() -> None:
    """Any up to 128 MiB, more only where it is packed in enough bytes, and never above 1 GiB."""
    assert most_unpacked(0) == most_unpacked(FREE_CHUNK_BYTES // MOST_RATIO) == FREE_CHUNK_BYTES
    assert 2_000_000 * MOST_RATIO == most_unpacked(2_000_000)
    assert MAX_CHUNK_BYTES == most_unpacked(2**40)


def test_the_longest_that_writers_make_is_no_damage() -> None:
    """A floor map of as many cells as any importer takes, with the longest note."""
    before = 2 * CHUNK_BYTES
    closing = 4096

    assert MOST_CELLS + 4096 <= MOST_EVENT_BYTES
    assert before + MOST_EVENT_BYTES + 4 * MOST_NOTE_CHARACTERS + closing <= FREE_CHUNK_BYTES


def test_a_summary_tells_of_no_chunk_that_is_larger() -> None:
    """What is refused where the chunk lies is refused where it is listed."""
    built = build_chunk(mcap.message(4, 0, 1000, 1000, bytes(2**17)), np.zeros(1, np.int64))
    fits, too_large = (
        memoryview(mcap.record(replace(built.facts, size=FREE_CHUNK_BYTES + more).index_at(0)))
        for more in (0, 1)
    )

    assert 1 == len(rows_of_indexes(fits, data_start=0, data_end=len(built.data)))
    with pytest.raises(ChunkDamage, match="larger than any is"):
        rows_of_indexes(too_large, data_start=0, data_end=len(built.data))


def test_an_lz4_chunk_is_unpacked_no_further_than_it_says() -> None:
    """64 MiB of zeros in a chunk that says one MiB: one byte more is seen, and it is damage."""
    lz4 = pytest.importorskip("lz4.frame")
    packed = lz4.compress(bytes(2**26))
    chunk = StoredChunk(0, len(packed), 1, 1, 2**20, 0, "lz4", 0, len(packed))
    tracemalloc.start()

    with pytest.raises(ChunkDamage, match=f"expected {2**20} bytes of records, got {2**20 + 1}"):
        chunk.records(packed)

    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2**24


def test_records_must_be_messages_that_tile_their_chunk() -> None:
    """Another opcode, or a length that is too short for a message or too long for the chunk."""
    record = mcap.message(4, 0, 1000, 1000, bytes(8))
    assert [0, len(record)] == walk(record * 2).tolist()
    for wrong in (
        b"\x04" + record[1:],
        record[:1] + struct.pack("<Q", 3) + record[9:],
        record[:1] + struct.pack("<Q", 99) + record[9:],
        record[:-1],
    ):
        with pytest.raises(ChunkDamage):
            walk(wrong)


def test_an_index_cannot_point_before_its_chunk() -> None:
    """To a message that ends where the chunk's records begin: it is not taken for one of them."""
    record = mcap.message(4, 0, 1000, 1000, bytes(8))
    size = len(record)
    index = struct.pack("<BQHI4q", 7, 38, 4, 32, 1000, -size, 1000, 0)
    file = record + record + index

    found = scan_by_index(file, np.array([2 * size]), file, np.array([size]), np.array([2 * size]))

    assert [size] == found.offsets.tolist()


def test_sightings_of_another_size_are_no_sightings(tmp_path: Path) -> None:
    """A record of the right channel whose payload is too long, in a chunk with a right checksum."""
    folder = tmp_path / "log"
    folder.mkdir()
    writer = SegmentWriter(LogFolder(folder), "log_000000.mcap", HEADER)
    writer.add(empty_keyframe(1))
    record = mcap.message(DoorObserved.kind, 0, 1000, 1000, bytes(99))
    writer.add(build_chunk(record, np.zeros(1, np.int64)))
    writer.install()
    writer.close()

    with pytest.raises(CorruptLogError, match="bytes long"):
        _read_all(folder)


@pytest.mark.parametrize("entry", ["first_event", "segment", "hash_so_far", "log_id", "sha256"])
def test_a_head_that_was_changed_is_named(entry: str) -> None:
    """Any entry of a segment's head, and the digest itself; so is one without a digest."""
    metadata = HEADER.to_metadata()
    assert HEADER == SegmentHeader.from_metadata(metadata)
    changed = metadata.metadata[entry].replace("0", "1") + "2"
    for entries in ({**metadata.metadata, entry: changed},
                    {k: v for k, v in metadata.metadata.items() if k != "sha256"}):  # fmt: skip
        forged = replace(metadata, metadata=entries)

        with pytest.raises(ValueError, match="fit its sha256"):
            SegmentHeader.from_metadata(forged)


def test_a_commit_is_hashed_with_all_its_records(tmp_path: Path) -> None:
    """By hand: the Commit's own record, then each channel's number and digest, ascending."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(name="front", actor="survey")
        log.append([DoorObserved(door_id=DoorId(1), state=sl.DoorState.OPEN) for _ in range(9)])
    digests: dict[int, hashlib._Hash] = {}
    hashed = []

    for _, page in sl.read(tmp_path / "log")._reader.pages():
        borders = [*page.offsets.tolist(), len(page.records)]
        for channel, (start, end) in zip(
            page.heads["channel_id"].tolist(), pairwise(borders), strict=True
        ):
            record = bytes(page.records[start:end])
            if channel == COMMIT_CHANNEL:
                parts = [c.to_bytes(2, "little") + d.digest() for c, d in sorted(digests.items())]
                expected = hashlib.sha256(record[:-32] + b"".join(parts)).digest()
                assert expected == record[-32:]
                hashed.append(len(parts))
                digests = {}
            elif channel != KEYFRAME_CHANNEL:
                digests.setdefault(channel, hashlib.sha256()).update(record)

    assert [3, 1] == hashed


def test_a_chunk_tells_the_times_of_its_messages(tmp_path: Path) -> None:
    """Its head and the summary agree on others: no search by time may skip it for that."""
    folder = tmp_path / "log"
    folder.mkdir()
    writer = SegmentWriter(LogFolder(folder), "log_000000.mcap", HEADER)
    built = empty_keyframe(1000)
    data = bytearray(built.data)
    struct.pack_into("<QQ", data, mcap.FRAME.size, 3, 4)
    writer.add(replace(built, data=bytes(data), facts=replace(built.facts, times=(3, 4))))
    writer.install()
    writer.close()

    with pytest.raises(CorruptLogError, match="least and greatest log time"):
        _read_all(folder)


def test_a_commit_must_count_its_events_in_a_live_segment(tmp_path: Path) -> None:
    """One that says two where there is one is torn, or damage: it does not count."""
    folder = tmp_path / "log"
    folder.mkdir()
    writer = SegmentWriter(LogFolder(folder), "log_000000.mcap", HEADER)
    writer.add(empty_keyframe(1))
    builder = CommitBuilder(STAMP, Note(), random.Random(1).randbytes)
    (built,) = builder.chunks([DoorAdded(door_id=DoorId(1))])
    offsets = walk(built.records)
    start = int(offsets[-1]) + mcap.MESSAGE.size
    commit = layout("Commit")
    fields = {**commit.unpack(built.records[start:]), "count": 2}
    forged = built.records[:start] + commit.pack(*(fields[name] for name in commit.fields))
    writer.add(build_chunk(forged, offsets))
    writer.install()
    writer.abandon()

    segment = open_segment(folder / "log_000000.mcap")

    assert 1 == len(segment.chunks)
    assert "does not count the events" in segment.problem


def test_the_head_of_a_compressed_chunk_must_be_what_the_summary_says(tmp_path: Path) -> None:
    """A flipped bit of the times in it changes no answer, and is named all the same."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        for _ in range(40):
            log.add_door()
    compact(tmp_path / "log")
    path = tmp_path / "log" / "log_000000.mcap"
    chunk = open_segment(path).chunks[1]
    assert "zstd" == chunk.compression
    data = bytearray(path.read_bytes())
    data[chunk.offset + mcap.FRAME.size] ^= 1
    path.write_bytes(data)

    with pytest.raises(CorruptLogError, match=f"damaged at byte {chunk.offset}"):
        _read_all(tmp_path / "log")


def test_a_segment_begins_with_the_event_after_the_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The number in its head counts by itself, also where the hash in it is right."""
    monkeypatch.setattr("semmap_log.store.writing.segment_chain.ROLL_COMMITS", 2)
    with sl.create(tmp_path / "log", tz="UTC", compact=False) as log:
        for _ in range(4):
            log.add_door()
    first, second = sl.read(tmp_path / "log")._reader.segments
    check_follows(second, last_commit(first), first)
    forged = replace(second, header=replace(second.header, first_event=99))

    with pytest.raises(CorruptLogError, match="event 99, but log_000000"):
        check_follows(forged, last_commit(first), first)


def test_no_sync_is_tried_again() -> None:
    """The kernel forgets what it could not write: a second sync would say that all is well."""
    syncs, tried = SharedSync(), []

    def fails() -> int:
        tried.append("once")
        raise OSError(5, "no")

    with pytest.raises(OSError, match="no"):
        syncs.make_durable(1, fails)
    with pytest.raises(LogPoisonedError, match="a sync failed"):
        syncs.make_durable(1, fails)

    assert ["once"] == tried


@pytest.mark.parametrize(
    ("offset", "index_bytes", "problem"),
    [
        (200, 0, ""),
        (200, 31, ""),
        (200, 32, "chunks that overlap"),
        (200, -1, "message indexes of negative size"),
        (2**62, 0, "a chunk outside the data"),
    ],
)
def test_chunk_indexes_that_contradict_each_other(
    offset: int, index_bytes: int, problem: str
) -> None:
    """Message indexes lie between their chunk and the next one, and all within the data."""
    length = 9 + 40 + 20
    indexes = b"".join(
        mcap.record(
            ChunkIndex(
                chunk_length=length, chunk_start_offset=start, compression="",
                compressed_size=20, message_end_time=1, message_index_length=size % 2**64,
                message_index_offsets={}, message_start_time=1, uncompressed_size=20,
            )
        )
        for start, size in ((100, index_bytes), (offset, 0))
    )  # fmt: skip

    if problem:
        with pytest.raises(ChunkDamage, match=problem):
            rows_of_indexes(memoryview(indexes), data_start=0, data_end=1000)
    else:
        rows = rows_of_indexes(memoryview(indexes), data_start=0, data_end=1000)
        assert [169 + index_bytes, offset + length] == rows["behind"].tolist()
