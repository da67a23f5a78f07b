"""A closed segment rechunked: the same records in large compressed chunks, or the old file."""

from __future__ import annotations

import random
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.errors import CorruptLogError
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import (
    CHUNK_BYTES,
    COMMIT_CHANNEL,
    KEYFRAME_CHANNEL,
    KEYFRAME_EVERY_BYTES,
)
from semmap_log.store.chunks import BuiltChunk, build_chunk
from semmap_log.store.compaction import compact, compact_segment, merge
from semmap_log.store.compaction.merge import needs_compaction, rechunked
from semmap_log.store.folder import LogFolder
from semmap_log.store.pages import Page
from semmap_log.store.reading.segment_reading import last_commit, page_at
from semmap_log.store.reading.segment_scan import open_segment
from semmap_log.store.record_scan import walk
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.writing import segment_chain
from tests.conftest import SteadyClock
from tests.store.logs import (
    answers,
    chunk_sizes,
    digest_of_records,
    segment_files,
    sightings,
    write_log,
)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """One closed segment: 300 small commits, then one of several chunks, then small ones again."""
    path = write_log(tmp_path / "log", 300)
    with sl.append(path) as opened:
        opened.append(sightings(sl.DoorId(1), 40_000), note=sl.Note(reason="import"))
        for number in range(20):
            opened.append(sightings(sl.DoorId(1), 2, number))
    return path


def test_the_same_records_in_chunks_of_about_a_mib(log: Path) -> None:
    """The keyframe by itself, then zstd chunks of 1 to 2 MiB."""
    before, (path,) = digest_of_records(log), segment_files(log)
    size = path.stat().st_size

    compacted = compact_segment(LogFolder(path.parent), path.name)

    assert compacted
    assert before == digest_of_records(log)
    assert path.stat().st_size < size
    keyframe, *full, last = chunk_sizes(path)
    assert {"zstd"} == {compression for compression, _ in (*full, last)}
    assert 200 < keyframe[1] < 5000
    chunks = [chunk for _, chunk in full if chunk > 5000]
    assert all(KEYFRAME_EVERY_BYTES <= chunk < 2 * CHUNK_BYTES for chunk in chunks)
    assert 2 == sum(CHUNK_BYTES <= chunk for chunk in chunks)
    assert 3 == len(chunks)


def test_a_second_time_nothing_is_done(log: Path) -> None:
    """It is seen without writing; and if it is done all the same, the bytes are the same."""
    (path,) = segment_files(log)
    compact_segment(LogFolder(path.parent), path.name)
    before, node = path.read_bytes(), path.stat().st_ino

    assert not compact_segment(LogFolder(path.parent), path.name)
    assert node == path.stat().st_ino
    with rechunked(LogFolder(path.parent), [open_segment(path)]) as again:
        assert again.temporary is not None
        assert before == (path.parent / again.temporary).read_bytes()


def test_the_bytes_do_not_depend_on_when_it_was_compacted(tmp_path: Path) -> None:
    """Compacted between its sessions a log ends as one that was compacted at the end."""
    compacted = []
    for between in (True, False):
        clock, entropy = SteadyClock(), random.Random(7).randbytes
        path = tmp_path / str(between) / "log"
        sl.create(path, tz="UTC", clock=clock, entropy=entropy).close()
        for session in range(4):
            with sl.append(path, clock=clock, entropy=entropy) as opened:
                door = opened.add_door()
                opened.append(sightings(door, 7000, session))
            if between:
                compact(path)
        compact(path)
        compacted.append([file.read_bytes() for file in segment_files(path)])

    assert compacted[0] == compacted[1]


def test_what_zstd_does_not_shrink_stays_plain(tmp_path: Path) -> None:
    """Compressed it would be longer, and be read more slowly."""
    noise = mcap.message(0xABCD, 0x12345678, 2**62 + 7, 3**38, random.Random(7).randbytes(200))
    zeros = mcap.message(1, 0, 1, 1, bytes(200))

    kept = [merge._smallest(Page(record, 0, tmp_path)).facts for record in (noise, zeros)]

    assert [("", 231), ("zstd", 231)] == [(facts.compression, facts.size) for facts in kept]


