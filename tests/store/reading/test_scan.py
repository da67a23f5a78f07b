"""A segment that may be damaged, torn or growing: nothing counts that does not prove itself."""

from __future__ import annotations

import os
import random
import struct
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.commits import Commit, Durability, Note
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAnnotated, DoorObserved, Event
from semmap_log.errors import CorruptLogError
from semmap_log.store import records as mcap
from semmap_log.store.byte_layout import NO_HASH
from semmap_log.store.commit_records import CommitBuilder, Stamp
from semmap_log.store.folder import LogFolder
from semmap_log.store.header import LogInfo, SegmentHeader
from semmap_log.store.reading import live_scan
from semmap_log.store.reading.resync import whole_chunks
from semmap_log.store.reading.segment_reading import pages_of
from semmap_log.store.reading.segment_scan import Segment, open_segment
from semmap_log.store.record_scan import frames
from semmap_log.store.segment import SegmentWriter
from tests.store.logs import empty_keyframe

HEADER = SegmentHeader(LogInfo("ab" * 16, "UTC"), 0, 0, NO_HASH)
SEEN = DoorObserved(door_id=DoorId(1), state=sl.DoorState.OPEN, happened_ns=5)
STAMP = Stamp(0, 1000, NO_HASH, bytes(16), 1000, 0, bytes(16), durability=Durability.EVENT)

Change = Callable[[Stamp], Stamp]


def _live(
    path: Path, commits: Sequence[Sequence[Event]], *, durable: bool = True, last: Change = replace
) -> list[Commit]:
    """Write a live segment of these commits, byte by byte as a writer does.

    Args:
        path: Its file.
        commits: The events of each.
        durable: Whether each commit says that those before it were on the disk.
        last: Changes what the last commit says.
    """
    writer = SegmentWriter(LogFolder(path.parent), path.name, HEADER)
    writer.add(empty_keyframe(1))
    writer.install()
    made: list[Commit] = []
    stamp = STAMP
    for i, events in enumerate(commits):
        stamp = last(stamp) if i == len(commits) - 1 else stamp
        builder = CommitBuilder(stamp, Note(), random.Random(i).randbytes)
        for chunk in builder.chunks(events):
            writer.add(chunk)
        made.append(builder.commit)
        stamp = replace(
            STAMP,
            first_event=made[-1].last_event + 1,
            recorded_ns=made[-1].closed_ns + 1,
            previous_hash=made[-1].hash,
            durable_before=made[-1].last_event + 1 if durable else 0,
        )
    writer.abandon()
    return made


def _closed(path: Path, commits: int) -> None:
    """Write a closed segment of so many commits of one event."""
    with sl.create(path.parent, tz="UTC") as log:
        for _ in range(commits):
            log.add_door()
    (path.parent / f"{path.parent.name}_000000.mcap").rename(path)


def _events(segment: Segment) -> int:
    return sum(len(page.events()) for page in pages_of(segment))


def _changed(path: Path, at: int, data: bytes) -> None:
    """Put other bytes into a file, in place."""
    with path.open("r+b") as file:
        file.seek(at)
        file.write(data)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "log").mkdir()
    return tmp_path / "log" / "x.mcap"


def test_a_live_segment_reads_whole(path: Path) -> None:
    """Commits of one event, of many, and of several chunks."""
    _live(path, [[SEEN], [SEEN] * 100, [SEEN] * 20_000, [SEEN]])

    segment = open_segment(path)

    assert 20_102 == _events(segment)
    assert ("", 0, False) == (segment.problem, segment.torn_bytes, segment.closed)
    assert segment.size == segment.valid_end


