"""Small segments merged: one file with one number range, its parts gone, nothing else changed."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

import semmap_log as sl
from semmap_log.core.model.events import Event
from semmap_log.errors import CorruptLogError, LogAccessError, LogLockedError
from semmap_log.store.byte_layout import KEYFRAME_CHANNEL
from semmap_log.store.compaction import Compacted, compact, merge, plan_compaction
from semmap_log.store.folder import LogFolder
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.reading.segment_reading import page_at
from semmap_log.store.reading.segment_scan import open_segment
from semmap_log.store.writing import segment_chain
from tests.marks import remove_marks
from tests.store.logs import answers, segment_files, sightings, write_log


@pytest.fixture(autouse=True)
def an_hour_later(monkeypatch: pytest.MonkeyPatch) -> None:
    """No copy of a folder is under way: what was merged need not stay."""
    monkeypatch.setattr(merge, "MERGED_KEPT_S", 0)


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Eight closed segments."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 10)
    return write_log(tmp_path / "log", 78)


def ranges(log: Path) -> list[tuple[int, int]]:
    """Return first and last number of a log's segments."""
    headers = [segment.header for segment in LogReader(log).segments]
    return [(header.number, header.last_number) for header in headers]


def listed(log: Path) -> dict[str, int]:
    """Return the files and their messages that metadata.yaml lists."""
    said: Any = yaml.safe_load((log / "metadata.yaml").read_text())
    files = said["rosbag2_bagfile_information"]["files"]
    return {file["path"]: file["message_count"] for file in files}


def messages(path: Path) -> int:
    segment = open_segment(path)
    return sum(len(page_at(segment, i).offsets) for i in range(len(segment.chunks)))


def test_neighbours_become_one(log: Path) -> None:
    """One file with the first one's name and every number; every answer is the same."""
    before = answers(log)

    done = compact(log)

    assert before == answers(log)
    assert ["log_000000.mcap"] == [path.name for path in segment_files(log)]
    assert [(0, 7)] == ranges(log)
    assert (8, 1, 78) == (done.segments_before, done.segments_after, done.events)
    assert done.bytes_after == segment_files(log)[0].stat().st_size
    assert {"log_000000.mcap": messages(segment_files(log)[0])} == listed(log)