def test_a_live_segment_is_refused(tmp_path: Path) -> None:
    """Its writer may be writing to it."""
    with sl.create(tmp_path / "log", tz="UTC") as opened:
        opened.add_door()
        (path,) = segment_files(tmp_path / "log")

        with pytest.raises(CorruptLogError, match="not closed"):
            compact_segment(LogFolder(path.parent), path.name)


@pytest.mark.slow
def test_memory_is_that_of_a_few_chunks(tmp_path: Path) -> None:
    """Three times the records take no more of it."""
    peaks = []
    for commits in (2, 6):
        path = tmp_path / str(commits) / "log"
        with sl.create(path, tz="UTC") as opened:
            door = opened.add_door()
            for number in range(commits):
                opened.append(sightings(door, 30_000, number))
        segment = open_segment(segment_files(path)[0])
        tracemalloc.start()
        try:
            with rechunked(LogFolder(path), [segment]):
                peaks.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()

    assert peaks[1] < 1.2 * peaks[0]
    assert peaks[0] < 20 * 2**20


@pytest.mark.parametrize("where", [0.1, 0.5, 0.9])
def test_a_flipped_bit_leaves_the_segment_as_it_is(log: Path, where: float) -> None:
    """The error names file and byte; nothing is left beside the file."""
    (path,) = segment_files(log)
    chunks = open_segment(path).chunks
    chunk = chunks[int(len(chunks) * where)]
    data = bytearray(path.read_bytes())
    data[chunk.data_offset + chunk.stored_size // 2] ^= 4
    path.write_bytes(data)

    with pytest.raises(CorruptLogError, match=f"log_000000.mcap: damaged at byte {chunk.offset}"):
        compact_segment(LogFolder(path.parent), path.name)

    assert bytes(data) == path.read_bytes()
    assert [] == list(log.glob(".*.tmp"))


Records = list[bytes]


def rewritten(path: Path, change: Callable[[Records], Records]) -> None:
    """Write a segment anew with other records, every CRC and statistic of which is right."""
    segment = open_segment(path)
    records: Records = []
    for chunk in range(len(segment.chunks)):
        data = bytes(page_at(segment, chunk).records)
        starts = [*walk(data).tolist(), len(data)]
        records += [data[a:b] for a, b in pairwise(starts)]
    writer = SegmentWriter(LogFolder(path.parent), path.name, segment.header)
    for record in change(records):
        writer.add(build_chunk(record, np.zeros(1, np.int64)))
    writer.close()
    writer.install(replacing=segment.source.identity)


def channel_of(record: bytes) -> int:
    channel: int = mcap.MESSAGE.unpack_from(record)[2]
    return channel


def without_an_event(records: Records) -> Records:
    return records[:12] + records[13:]


def two_commits_swapped(records: Records) -> Records:
    at = [i for i, record in enumerate(records) if channel_of(record) == COMMIT_CHANNEL]
    first, second = at[3], at[4]
    return [
        *records[: first + 1],
        *records[second + 1 : at[5] + 1],
        *records[first + 1 : second + 1],
        *records[at[5] + 1 :],
    ]


def another_hash(records: Records) -> Records:
    at = [i for i, record in enumerate(records) if channel_of(record) == COMMIT_CHANNEL][5]
    return [*records[:at], records[at][:-1] + bytes([records[at][-1] ^ 1]), *records[at + 1 :]]


def another_count(records: Records) -> Records:
    at = [i for i, record in enumerate(records) if channel_of(record) == COMMIT_CHANNEL][5]
    count = mcap.MESSAGE.size + 20
    changed = bytearray(records[at])
    changed[count] += 1
    return [*records[:at], bytes(changed), *records[at + 1 :]]


def a_commit_too_long(records: Records) -> Records:
    at = [i for i, record in enumerate(records) if channel_of(record) == COMMIT_CHANNEL][5]
    fields = mcap.MESSAGE.unpack_from(records[at])
    payload = records[at][mcap.MESSAGE.size :] + b"\0"
    return [*records[:at], mcap.message(*fields[2:], payload), *records[at + 1 :]]


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (without_an_event, "event number that does not follow"),
        (two_commits_swapped, "event number that does not follow"),
        (another_hash, "does not follow the commit before"),
        (another_count, "does not count the events before"),
        (a_commit_too_long, "a Commit of a wrong size"),
    ],
)
def test_records_that_do_not_follow_each_other_are_damage(
    tmp_path: Path, change: Callable[[Records], Records], problem: str
) -> None:
    """With every CRC right: such a segment is not made to look like a sound one."""
    (path,) = segment_files(write_log(tmp_path / "log", 30))
    rewritten(path, change)
    before = path.read_bytes()

    with pytest.raises(CorruptLogError, match=problem):
        compact_segment(LogFolder(path.parent), path.name)

    assert before == path.read_bytes()