@pytest.mark.parametrize(
    "where",
    ["opcode", "length", "start", "end", "size", "crc", "name", "stored", "records"],
)
def test_a_flipped_bit_of_any_field_of_a_chunk_is_damage(where: str, path: Path) -> None:
    """With commits behind it that call it durable: named with place and events, not one hidden."""
    _live(path, [[SEEN], [SEEN, SEEN, SEEN], [SEEN]])
    chunk = open_segment(path).chunks[2]
    at = {"opcode": 0, "length": 1, "start": 9, "end": 17, "size": 25, "crc": 33, "name": 37,
          "stored": 41, "records": 60}[where]  # fmt: skip
    whole = path.read_bytes()
    for at_byte in range(at, at + {"opcode": 1, "crc": 4, "name": 4}.get(where, 8)):
        for bit in range(8):
            byte = bytes([whole[chunk.offset + at_byte] ^ 1 << bit])
            _changed(path, chunk.offset + at_byte, byte)

            with pytest.raises(
                CorruptLogError,
                match=rf"x.mcap: damaged at byte {chunk.offset}: .*; events 1 to 3 are affected; "
                "whole commits follow it",
            ):
                open_segment(path)
            path.write_bytes(whole)


def test_a_bad_place_that_nobody_called_durable_is_a_torn_tail(path: Path) -> None:
    """Unsynced commits lost sectors in any order: what is whole before them counts."""
    _live(path, [[SEEN], [SEEN], [SEEN], [SEEN]], durable=False)
    chunk = open_segment(path).chunks[2]
    _changed(path, chunk.data_offset, bytes(50))

    segment = open_segment(path)

    assert 1 == _events(segment)
    assert chunk.offset == segment.valid_end
    assert segment.size - chunk.offset == segment.torn_bytes
    assert "its CRC says" in segment.problem


def test_nothing_stays_mapped(tmp_path: Path) -> None:
    """When a log is let go of, so are its files: a disk can be unmounted, removed ones free it."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as log:
        log.add_door()
    opened = sl.read(path)
    assert 1 == len(opened.replay())
    assert str(path) in Path("/proc/self/maps").read_text()

    del opened, log

    assert str(path) not in Path("/proc/self/maps").read_text()


def test_the_tables_of_a_long_log_are_not_all_kept(path: Path) -> None:
    """Of the segments that were read only some keep theirs; the others make it again when asked."""
    _closed(path, 3)
    segments = [open_segment(path) for _ in range(200)]

    lengths = {len(segment.chunks) for segment in segments}

    assert {4} == lengths
    assert 64 == sum("_table" in vars(segment) for segment in segments)
    assert 4 == len(segments[0].chunks)


def test_message_indexes_are_never_looked_at(path: Path) -> None:
    """Whatever their bytes say, in a live segment: opcodes and lengths of records, too."""
    _live(path, [[SEEN], [SEEN, SEEN], [SEEN]])
    table = open_segment(path).chunks
    ends = [chunk.offset + chunk.length for chunk in table]
    starts = [*(chunk.offset for chunk in table[1:]), path.stat().st_size]
    rng = random.Random(3)
    for end, start in zip(ends, starts, strict=True):
        _changed(path, end, rng.randbytes(start - end))

    assert 4 == _events(open_segment(path))


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda s: replace(s, recorded_ns=s.recorded_ns - 1), "a log time that is not after"),
        (lambda s: replace(s, first_event=s.first_event + 1), "an event number that does not"),
        (lambda s: replace(s, previous_hash=bytes(32)), "a Commit that does not follow the commit"),
    ],
    ids=["time", "number", "hash"],
)
def test_a_commit_must_follow_the_one_before(change: Change, problem: str, path: Path) -> None:
    """A chunk that is whole, its CRC right, but from elsewhere: it does not count."""
    _live(path, [[SEEN], [SEEN], [SEEN]], last=change)

    segment = open_segment(path)

    assert 2 == _events(segment)
    assert segment.problem.startswith(problem)


@pytest.mark.parametrize("at", [0, 3])
def test_damage_before_the_first_commit_is_no_torn_tail(at: int, path: Path) -> None:
    """Head and keyframe were synced before the file had its name."""
    _live(path, [[SEEN]])
    keyframe = open_segment(path).chunks[0]
    data = path.read_bytes()
    _changed(path, keyframe.offset + at, bytes([data[keyframe.offset + at] ^ 0x10]))

    with pytest.raises(CorruptLogError, match=f"damaged at byte {keyframe.offset}"):
        open_segment(path)


@pytest.mark.slow
def test_a_segment_read_in_steps_is_as_read_at_once(path: Path) -> None:
    """It grows by any number of bytes between two looks, in the middle of chunks and indexes."""
    _live(path, [[SEEN], [SEEN, SEEN], [SEEN] * 20_000, [SEEN]])
    data = path.read_bytes()
    start = open_segment(path).chunks[1].offset
    path.write_bytes(data[:start])
    rng = random.Random(7)
    segment, at = open_segment(path), start
    while at < len(data):
        step = rng.choice([1, 10, 300, 50_000])
        with path.open("ab") as file:
            file.write(data[at : at + step])
        at += step

        grown = open_segment(path, earlier=segment)

        once = open_segment(path)
        table = once.chunks
        assert table.rows.tolist() == grown.chunks.rows.tolist()
        assert once.spans.tolist() == grown.spans.tolist()
        same = {"table": table, "spans": None}
        assert replace(once.live, **same) == replace(grown.live, **same)
        segment = grown
    assert 20_004 == _events(segment)


def test_reading_on_costs_what_was_added(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a thousand commits that are known already no chunk is looked at again."""
    _live(path, [[SEEN]] * 1000)
    data = path.read_bytes()
    cut = open_segment(path).chunks[998].offset
    path.write_bytes(data[:cut])
    earlier = open_segment(path)
    with path.open("ab") as file:
        file.write(data[cut:])
    looks: list[int] = []

    def counted(file: memoryview, offset: int, length: int, base: int) -> object:
        looks.append(offset)
        return read_head(file, offset, length, base)

    read_head = live_scan.read_chunk_head
    monkeypatch.setattr(live_scan, "read_chunk_head", counted)
    segment = open_segment(path, earlier=earlier)

    assert 1000 == _events(segment)
    assert 3 == len(looks)


