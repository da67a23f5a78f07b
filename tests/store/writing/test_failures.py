"""What goes wrong while a log is written: the log stays whole, and says what it was."""

from __future__ import annotations

import errno
import fcntl
import os
import resource
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import semmap_log as sl
from semmap_log.core.model.events import DoorObserved, Event, FloorMap, LevelAdded
from semmap_log.errors import (
    CommandError,
    LogAccessError,
    LogError,
    LogLockedError,
    LogPoisonedError,
)
from semmap_log.store.folder import LogFolder
from semmap_log.store.lock import WriterLock
from semmap_log.store.writing import segment_chain

SEEN = DoorObserved(door_id=sl.DoorId(1), state=sl.DoorState.OPEN)


@contextmanager
def _files_below(size: int) -> Iterator[None]:
    """Let no file of this process grow beyond that size: a write is then cut, and fails."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def _crashed(tmp_path: Path, torn: bytes = b"") -> Path:
    """Return a log as a killed writer leaves it: doors, and what comes behind them."""
    log = sl.create(tmp_path / "running" / "log", tz="UTC")
    for _ in range(3):
        log.add_door()
    path = Path(shutil.copytree(tmp_path / "running" / "log", tmp_path / "log"))
    log.close()
    with (path / "log_000000.mcap").open("ab") as file:
        file.write(torn)
    return path


def _names(path: Path) -> list[str]:
    return sorted(p.name for p in path.iterdir() if p.name != ".lock")


def _count(path: Path) -> int:
    return sum(len(batch) for batch in sl.read(path).batches())


def test_events_that_cannot_be_read_harm_nothing(tmp_path: Path) -> None:
    """An error of the caller's own file is the caller's; the log takes the next commit."""

    def unreadable() -> Iterator[Event]:
        yield SEEN
        raise FileNotFoundError(errno.ENOENT, "gone", "events.csv")

    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door()
        with pytest.raises(FileNotFoundError, match=r"events\.csv"):
            log.append(unreadable())
        log.append([SEEN])

    assert 2 == _count(tmp_path / "log")


def test_a_commit_wants_an_event_and_an_id_of_its_size(tmp_path: Path) -> None:
    """Both are refused before a byte is written."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        for events, command_id in (([], None), ([SEEN], b"short")):
            with pytest.raises(CommandError):
                log._writer.append(events, command_id=command_id)
        log.add_door()

    assert 1 == _count(tmp_path / "log")


def test_what_waits_is_told_of_a_write_that_failed(tmp_path: Path) -> None:
    """An append that was never synced cannot become durable any more."""
    log = sl.create(tmp_path / "log", tz="UTC", durability="flush")
    log.add_door()
    waiting = log.append([SEEN])
    with _files_below(log._writer._chain.live.size + 10), pytest.raises(LogPoisonedError):
        log.append([SEEN])

    with pytest.raises(LogPoisonedError, match="unknown"):
        waiting.wait()
    log.close()

    assert 2 == _count(tmp_path / "log")


def test_what_is_held_back_and_cannot_be_written(tmp_path: Path) -> None:
    """Reading one's own log hands it over; if the disk says no, the log takes nothing more."""
    log = sl.create(tmp_path / "log", tz="UTC", durability="none")
    log.add_door()
    with _files_below(100), pytest.raises(LogPoisonedError):
        log.replay()
    with pytest.raises(LogPoisonedError):
        log.append([SEEN])
    log.close()

    assert 0 == _count(tmp_path / "log")


def test_a_log_that_cannot_be_closed_is_whole(tmp_path: Path) -> None:
    """The error says so; the next writer closes it. Closed again, it is quiet."""
    path = tmp_path / "log"
    log = sl.create(path, tz="UTC")
    log.add_door()
    with _files_below(100), pytest.raises(LogPoisonedError, match="commits are whole"):
        log.close()
    log.close()

    assert 1 == _count(path)
    sl.append(path).close()
    assert sl.read(path)._reader.segments[-1].closed


def test_a_segment_that_cannot_be_begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its temporary file goes, the log stands at its last commit, and is opened again."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 2)
    path = tmp_path / "log"
    log = sl.create(path, tz="UTC", compact=False)
    for _ in range(2):
        log.add_door()
    head = sl.read(path)._reader.segments[0].chunks[0].offset
    for limit in (100, head + 10):
        with _files_below(limit), pytest.raises(LogAccessError):
            sl.create(tmp_path / f"other{limit}", tz="UTC")
        assert [] == _names(tmp_path / f"other{limit}")
    with _files_below(100), pytest.raises(LogPoisonedError):
        log.add_door()
    log.close()

    assert ["log_000000.mcap"] == _names(path)
    with sl.append(path, compact=False) as log:
        log.add_door()
    assert 3 == _count(path)


