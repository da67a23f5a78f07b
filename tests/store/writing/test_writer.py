"""One writer: numbers, times, segments, syncs, and what happens when the disk says no."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded, DoorObserved, FloorMap, RobotPose
from semmap_log.errors import (
    InvalidEventError,
    LogExistsError,
    LogLockedError,
    LogPoisonedError,
    NotALogError,
)
from semmap_log.log.replay.state import keyframe_at
from semmap_log.store import commit_records as commits
from semmap_log.store.commit_records import commit_hash
from semmap_log.store.writing import segment_chain
from tests.conftest import SteadyClock


def test_numbers_have_no_gaps_and_times_only_grow(tmp_path: Path, clock: SteadyClock) -> None:
    """Even when the wall clock goes back by a day, and over reopening."""
    path = tmp_path / "log"
    for i in range(3):
        opened = sl.create(path, tz="UTC", clock=clock) if i == 0 else sl.append(path, clock=clock)
        with opened as log:
            log.add_door()
            clock.now_ns -= 86_400 * 10**9
            log.add_door()

    numbers = [n for batch in sl.read(path).batches() for n in batch.number.tolist()]
    recorded = [
        t for _, page in sl.read(path)._reader.pages() for t in page.heads["log_time"].tolist()
    ]
    assert list(range(6)) == numbers
    assert all(before < after for before, after in pairwise(recorded))


def test_what_no_chunk_can_hold_is_refused_before_it_is_written(
    tmp_path: Path, clock: SteadyClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A floor map, an annotation, a note: an error, nothing in the log, and the writer goes on."""
    monkeypatch.setattr(commits, "MOST_EVENT_BYTES", 2**16)
    monkeypatch.setattr("semmap_log.core.model.commits.MOST_NOTE_CHARACTERS", 2**15)
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", clock=clock) as log:
        door = log.add_door()
        cells = np.zeros((256, 256), np.int8)
        plan = FloorMap(resolution=0.05, origin_x=0.0, origin_y=0.0, cells=cells)

        with pytest.raises(InvalidEventError, match="FloorMap: expected a record of at most 65536"):
            log.append([plan])
        with pytest.raises(InvalidEventError, match="DoorAnnotated: expected a record of at most"):
            log.annotate(door, "name", "x" * 2**16)
        with pytest.raises(InvalidEventError, match="32768 characters"):
            log.observe(door, "open", reason="x" * 2**14, source="y" * 2**14 + "z")

        log.annotate(door, "name", "x" * 2**15, reason="x" * 2**15)

    assert 2 == len(list(sl.read(path).commits()))


def test_a_happened_time_is_kept_as_given(tmp_path: Path, clock: SteadyClock) -> None:
    """Also one that lies in the future; only the fold takes the recorded time instead."""
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        door = log.add_door()
        log.observe(door, "open", at=clock.now_ns + 10**15)

        (entry,) = log.history(kinds=[DoorObserved])
        assert (
            entry.happened_ns == clock.now_ns - 3 * 10**6 + 10**15
            or entry.happened_ns > entry.recorded_ns
        )
        assert log.replay(at=entry.recorded_ns)[door].state is sl.DoorState.OPEN


def test_a_thousand_one_line_commands_make_one_file(tmp_path: Path) -> None:
    """A small closed segment is continued in a copy: its old bytes stay readable."""
    path = tmp_path / "log"
    sl.create(path, tz="UTC").close()
    before = sl.read(path)
    for _ in range(20):
        with sl.append(path) as log:
            log.add_door()

    assert ["log_000000.mcap"] == [p.name for p in path.glob("*.mcap")]
    assert 20 == len(sl.read(path).replay())
    assert 0 == len(before.replay())


def test_opening_without_appending_changes_no_byte(tmp_path: Path) -> None:
    """A command that turns out to change nothing leaves the files alone."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as log:
        log.add_door()
    before = {p.name: (p.stat().st_mtime_ns, p.read_bytes()) for p in path.iterdir() if p.suffix}

    sl.append(path).close()

    assert before == {
        p.name: (p.stat().st_mtime_ns, p.read_bytes()) for p in path.iterdir() if p.suffix
    }


@pytest.mark.parametrize("rule", ["ROLL_COMMITS", "ROLL_BYTES", "ROLL_AGE_NS"])
def test_segments_roll(
    rule: str, tmp_path: Path, clock: SteadyClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By commits, by size and by age; each segment begins with the state so far."""
    limit = {"ROLL_COMMITS": 5, "ROLL_BYTES": 25_000, "ROLL_AGE_NS": 10 * 10**6}[rule]
    monkeypatch.setattr(segment_chain, rule, limit)
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", clock=clock, compact=False) as log:
        for _ in range(40):
            log.add_door()

    reader = sl.read(path)._reader
    assert 3 < len(reader.segments) < 30
    for segment in reader.segments:
        state = keyframe_at(segment, 0)
        assert state is not None
        assert segment.header.first_event == len(state.door_map().doors)


