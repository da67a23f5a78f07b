"""A mapped file as a source of bytes, and what is read from one by ranges."""

from __future__ import annotations

import gc
import os
import random
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.errors import CorruptLogError, NotALogError, UnreadableLogError
from semmap_log.store.reading import chunk_table, live_scan, mapped_file
from semmap_log.store.reading.chunk_table import ChunkTable
from semmap_log.store.reading.mapped_file import MappedFile, map_file
from semmap_log.store.reading.page_reading import read_page
from semmap_log.store.reading.segment_scan import open_segment
from tests.store.eventful import eventful_log
from tests.store.logs import segment_files, write_log

SEEN_BYTES = np.array([0.9], "<f8").tobytes()
"""Of a sighting: its accuracy."""
DATA = random.Random(4).randbytes(50_000)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "file"
    path.write_bytes(DATA)
    return path


def _removed(path: Path) -> MappedFile:
    opened = map_file(path)
    path.unlink()
    return opened


def _replaced(path: Path) -> MappedFile:
    opened = map_file(path)
    path.unlink()
    path.write_bytes(bytes(len(DATA)))
    return opened


def _descriptors() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


@pytest.mark.parametrize("how", [map_file, _removed, _replaced])
def test_ranges_are_sliced_as_bytes_are(how: type, file: Path) -> None:
    """By its name or not: any range, those that reach behind the end, none at all, and several."""
    opened = how(file)
    rng = random.Random(1)
    for _ in range(200):
        start, end = rng.randrange(60_000), rng.randrange(60_000)
        assert DATA[start:end] == opened.read(start, end)
    ranges = [(5, 7), (49_990, 70_000), (8, 8), (0, 4097)]
    assert b"".join(DATA[a:b] for a, b in ranges) == opened.read_ranges(ranges)
    assert b"" == opened.read_ranges([])
    assert opened.read(0, 10).readonly
    assert opened.is_guarded == (how is map_file)


def test_an_empty_file_and_what_is_none(tmp_path: Path) -> None:
    """There is nothing to read in the one; the other is refused."""
    (tmp_path / "empty").touch()

    assert b"" == map_file(tmp_path / "empty").read(0, 100)
    with pytest.raises(NotALogError, match="not a regular file"):
        map_file(tmp_path)


def test_no_descriptor_stays_open(file: Path) -> None:
    """Of a long log's thousand files none is held, neither read by its name nor without."""
    gc.collect()  # what other tests have let go of, closed here and not while it is counted
    before = _descriptors()
    opened = [map_file(file) for _ in range(20)]
    opened[0].read(0, 100)
    other = _replaced(file)
    other.read(0, 100)
    _ = other.is_guarded

    assert before == _descriptors()


def test_what_was_read_is_private(file: Path) -> None:
    """Neither a writer nor a removal changes it afterwards."""
    read = map_file(file).read(0, 50_000)
    with file.open("r+b") as changed:
        changed.write(bytes(50_000))
        changed.truncate(7)

    assert DATA == read