def test_another_file_of_that_name_is_read_anew(path: Path, tmp_path: Path) -> None:
    """Recovery puts a new file in place: what was known of the old one says nothing of it."""
    _live(path, [[SEEN]] * 5)
    earlier = open_segment(path)
    _live(tmp_path / "other.mcap", [[SEEN], [SEEN]])
    (tmp_path / "other.mcap").rename(path)

    segment = open_segment(path, earlier=earlier)

    assert (2, 5) == (_events(segment), _events(earlier))


@pytest.mark.parametrize("back", range(1, 38))
def test_a_damaged_footer_is_harmless_or_named(back: int, path: Path) -> None:
    """Of the last 37 bytes each: the segment reads as live, or what is wrong is named."""
    _closed(path, 3)
    data = bytearray(path.read_bytes())
    data[-back] ^= 0x04
    path.write_bytes(data)

    segment = open_segment(path)

    if segment.closed:
        with pytest.raises(CorruptLogError, match=r"its summary|its footer|DataEnd"):
            _events(segment)
    else:
        assert (3, 0) == (_events(segment), segment.torn_bytes)


@pytest.mark.slow
def test_every_byte_of_the_summary_counts(path: Path) -> None:
    """A flipped bit anywhere behind the data is named; the data can still be walked without it."""
    _closed(path, 3)
    data = path.read_bytes()
    summary = open_segment(path).summary
    for at in [
        *range(summary.data_end + 13, len(data) - 37, 41),
        *range(len(data) - 400, len(data) - 37),
    ]:
        _changed(path, at, bytes([data[at] ^ 0x20]))
        segment = open_segment(path)

        with pytest.raises(CorruptLogError, match="its summary does not fit its CRC"):
            _ = segment.chunks

        walked = live_scan.scan_live(path, segment.header, segment.source, segment.head_end)
        assert (4, "") == (len(walked.chunks), walked.problem)
        _changed(path, at, data[at : at + 1])


@pytest.mark.parametrize("field", [1, 9, 17, 25, 33, 41, 0], ids=str)
def test_a_closed_chunk_must_be_what_the_summary_says(field: int, path: Path) -> None:
    """Opcode, length, times, sizes, CRC: opening does not look, reading does."""
    _closed(path, 3)
    chunk = open_segment(path).chunks[2]
    data = path.read_bytes()
    _changed(path, chunk.offset + field, bytes([data[chunk.offset + field] ^ 1]))

    segment = open_segment(path)

    with pytest.raises(CorruptLogError, match=f"damaged at byte {chunk.offset}: "):
        _events(segment)
    with pytest.raises(CorruptLogError, match=f"damaged at byte {chunk.offset}: "):
        list(pages_of(replace(segment), first_chunk=2))