def test_the_chain_of_hashes_holds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each commit's hash follows from its records and the hash before, over all segments."""
    import hashlib

    from semmap_log.store.byte_layout import COMMIT_CHANNEL, KEYFRAME_CHANNEL

    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 3)
    path = tmp_path / "log"
    with sl.create(path, tz="UTC", compact=False) as log:
        for i in range(10):
            log.add_door(name=f"door {i}", actor="me")
    previous, checked = bytes(32), 0
    digests: dict[int, hashlib._Hash] = {}
    for segment, page in sl.read(path)._reader.pages():
        assert segment.header.first_event > 0 or segment.header.hash_so_far == bytes(32)
        commits = iter(page.commits())
        ends = [*page.offsets.tolist()[1:], len(page.records)]
        for start, end, channel in zip(
            page.offsets.tolist(), ends, page.heads["channel_id"].tolist(), strict=True
        ):
            record = bytes(page.records[start:end])
            if channel == COMMIT_CHANNEL:
                commit = next(commits)
                assert previous == commit.previous_hash
                assert commit.hash == commit_hash(
                    record, {c: d.digest() for c, d in digests.items()}
                )
                previous, digests, checked = commit.hash, {}, checked + 1
            elif channel != KEYFRAME_CHANNEL:
                digests.setdefault(channel, hashlib.sha256()).update(record)

    assert 10 == checked
    assert [bytes(32)] == [s.header.hash_so_far for s in sl.read(path)._reader.segments][:1]


def test_a_second_writer_is_refused_before_it_touches_anything(tmp_path: Path) -> None:
    """In this process and in another; the message names the first."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as log:
        log.add_door()
        with pytest.raises(LogLockedError, match=f"process {os.getpid()} is writing"):
            sl.append(path)
        code = "import sys, semmap_log as sl; sl.append(sys.argv[1])"
        done = subprocess.run(
            [sys.executable, "-c", code, path], capture_output=True, text=True, check=False
        )
        log.add_door()

    assert "LogLockedError" in done.stderr
    assert 2 == len(sl.read(path).replay())


def test_readers_see_whole_commits_of_a_live_log(tmp_path: Path) -> None:
    """While the writer has it open, and after each refresh what came since."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as log:
        log.add_door()
        reader = sl.read(path)
        log.append([DoorAdded(door_id=DoorId(n)) for n in range(2, 6)])

        assert 1 == len(reader.replay())
        reader.refresh()
        assert 5 == len(reader.replay())


@pytest.mark.parametrize(
    ("make", "error", "match"),
    [
        (lambda p: p.write_text("x"), NotALogError, "a log is a folder"),
        (lambda p: p.mkdir(), NotALogError, "without segments"),
        (lambda p: None, NotALogError, "no such log"),
    ],
    ids=["file", "empty", "nothing"],
)
def test_what_is_no_log_is_said(make, error: type[Exception], match: str, tmp_path: Path) -> None:
    """Reading and appending name the path and what is there instead."""
    path = tmp_path / "log"
    make(path)

    for opening in (sl.read, sl.append):
        with pytest.raises(error, match=match):
            opening(path)


def test_somebody_elses_bag_is_not_a_log(tmp_path: Path) -> None:
    """A rosbag2 is neither read as a log nor written to."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/chatter", "std_msgs/msg/String", typestore=store)
        text = store.types["std_msgs/msg/String"]("hello")
        writer.write(connection, 1, store.serialize_cdr(text, "std_msgs/msg/String"))
    before = sorted(p.name for p in (tmp_path / "bag").iterdir())

    for opening in (sl.read, sl.append):
        with pytest.raises(NotALogError, match="not of a semmap log"):
            opening(tmp_path / "bag")
    assert before == sorted(p.name for p in (tmp_path / "bag").iterdir())


def test_a_new_log_wants_an_empty_place(tmp_path: Path) -> None:
    """Neither a file nor a folder with something in it is written over."""
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "x").write_text("mine")

    with pytest.raises(LogExistsError, match="expected a new or empty folder"):
        sl.create(tmp_path / "full")
    assert "mine" == (tmp_path / "full" / "x").read_text()


AS_NOBODY = """
import os, sys, semmap_log as sl
from pathlib import Path
warm = sl.create(Path(sys.argv[1]) / "warm", tz="UTC")  # loads all that will be needed
warm.add_door()
warm.replay()
warm.close()
if os.getuid() == 0:  # root may write everywhere
    os.setgroups([]); os.setgid(65534); os.setuid(65534)