@pytest.mark.parametrize(("every", "kept"), [(1, 8), (5000, 4), (2**20, 1)])
def test_heads_of_parts_stay_as_keyframes_where_they_are_of_use(
    every: int, kept: int, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each by itself in a chunk; those with few records between them and the last are left out."""
    monkeypatch.setattr(merge, "KEYFRAME_EVERY_BYTES", every)

    compact(log)

    segment = open_segment(segment_files(log)[0])
    channels = [page_at(segment, i).heads["channel_id"] for i in range(len(segment.chunks))]
    is_keyframe = [KEYFRAME_CHANNEL in chunk for chunk in channels]
    assert [True, False] * kept == is_keyframe
    assert 8 >= kept == sum(len(chunk) == 1 for chunk in channels)
    assert () == compact(log).steps


def test_a_second_time_nothing_is_written(log: Path) -> None:
    """Not even metadata.yaml."""
    compact(log)
    before = {path.name: path.stat().st_ino for path in log.iterdir()}

    done = compact(log)

    assert () == done.steps
    assert before == {path.name: path.stat().st_ino for path in log.iterdir()}


def test_the_writer_goes_on_behind_the_last_number(log: Path) -> None:
    """The next segment counts on from the merged one's last, under a free name."""
    compact(log)
    for _ in range(3):
        with sl.append(log, compact=False) as opened:
            for number in range(15):
                opened.append(sightings(sl.DoorId(1), 1, number), sync=False)

    before = answers(log)
    assert 3 < len(ranges(log))
    assert ranges(log)[0][0] == 0
    compact(log)
    assert before == answers(log)
    assert 1 == len(ranges(log))


def test_the_live_segment_is_not_touched(log: Path) -> None:
    """A log whose writer was killed: what is closed is merged, what is live waits for a writer."""
    live = segment_files(log)[-1]
    data = open_segment(live)
    live.write_bytes(bytes(data.source.read(0, data.valid_end)))
    before, live_bytes = answers(log), live.read_bytes()

    compact(log)

    assert [(0, 6), (7, 7)] == ranges(log)
    assert live_bytes == live.read_bytes()
    assert before == answers(log)
    assert ["log_000000.mcap"] == list(listed(log))


def test_no_merged_segment_is_larger_than_it_may(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bound of about three segments: groups within it, and nothing to do a second time."""
    sizes = [int(segment.chunks.rows["size"].sum()) for segment in LogReader(log).segments]
    bound = sum(sizes[:3]) + 200
    monkeypatch.setattr(merge, "MERGE_BYTES", bound)
    before = answers(log)

    compact(log)

    merged = [int(segment.chunks.rows["size"].sum()) for segment in LogReader(log).segments]
    assert all(size <= bound for size in merged)
    assert [(0, 2), (3, 5), (6, 7)] == ranges(log)
    assert before == answers(log)
    assert () == compact(log).steps


def test_a_segment_that_is_half_full_stays_alone(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else each compaction of a growing log would write the same large file again."""
    sizes = [int(segment.chunks.rows["size"].sum()) for segment in LogReader(log).segments]
    monkeypatch.setattr(merge, "MERGE_BYTES", 2 * max(sizes) - 1)

    compact(log)

    assert 7 <= len(ranges(log))


def test_without_merging_every_file_stays(log: Path) -> None:
    """And merging later gives the same bytes as merging at once."""
    twin = log.parent / "twin" / "log"
    shutil.copytree(log, twin)

    compact(log, merge=False)
    files = len(segment_files(log))
    compact(log)
    compact(twin)

    assert 8 == files
    assert [path.read_bytes() for path in segment_files(twin)] == [
        path.read_bytes() for path in segment_files(log)
    ]


def test_what_was_planned_is_what_is_done(log: Path) -> None:
    """The plan needs no lock: it can be asked for while somebody writes."""
    with sl.append(log, compact=False):
        planned = plan_compaction(log)

    done = compact(log)

    expected = Compacted(
        planned.segments_before,
        planned.segments_after,
        planned.bytes_before,
        done.bytes_after,
        planned.events,
        planned.steps,
    )
    assert expected == done


def test_progress_reaches_the_end(log: Path) -> None:
    """In bytes of records, each written and compared: rising, up to all."""
    told: list[tuple[int, int]] = []

    compact(log, progress=lambda done, total: told.append((done, total)))

    assert told == sorted(told)
    assert told[-1][0] == told[-1][1] > 0


def test_not_while_somebody_writes(log: Path) -> None:
    """Its lock is the writer's."""
    with sl.append(log), pytest.raises(LogLockedError):
        compact(log)

    with sl.append(log) as opened:
        opened.add_door()


@pytest.mark.parametrize("damaged", [0, 3, 7])
def test_a_damaged_part_leaves_all_files(log: Path, damaged: int) -> None:
    """The error names it; all segments, and metadata.yaml, stay byte for byte."""
    path = segment_files(log)[damaged]
    chunk = open_segment(path).chunks[4]
    data = bytearray(path.read_bytes())
    data[chunk.data_offset + 50] ^= 1
    path.write_bytes(data)
    before = {path.name: path.read_bytes() for path in log.iterdir()}

    with pytest.raises(CorruptLogError, match=f"{path.name}: damaged at byte {chunk.offset}"):
        compact(log)

    assert before == {path.name: path.read_bytes() for path in log.iterdir()}


def test_a_part_of_another_copy_of_the_log_is_not_merged(log: Path) -> None:
    """Its head fits by its number, but not by its hash."""
    twin = log.parent / "twin"
    shutil.copytree(log, twin)
    for path in segment_files(log)[4:]:
        path.unlink()
    for path in segment_files(twin)[4:]:
        path.unlink()
    for copy in (log, twin):
        remove_marks(copy)
        (copy / "metadata.yaml").unlink()
    for copy, state in ((log, "open"), (twin, "closed")):
        with sl.append(copy, compact=False) as opened:
            for _ in range(20):
                opened.observe(sl.DoorId(1), state)
    shutil.copy(segment_files(twin)[-1], segment_files(log)[-1])
    before = [path.read_bytes() for path in segment_files(log)]

    remove_marks(log)

    with pytest.raises(CorruptLogError, match=segment_files(log)[-1].name):
        compact(log)

    assert before == [path.read_bytes() for path in segment_files(log)]


def test_a_full_disk_leaves_a_whole_log(log: Path, tmp_path: Path) -> None:
    """Here: the folder does not take a second file of that size. The error says so, all stays."""
    import resource

    before = answers(log)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (16_000, limits[1]))
        with pytest.raises(LogAccessError, match="cannot be compacted: File too large"):
            compact(log)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)

    assert before == answers(log)
    assert [] == list(log.glob(".*.tmp"))
    compact(log)
    assert before == answers(log)


