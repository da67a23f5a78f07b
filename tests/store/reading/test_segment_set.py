"""Which files of a folder are the log; one that is missing, foreign, twice or cut is named."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import CorruptLogError, LogAccessError, NotALogError
from semmap_log.store.chunks import build_chunk
from semmap_log.store.compaction.merge import MERGED_KEPT_S
from semmap_log.store.folder import LogFolder
from semmap_log.store.header import SegmentHeader
from semmap_log.store.reading import segment_folder
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import chunk_of, commit_of, pages_of
from semmap_log.store.reading.segment_scan import open_segment
from semmap_log.store.record_scan import walk
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.writing import segment_chain


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Six segments of two commits."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 2)
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", compact=False) as writing:
        for _ in range(12):
            writing.add_door()
    return path


def _segment(log: Path, number: int) -> Path:
    """Return the file of that number; a copy of a log goes on under its own folder's name."""
    (found,) = log.glob(f"*_{number:06d}.mcap")
    return found


def _merge(log: Path, numbers: Sequence[int], to: Path) -> None:
    """Write a segment that stands for several, as merging does, each of them as one chunk."""
    segments = [open_segment(_segment(log, number)) for number in numbers]
    first = segments[0].header
    header = SegmentHeader(
        first.info, first.number, first.first_event, first.hash_so_far, segments[-1].header.number
    )
    writer = SegmentWriter(LogFolder(to.parent), to.name, header)
    for segment in segments:
        records = b"".join(page.records for page in pages_of(segment))
        writer.add(build_chunk(records, walk(records)))
    writer.close()
    to.unlink(missing_ok=True)
    writer.install()


def _numbers(log: Path) -> list[int]:
    return [n for batch in LogReader(log).batches() for n in batch.number.tolist()]


def test_names_do_not_matter(log: Path) -> None:
    """The order comes from the heads: files under any name, as backups leave them."""
    for i, path in enumerate(sorted(log.glob("*.mcap"), reverse=True)):
        path.rename(log / f"copy {i}.mcap")

    assert list(range(12)) == _numbers(log)


@pytest.mark.parametrize("number", range(5))
def test_a_missing_segment_is_named(number: int, log: Path) -> None:
    """The first, or one between; the last cannot be missed without a head hash kept elsewhere."""
    _segment(log, number).unlink()

    with pytest.raises(CorruptLogError, match=rf"one is missing; segment {number} is not in "):
        LogReader(log)


def test_a_segment_that_is_there_twice_is_named(log: Path) -> None:
    """With the other file's name."""
    shutil.copy(_segment(log, 3), log / "copy.mcap")

    with pytest.raises(CorruptLogError, match=r"segment 3"):
        LogReader(log)


def test_a_foreign_segment_is_named(log: Path, tmp_path: Path) -> None:
    """It has the right number, but it is of another log."""
    with sl.create(tmp_path / "other", tz="UTC") as writing:
        for _ in range(12):
            writing.add_door()
    shutil.copy(tmp_path / "other" / "other_000002.mcap", _segment(log, 2))

    with pytest.raises(CorruptLogError, match=r"log_000002.mcap: .*: a segment"):
        LogReader(log)


@pytest.mark.parametrize(
    "ask",
    [
        lambda reader: list(reader.pages()),
        lambda reader: list(reader.batches()),
        lambda reader: reader.event_known_at(2**62),
        lambda reader: reader.find_commit(0),
    ],
)
def test_a_segment_of_a_copy_that_went_another_way_is_named(
    ask: Callable[[LogReader], object], log: Path, tmp_path: Path
) -> None:
    """Its log id, number and first event are right, and the events before it are others."""
    copy = tmp_path / "elsewhere" / "log"
    shutil.copytree(log, copy)
    for path in (log, copy):
        with sl.append(path) as writing:
            for number in range(6):
                writing.add_door(name=f"{number} in {path.parent.name}")
    shutil.copy(_segment(copy, 7), _segment(log, 7))

    with pytest.raises(CorruptLogError, match=r"log_000007.mcap"):
        ask(LogReader(log))


@pytest.mark.parametrize("at", [0, 5, 9, 22])
def test_a_segment_whose_head_is_damaged_is_named(at: int, log: Path) -> None:
    """Among segments of ours, a file without our head is damage, not somebody else's bag."""
    path = _segment(log, 2)
    data = bytearray(path.read_bytes())
    data[at] ^= 0x08
    path.write_bytes(data)

    for opening in (sl.read, sl.append):
        with pytest.raises(CorruptLogError, match=r"log_000002.mcap: damaged"):
            opening(log)


def test_swapped_contents_are_named(log: Path) -> None:
    """Two files that exchanged their names are no harm; two that exchanged their heads would be."""
    one, other = _segment(log, 1), _segment(log, 2)
    one.rename(log / "x.mcap")
    other.rename(one)
    (log / "x.mcap").rename(other)

    assert list(range(12)) == _numbers(log)