log = Path(sys.argv[1]) / "log"
print(len(sl.read(log).replay()))
try:
    sl.append(log)
except sl.SemmapError as error:
    print(type(error).__name__, error)
"""


@pytest.mark.slow
def test_a_read_only_log_is_read_and_not_written() -> None:
    """Reading needs no write access; appending says what is wrong."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = folder / "log"
        with sl.create(path, tz="UTC") as log:
            log.add_door()
        (path / ".lock").unlink()
        folder.chmod(0o755)
        path.chmod(0o555)

        done = subprocess.run(
            [sys.executable, "-c", AS_NOBODY, folder], capture_output=True, text=True, check=True
        )
        path.chmod(0o755)

    read, written = done.stdout.splitlines()
    assert "1" == read
    assert written.startswith("LogAccessError")
    assert "Reading works" in written


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("strace") is None, reason="strace is not installed")
def test_append_syncs_before_it_returns(tmp_path: Path) -> None:
    """One write and one fdatasync a commit; new files and renames also sync their folder."""
    code = """
import os, sys, semmap_log as sl
log = sl.create(sys.argv[1], tz="UTC")
door = log.add_door()
os.stat("/before")  if os.path.exists("/before") else None
for _ in range(3):
    log.observe(door, "open")
os.path.exists("/after")
log.close()
"""
    trace = tmp_path / "trace"
    calls = "write,fsync,fdatasync,linkat,openat,stat,newfstatat"
    subprocess.run(
        [
            "strace",
            "-f",
            "-o",
            trace,
            "-e",
            f"trace={calls}",
            sys.executable,
            "-c",
            code,
            tmp_path / "log",
        ],
        check=True,
    )
    text = trace.read_text()

    between = text[text.index('"/before"') : text.index('"/after"')]
    assert ["write", "fdatasync"] * 3 == re.findall(r"\b(write|fdatasync|fsync)\(", between)
    names = [m.start() for m in re.finditer(r"linkat\(.*\.mcap\"", text)]
    assert names
    for start in names:
        assert re.match(r".*\n(.*openat\(.*O_DIRECTORY.*\n)(.*\n)*?.*fsync\(", text[start:])


@pytest.mark.usefixtures("patient_poses")
def test_poses_join_the_next_commit(tmp_path: Path) -> None:
    """They cost no sync of their own."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door()
        log.robot_pose(RobotPose(x=1.0, y=0.0, theta=0.0))
        log.robot_pose(RobotPose(x=2.0, y=0.0, theta=0.0))
        joined = log.observe(door, "open").commit

        assert 3 == joined.count
        assert [1, 2] == [e.number for e in log.history(kinds=[RobotPose])]


def test_poses_that_no_commit_follows_are_written_after_a_second(tmp_path: Path) -> None:
    """None is kept back for long."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.robot_pose(RobotPose(x=3.0, y=0.0, theta=0.0))
        deadline = time.monotonic() + 100
        while log.replay().event < 0 and time.monotonic() < deadline:
            time.sleep(0.05)

        assert [0] == [e.number for e in log.history(kinds=[RobotPose])]


def test_the_same_seed_makes_the_same_bytes(tmp_path: Path) -> None:
    """With clock and randomness given, nothing else gets in."""
    import random

    made = []
    for folder in ("a", "b"):
        path = tmp_path / folder / "log"
        with sl.create(
            path, tz="UTC", clock=SteadyClock(), entropy=random.Random(5).randbytes
        ) as log:
            door = log.add_door(name="front", actor="me")
            log.observe(door, "open")
        made.append({p.name: p.read_bytes() for p in path.iterdir()})

    assert made[0] == made[1]


@pytest.mark.slow
def test_an_unfinished_import_leaves_nothing_visible(tmp_path: Path) -> None:
    """An error in the middle of a long commit: its first chunks do not count, then or later."""

    def events():
        for n in range(1, 60_000):
            yield DoorAdded(door_id=DoorId(n))
        raise RuntimeError("the file ends here")

    path = tmp_path / "log"
    log = sl.create(path, tz="UTC")
    log.add_door(door_id=DoorId(100_000))
    with pytest.raises(RuntimeError, match="ends here"):
        log.append(events())
    with pytest.raises(LogPoisonedError, match="Open the log again"):
        log.add_door()
    log.close()

    assert 1 == len(sl.read(path).replay())
    with sl.append(path) as log:
        log.add_door()
    assert [100_000, 100_001] == list(sl.read(path).replay().doors)