def test_rewritten_records_are_sound(tmp_path: Path) -> None:
    """The helper above changes nothing else."""
    log = write_log(tmp_path / "log", 30)
    before = digest_of_records(log)

    rewritten(segment_files(log)[0], lambda records: records)

    assert before == digest_of_records(log)
    assert compact_segment(LogFolder(segment_files(log)[0].parent), segment_files(log)[0].name)


@pytest.mark.parametrize(
    ("field", "value", "problem"),
    [
        ("first_event", 29, "begins with event 29, but .* ends before event 30"),
        ("hash_so_far", bytes(32), "follows the commit 000000000000"),
    ],
)
def test_a_segment_that_does_not_follow_is_not_merged(
    tmp_path: Path, field: str, value: object, problem: str
) -> None:
    """What its head says of the segment before must be what that one ends with."""
    (path,) = segment_files(write_log(tmp_path / "log", 30))
    segment = open_segment(path)
    after = segment.header.next(30, last_commit(segment).hash)
    behind = replace(segment, path=tmp_path / "behind", header=replace(after, **{field: value}))

    with (
        pytest.raises(CorruptLogError, match=problem),
        rechunked(LogFolder(path.parent), [segment, behind]),
    ):
        pass


def other_payload(page: Page) -> BuiltChunk:
    """Build a chunk in which one bit of a payload differs, its CRC right."""
    records = bytearray(page.records)
    records[-1] ^= 1
    return build_chunk(bytes(records), page.offsets, compression="zstd")


def a_message_less(page: Page) -> BuiltChunk:
    if page.heads["channel_id"][0] == KEYFRAME_CHANNEL:
        return build_chunk(bytes(page.records), page.offsets)
    end = int(page.offsets[-1])
    return build_chunk(bytes(page.records)[:end], page.offsets[:-1])


@pytest.mark.parametrize(
    ("build", "what"), [(other_payload, "its records"), (a_message_less, "the number or the time")]
)
def test_a_copy_that_differs_is_thrown_away(
    log: Path, monkeypatch: pytest.MonkeyPatch, build: Callable[[Page], BuiltChunk], what: str
) -> None:
    """Were there a mistake in the making, the comparison with what is in the file would find it."""
    (path,) = segment_files(log)
    before = path.read_bytes()
    assert needs_compaction(open_segment(path))
    monkeypatch.setattr(merge, "_smallest", build)

    with pytest.raises(CorruptLogError, match=f"its compacted copy differs in {what}"):
        compact_segment(LogFolder(path.parent), path.name)

    assert before == path.read_bytes()
    assert [] == list(log.glob(".*.tmp"))


def test_a_copy_with_another_head_is_thrown_away(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The head is read back from the file, too."""
    (path,) = segment_files(log)
    genuine = merge.open_segment
    monkeypatch.setattr(
        merge,
        "open_segment",
        lambda path, folder: replace(
            genuine(path), header=replace(genuine(path).header, hash_so_far=bytes(range(32)))
        ),
    )

    with pytest.raises(CorruptLogError, match="differs in its head"):
        compact_segment(LogFolder(path.parent), path.name)


def test_segments_of_a_roll_each_keep_their_number(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without merging: as many files, names and headers as before, metadata.yaml byte for byte."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 50)
    log = write_log(tmp_path / "log", 220)
    before = [open_segment(path).header for path in segment_files(log)]
    listed, told = (log / "metadata.yaml").read_bytes(), answers(log)

    compact(log, merge=False)

    assert before == [open_segment(path).header for path in segment_files(log)]
    assert 5 == len(before)
    assert listed == (log / "metadata.yaml").read_bytes()
    assert told == answers(log)