def test_what_was_merged_is_left_over(log: Path) -> None:
    """The log reads the same; the files that are too many are listed for the next writer."""
    expected = _numbers(log)
    _merge(log, [1, 2, 3], log / "merged.mcap")
    together = LogReader(log)

    assert expected == _numbers(log)
    assert [_segment(log, n) for n in (1, 2, 3)] == sorted(together.leftovers)
    assert ["log_000000", "merged", "log_000004", "log_000005"] == [
        segment.path.stem for segment in together.segments
    ]
    for number in (2, 1, 3):
        _segment(log, number).unlink()
        assert expected == _numbers(log)
    assert [] == LogReader(log).leftovers


def test_the_next_writer_removes_what_is_left_over(log: Path) -> None:
    """What lies in a merged file goes once no copy of the folder can need it."""
    _merge(log, [0, 1, 2, 3], _segment(log, 0))
    sl.append(log).close()
    assert [_segment(log, n) for n in (1, 2, 3)] == LogReader(log).leftovers
    long_ago_s = time.time() - MERGED_KEPT_S - 1
    os.utime(_segment(log, 0), (long_ago_s, long_ago_s))

    sl.append(log).close()

    assert [] == LogReader(log).leftovers
    assert ["log_000000", "log_000004", "log_000005"] == sorted(p.stem for p in log.glob("*.mcap"))
    assert list(range(12)) == _numbers(log)


def test_a_part_with_other_commits_is_no_leftover(log: Path, tmp_path: Path) -> None:
    """It holds what the merged segment does not: never ignored."""
    copy = tmp_path / "copy"
    shutil.copytree(log, copy)
    for path in (log, copy):
        for _ in range(2):
            with sl.append(path) as writing:
                writing.add_door()
                writing.add_door()
    merged = [3, 4, 5, 6]
    _merge(copy, merged, log / "merged.mcap")

    with pytest.raises(CorruptLogError, match=r"part of merged.mcap"):
        LogReader(log)


def test_every_event_is_found_in_a_merged_segment(log: Path) -> None:
    """Also those before a keyframe in the middle of it, whatever the chunks begin with."""
    _merge(log, range(6), _segment(log, 0))
    (segment,) = LogReader(log).segments

    places = [chunk_of(segment, event) for event in range(-1, 13)]
    ends = [commit.last_event for e in range(12) if (commit := commit_of(segment, e))]

    assert [None, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, None] == places
    assert list(range(12)) == ends


def test_merged_segments_that_overlap_are_named(log: Path) -> None:
    """Neither is a part of the other."""
    _merge(log, [1, 2, 3], log / "one.mcap")
    _merge(log, [3, 4], log / "two.mcap")

    with pytest.raises(CorruptLogError, match=r"4, and one.mcap holds 1"):
        LogReader(log)


def test_a_file_that_vanishes_while_it_is_opened(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the listing and the opening a writer merged: the folder is listed again."""
    listed: list[int] = []

    def then_merge(folder: Path) -> list[tuple[str, int]]:
        found = list_segments(folder)
        if not listed:
            _merge(log, [1, 2, 3], _segment(log, 1))
            for number in (2, 3):
                _segment(log, number).unlink()
        listed.append(len(found))
        return found

    list_segments = segment_folder.list_segments
    monkeypatch.setattr(segment_folder, "list_segments", then_merge)
    reader = LogReader(log)

    assert [6, 4] == listed
    assert 12 == sum(len(batch) for batch in reader.batches())


def test_a_link_to_nowhere_is_an_error(log: Path) -> None:
    """It will not be there at the next look, either."""
    (log / "x.mcap").symlink_to(log / "nowhere")

    with pytest.raises(LogAccessError, match=r"x.mcap"):
        LogReader(log)


def test_a_log_that_is_gone_is_no_log(log: Path) -> None:
    """Refreshing says so."""
    reader = LogReader(log)
    shutil.rmtree(log)

    with pytest.raises(NotALogError, match="no such log"):
        reader.refresh()


def test_more_segments_than_a_process_may_have_files(log: Path) -> None:
    """A log of five years has 1,825 segments, a process 1,024 descriptors: none is kept."""
    code = (
        "import resource, sys\n"
        "from pathlib import Path\n"
        "from semmap_log.store.reading.reader import LogReader\n"
        "import os\n"
        "used = max(map(int, os.listdir('/proc/self/fd')))\n"
        "resource.setrlimit(resource.RLIMIT_NOFILE, (used + 3, used + 3))\n"
        "reader = LogReader(Path(sys.argv[1]))\n"
        "print(len(reader.segments), sum(len(b) for b in reader.batches()))\n"
    )

    done = subprocess.run(
        [sys.executable, "-c", code, str(log)], capture_output=True, text=True, check=False
    )

    assert ("6 12\n", "") == (done.stdout, done.stderr)