def test_a_file_that_may_not_be_opened_any_more_is_copied(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No descriptors left, say: its bytes are there all the same."""
    opened = map_file(file)

    def refused(*_: object, **__: object) -> int:
        raise OSError(24, "Too many open files")

    monkeypatch.setattr(os, "open", refused)

    assert DATA[10:20_000] == opened.read(10, 20_000)


def test_an_error_of_the_system_is_told_with_its_place(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page that cannot be read, though more was asked for at once."""
    bad = range(8192, 12_288)

    def read_into(fd: int, target: memoryview, at: int) -> int:
        if set(bad) & set(range(at, at + len(target))):
            raise OSError(5, "Input/output error")
        return os.preadv(fd, [target], at)

    opened = map_file(file)
    monkeypatch.setattr("semmap_log.core.io.disk.read_into", read_into)
    monkeypatch.setattr(mapped_file, "read_into", read_into)

    with pytest.raises(UnreadableLogError, match="byte 8192: Input/output") as e:
        opened.read(100, 40_000)

    assert 8192 == e.value.offset
    assert DATA[100:8192] == opened.read(100, 8192)
    assert DATA[12_288:40_000] == opened.read(12_288, 40_000)


@pytest.mark.parametrize("to", [0, 8192, 10_000])
def test_a_copy_of_what_was_cut_is_an_error(to: int, file: Path) -> None:
    """Cut by another of its names, its own gone: named is the first page that is not there."""
    file.with_name("other").hardlink_to(file)
    opened = _replaced(file)
    os.truncate(file.with_name("other"), to)
    end = -(-to // 4096) * 4096

    with pytest.raises(UnreadableLogError, match=f"cannot be read at byte {end}: the disk ref"):
        opened.read(0, 50_000)

    assert DATA[:to] == opened.read(0, to)


def test_what_has_lost_its_name_is_checked_again(tmp_path: Path) -> None:
    """Somebody else may change the file unseen."""
    log = write_log(tmp_path / "log", 50)
    (file,) = segment_files(log)
    opened = sl.read(log)
    right = repr(opened.replay())
    segment = opened._reader.segments[0]
    assert segment.is_sound
    file.with_name("other").hardlink_to(file)
    data = file.read_bytes()
    file.unlink()
    file.write_bytes(data)
    assert right == repr(opened.replay())
    row = segment.chunks.rows[20]
    at = data.index(SEEN_BYTES, int(row["offset"]))
    with file.with_name("other").open("r+b") as other:
        other.seek(at)
        other.write(bytes(len(SEEN_BYTES)))

    with pytest.raises(CorruptLogError, match=rf"byte {int(row['offset'])}: its CRC says"):
        list(opened.batches())


@pytest.mark.parametrize("window", [1, 50, 300, 5000])
def test_a_live_segment_is_read_in_windows(
    window: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However small they are, and wherever they end: the same chunks, places and spans."""
    eventful_log(tmp_path / "log", copy=tmp_path / "live", per_segment=100)
    (path,) = segment_files(tmp_path / "live")
    whole = open_segment(path).live
    monkeypatch.setattr(live_scan, "WINDOW_BYTES", window)
    monkeypatch.setattr(live_scan, "_HEAD_BYTES", window)

    scan = open_segment(path).live

    assert whole is not None
    assert scan is not None
    assert whole.table.rows.tolist() == scan.table.rows.tolist()
    assert whole.spans.tolist() == scan.spans.tolist()
    assert (whole.at, whole.place, whole.problem) == (scan.at, scan.place, scan.problem)


@pytest.mark.parametrize("compact", [False, True])
def test_chunks_that_lie_apart_are_read_together(
    compact: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Any choice of them gives the records that each alone gives; what lies between is left out."""
    from semmap_log.store.compaction import compact as make_small

    log = write_log(tmp_path / "log", 400, per_commit=3 if not compact else 200)
    if compact:
        make_small(log)
    segment = open_segment(segment_files(log)[0])
    monkeypatch.setattr(chunk_table, "GAP_BYTES", 0)
    rng = random.Random(2)
    alone = [read_page(segment.chunks[i : i + 1], 0).records for i in range(len(segment.chunks))]
    is_plain = segment.chunks.are_plain
    for _ in range(30):
        some = np.flatnonzero(np.array([rng.random() < 0.3 for _ in alone]))
        some = some[is_plain[some] == is_plain[some[0]]] if len(some) else some
        if len(some):
            page = read_page(segment.chunks.chosen(some), 0)
            assert b"".join(alone[i] for i in some.tolist()) == page.records

    chosen = segment.chunks.chosen(np.array([0, len(alone) - 1]))
    assert len(chosen.loaded().data) == int((chosen.rows["behind"] - chosen.rows["offset"]).sum())


def test_a_table_knows_where_message_indexes_end(tmp_path: Path) -> None:
    """As a scan computes it, and as a summary says it."""
    closed = eventful_log(tmp_path / "log", copy=tmp_path / "live", per_segment=100)
    (one,), (other,) = segment_files(closed), segment_files(tmp_path / "live")
    told: list[ChunkTable] = [open_segment(one).chunks, open_segment(other).chunks]

    assert told[0].rows[: len(told[1])].tolist() == told[1].rows.tolist()
    behind, following = told[0].rows["behind"], told[0].rows["offset"][1:]
    assert (behind[:-1] <= following).all()