def test_what_a_killed_merge_left_is_removed(log: Path) -> None:
    """Parts beside the merged file: read once, not twice; the next compaction takes them away."""
    parts = {path: path.read_bytes() for path in segment_files(log)[3:]}
    before = answers(log)
    compact(log)
    for path, data in parts.items():
        path.write_bytes(data)

    events = LogReader(log).last_commit()
    compact(log)

    assert events is not None
    assert 77 == events.last_event
    assert 1 == len(segment_files(log))
    assert before == answers(log)


def test_a_part_with_other_events_is_never_removed(log: Path) -> None:
    """Inside the merged one by its numbers, but of another history: an error, and it stays."""
    twin = log.parent / "twin" / "log"
    write_log(twin, 78)
    compact(log)
    foreign = log / "log_000004.mcap"
    shutil.copy(twin / "log_000004.mcap", foreign)

    with pytest.raises(CorruptLogError, match=r"log_000004\.mcap"):
        compact(log)

    assert foreign.exists()


def test_parts_go_only_once_the_merged_name_is_on_the_disk(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder is synced between the swap and the first removal, also by who only clears up."""
    parts = {path: path.read_bytes() for path in segment_files(log)[1:]}
    steps: list[str] = []
    replace, unlink, sync = os.replace, os.unlink, LogFolder.sync
    monkeypatch.setattr(
        os, "replace", lambda a, b, **how: (steps.append(f"replace {b}"), replace(a, b, **how))
    )
    monkeypatch.setattr(
        os, "unlink", lambda name, **how: (steps.append("unlink"), unlink(name, **how))
    )
    monkeypatch.setattr(LogFolder, "sync", lambda self: (steps.append("sync"), sync(self)))

    compact(log)
    merging, steps[:] = list(steps), []
    for path, data in parts.items():
        path.write_bytes(data)
    compact(log)

    expected = ["replace metadata.yaml", "sync", "replace log_000000.mcap", "sync"]
    assert [*expected, "sync", *7 * ["unlink"], "sync"] == merging
    assert ["sync", *7 * ["unlink"], "sync"] == steps


def test_a_segment_without_a_commit_is_merged_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Begun for events that were refused: its keyframe is not needed in the merged file."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 3)
    path = tmp_path / "log"

    def refused() -> Iterator[Event]:
        raise RuntimeError
        yield

    with sl.create(path, tz="UTC") as log:
        door = log.add_door(name="front")
        log.observe(door, "open")
        log.observe(door, "closed")
        with pytest.raises(RuntimeError):
            log.append(refused())
    before = answers(path)

    done = compact(path)

    assert (2, 1, 4) == (done.segments_before, done.segments_after, done.events)
    assert before == answers(path)