def test_a_recovery_that_finds_no_room(tmp_path: Path) -> None:
    """Nothing is changed; with room again it opens."""
    path = _crashed(tmp_path)
    before = _names(path)

    size = sl.read(path)._reader.segments[0].chunks[1].offset
    with _files_below(size), pytest.raises(LogAccessError, match="cannot be opened"):
        sl.append(path)

    assert before == _names(path)
    sl.append(path).close()
    assert 3 == _count(path)


@pytest.mark.parametrize("first", [b"two", b"one more"])
def test_two_torn_tails_of_one_place_are_both_kept(tmp_path: Path, first: bytes) -> None:
    """The second gets a number; the same one again does not."""
    path = _crashed(tmp_path, torn=b"one")
    end = (path / "log_000000.mcap").stat().st_size - 3
    kept = path / f"log_000000.mcap.torn-{end}"
    kept.write_bytes(first)

    sl.append(path).close()

    assert (first, b"one") == (kept.read_bytes(), Path(f"{kept}-2").read_bytes())


@pytest.mark.parametrize("closed", [True, False])
def test_a_large_last_segment_is_not_continued(
    closed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another begins behind it; a live one is closed first."""
    path = _crashed(tmp_path)
    if closed:
        sl.append(path).close()
    monkeypatch.setattr(segment_chain, "CONTINUE_BELOW_BYTES", 100)

    with sl.append(path, compact=False) as log:
        log.add_door()

    assert [0, 1] == [s.header.number for s in sl.read(path)._reader.segments]
    assert 4 == _count(path)


def test_a_level_by_name_and_what_is_durable_already(tmp_path: Path) -> None:
    """A command that comes again after its batch was synced waits for nothing."""
    with sl.create(tmp_path / "log", tz="UTC", durability="batch", batch_s=3000) as log:
        named = [LevelAdded(level=1, name="first floor", elevation=3.5)]
        log.append(named, command_id=bytes(16))
        log.sync()

        assert log.append(named, command_id=bytes(16)).repeated
        assert 1 == log.durable_before


def test_a_floor_map_of_another_level_brings_its_channel(tmp_path: Path) -> None:
    """Once a segment: before the first chunk that needs it."""
    plan = FloorMap(
        level=7, resolution=0.05, origin_x=0.0, origin_y=0.0, cells=np.zeros((2, 2), np.int8)
    )
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.append([plan], note=sl.Note(actor="me", salt=bytes(16)))
        log.append([plan], note=sl.Note(actor="me"))

    assert {0, 7} >= set(sl.read(tmp_path / "log").replay().levels)
    assert 2 == _count(tmp_path / "log")


def test_the_timer_counts_again_after_each_batch(tmp_path: Path) -> None:
    """Every batch is synced, not only the first."""
    with sl.create(tmp_path / "log", tz="UTC", durability="batch", batch_s=0.02) as log:
        log.add_door()
        for _ in range(3):
            before = log.append([SEEN]).commit.last_event + 1
            deadline = time.monotonic() + 100
            while log.durable_before < before and time.monotonic() < deadline:
                time.sleep(0.005)
            assert before == log.durable_before


def test_appending_in_an_append_and_after_the_end(tmp_path: Path) -> None:
    """Both are errors that say what is wrong."""

    def nested() -> Iterator[Event]:
        log.append([SEEN])
        yield SEEN

    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door()
        with pytest.raises(LogError, match="under way"):
            log.append(nested())
    with pytest.raises(LogError, match="was closed"):
        log.append([SEEN])


def test_a_lock_that_cannot_be_taken(tmp_path: Path) -> None:
    """A folder in the place of the lock file; and a lock file that somebody deleted."""
    (tmp_path / "log").mkdir()
    (tmp_path / "log" / ".lock").mkdir()
    with pytest.raises(LogAccessError, match="cannot be opened for writing: Is a directory"):
        WriterLock(LogFolder(tmp_path / "log"))
    (tmp_path / "log" / ".lock").rmdir()
    path = _crashed(tmp_path / "other")
    (path / ".lock").unlink()
    (path / ".lock").mkdir()
    with pytest.raises(LogAccessError, match="cannot be opened for writing"):
        sl.append(path)

    lock = WriterLock(LogFolder(tmp_path / "log"))
    (tmp_path / "log" / ".lock").unlink()
    with pytest.raises(LogLockedError, match="another process is writing"):
        WriterLock(LogFolder(tmp_path / "log"))
    lock.release()
    lock.release()
    WriterLock(LogFolder(tmp_path / "log")).release()


def test_a_file_system_that_cannot_lock_folders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Then the lock file alone keeps the second writer out."""
    real = fcntl.flock

    def only_files(fd: int, operation: int) -> None:
        if os.path.isdir(f"/proc/self/fd/{fd}"):  # noqa: PTH112 - a link to what is open
            raise OSError(errno.ENOLCK, "no locks for folders")
        real(fd, operation)

    monkeypatch.setattr(fcntl, "flock", only_files)
    lock = WriterLock(LogFolder(tmp_path))
    with pytest.raises(LogLockedError):
        WriterLock(LogFolder(tmp_path))
    lock.release()