def reading(data: bytes) -> Callable[[int, int], memoryview]:
    return lambda start, end: memoryview(data)[start:end]


def test_whole_chunks_are_found_in_garbage(path: Path) -> None:
    """Between random bytes and after lengths that lie: the whole ones, no others."""
    _live(path, [[SEEN] * n for n in (1, 5, 20_000, 2)])
    data = path.read_bytes()
    rng = random.Random(5)
    chunks = list(open_segment(path).chunks)
    pieces, places = [rng.randbytes(1001)], []
    for chunk in chunks:
        places.append(sum(map(len, pieces)) + 9)
        pieces += [
            struct.pack("<BQ", 6, rng.randrange(2**60)),
            data[chunk.offset :][: chunk.length],
        ]
        pieces += [data[chunk.offset :][: chunk.length - 1], rng.randbytes(77)]
    garbage = b"".join(pieces)

    found = [c.offset for c, _, _ in whole_chunks(reading(garbage), 0, len(garbage))]

    assert places == found


@pytest.mark.slow
def test_a_search_ends_soon_in_zeros_and_in_chunk_opcodes() -> None:
    """Tails as disks leave them, 8 MiB each: nothing is found, and nothing takes long."""
    for tail in (bytes(2**23), b"\x06" * 2**23, b"\x06\0\0\0" * 2**21):
        assert [] == list(whole_chunks(reading(tail), 0, len(tail)))


def test_behind_a_bad_place_only_some_is_in_memory(path: Path) -> None:
    """A file with a hole, longer than the machine has memory: the whole commits are there."""
    _live(path, [[SEEN], [SEEN]])
    os.truncate(path, path.stat().st_size + 2**28)

    tracemalloc.start()
    try:
        segment = open_segment(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()

    assert 2 == _events(segment)
    assert peak < 2**26


def test_a_chunk_of_a_huge_size_is_no_allocation(path: Path) -> None:
    """A zstd frame that claims gigabytes is damage, found before memory is asked for."""
    import zlib

    zstandard = pytest.importorskip("zstandard")
    _live(path, [[SEEN]])
    context = zstandard.ZstdCompressor()
    stored = context.compress(bytes(2**20))
    data = mcap.chunk_head(
        stored_size=len(stored), size=2**19, compression="zstd", crc=zlib.crc32(bytes(2**19)),
        start=10**6, end=10**6,
    ) + stored  # fmt: skip
    with path.open("ab") as file:
        file.write(data)

    segment = open_segment(path)

    assert 1 == _events(segment)
    assert "its zstd frame does not hold 524288 bytes" == segment.problem


def test_texts_that_hold_chunks_hide_nothing(path: Path) -> None:
    """What looks like a chunk inside a payload is not taken for one."""
    _live(path, [[SEEN]])
    chunk = open_segment(path).chunks[1]
    inside = path.read_bytes()[chunk.offset : chunk.offset + chunk.length].decode("latin-1")
    note = DoorAnnotated(door_id=DoorId(1), key="k", value=inside.replace("\0", " "))
    path.unlink()
    _live(path, [[SEEN], [note], [SEEN]])

    assert 3 == _events(open_segment(path))


def _cuts(data: bytes, head: int) -> list[int]:
    """Return where to cut: all over, and where each record of the head ends."""
    ends = (at + length for _, at, length in frames(data, len(mcap.MAGIC), head))
    return sorted({*range(0, len(data), 97), *ends})


def test_a_file_cut_anywhere_is_never_another_log(path: Path) -> None:
    """Cut in its head it is no log, or damaged; behind, exactly the whole commits are there."""
    _live(path, [[SEEN]] * 20)
    data = path.read_bytes()
    ends = [chunk.offset + chunk.length for chunk in open_segment(path).chunks]
    for size in _cuts(data, ends[0]):
        path.write_bytes(data[:size])
        if size < ends[0]:
            with pytest.raises(sl.SemmapError):
                open_segment(path)
        else:
            assert sum(end <= size for end in ends) - 1 == _events(open_segment(path))
