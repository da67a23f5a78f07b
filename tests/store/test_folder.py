"""A log's folder that is moved, exchanged, or full of somebody else's links."""

from __future__ import annotations

import os
import shutil
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.errors import (
    LogAccessError,
    LogError,
    LogExistsError,
    LogPoisonedError,
)
from semmap_log.log.replay.maintenance import verify
from semmap_log.store.compaction import compact
from semmap_log.store.compaction.compacting import compact_segment, install_over
from semmap_log.store.folder import MOST_BYTES, LogFolder
from semmap_log.store.reading.segment_scan import Segment
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.writing import segment_chain
from tests.store.logs import files_of, see

DOOR = sl.DoorId(1)
VICTIM = b"export PATH=/usr/bin\n"


@pytest.fixture(autouse=True)
def _small_segments(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 10)


@pytest.fixture
def victim(tmp_path: Path) -> Path:
    """A file outside of the log, which nobody may change."""
    path = tmp_path / "bashrc"
    path.write_bytes(VICTIM)
    return path


def made(path: Path, sightings: int = 5) -> Path:
    """Return a log with a door, and so many sightings."""
    with sl.create(path, tz="UTC", compact=False) as log:
        log.add_door()
        see(log, sightings)
    return path


def test_a_writer_of_a_moved_folder_leaves_the_next_log_alone(tmp_path: Path) -> None:
    """Another log is made under the old name."""
    ours, theirs = tmp_path / "office_old", tmp_path / "office"
    first = sl.create(theirs, tz="UTC", compact=False)
    first.add_door()
    see(first, 5)
    theirs.rename(ours)
    second = sl.create(theirs, tz="UTC", compact=False)
    second.add_door()

    for _ in range(5):
        see(second, 7)
        see(first, 7)
    first.close()
    second.close()

    for path, events in ((ours, 1 + 5 + 35), (theirs, 1 + 35)):
        assert 0 == verify(path).exit_code
        assert events == sum(len(batch) for batch in sl.read(path).batches())


def test_a_writer_answers_from_its_own_folder(tmp_path: Path) -> None:
    """What it reads itself, retractions and repeated commands with it, is not the other log's."""
    path = tmp_path / "office"
    with sl.create(path, tz="UTC", compact=False) as log:
        log.add_door(name="front")
        see(log, 25)
        path.rename(tmp_path / "elsewhere")
        made(path, sightings=3)
        log.retract(3)

        assert ["front"] == [door.name for door in log.replay().doors.values()]
        assert 27 == sum(len(batch) for batch in log.batches())  # one is retracted
        assert 28 == sum(len(one.batch) for one in log.follow(-1, poll_s=0, stop=lambda: True))


def test_relative_paths_are_those_of_the_moment_of_opening(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After `os.chdir` a log of the same name elsewhere is neither read nor written."""
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    made(there / "log", sightings=1)
    before = files_of(there / "log")
    monkeypatch.chdir(here)
    made(Path("log"), sightings=5)
    reader, writer = sl.read("log"), sl.append("log", compact=False)

    monkeypatch.chdir(there)
    see(writer, 25)
    reader.refresh()

    assert [31, 31] == [sum(len(b) for b in log.batches()) for log in (reader, writer)]
    assert 31 == sum(len(one.batch) for one in reader.follow(-1, poll_s=0, stop=lambda: True))
    writer.close()
    assert before == files_of(there / "log")
    assert 0 == verify(here / "log").exit_code


def test_a_segment_that_was_exchanged_under_the_writer_is_told_at_the_roll(tmp_path: Path) -> None:
    """What an `rsync` or a `cp` put over it has lost what was written since: no success is told."""
    path = made(tmp_path / "log")
    copy = tmp_path / "copy.mcap"
    log = sl.append(path, compact=False, durability="flush")
    see(log, 2)
    (live,) = path.glob("*.mcap")
    shutil.copy(live, copy)
    see(log, 2)
    copy.replace(live)

    with pytest.raises(LogPoisonedError, match="removed or exchanged"):
        see(log, 10)
    with pytest.raises(LogPoisonedError, match="a write failed"):
        log.observe(DOOR, "open")
    log.close()


def test_a_segment_that_was_exchanged_under_the_writer_is_told_at_the_end(tmp_path: Path) -> None:
    """A name that a file under another lost is enough."""
    path = made(tmp_path / "log")
    log = sl.append(path, compact=False, durability="flush")
    see(log, 2)
    (live,) = path.glob("*.mcap")
    live.rename(path / "other.mcap")

    with pytest.raises(LogPoisonedError, match="removed or exchanged"):
        log.close()


@pytest.mark.parametrize(("durability", "told_at_once"), [("event", True), ("flush", False)])
def test_a_live_segment_that_was_copied_over_is_told(
    tmp_path: Path, durability: str, told_at_once: bool
) -> None:
    """An older state of it, in place, as `cp` does: the same file, but not what was written."""
    path = made(tmp_path / "log")
    log = sl.append(path, compact=False, durability=durability)
    see(log, 2)
    (live,) = path.glob("*.mcap")
    older = live.read_bytes()
    see(log, 1)
    live.write_bytes(older[:-100])

    if not told_at_once:
        see(log, 1)
    with pytest.raises(LogPoisonedError, match="cut, or written over"):
        see(log, 1) if told_at_once else log.close()
    log.close()


@pytest.mark.parametrize("in_place", [True, False])
def test_a_compacted_copy_that_was_exchanged_takes_no_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_place: bool
) -> None:
    """An older state of the temporary file is put over it after it was compared."""
    path = made(tmp_path / "log", sightings=25)
    before = files_of(path)
    install = SegmentWriter.install

    def exchanged(copy: SegmentWriter, **how: Any) -> None:
        assert copy.temporary is not None
        older = (path / copy.temporary).read_bytes()[:-500]
        if not in_place:
            (path / copy.temporary).unlink()
        (path / copy.temporary).write_bytes(older)
        install(copy, **how)

    monkeypatch.setattr(SegmentWriter, "install", exchanged)
    with pytest.raises(LogAccessError, match="was exchanged, or written to"):
        compact(path, merge=False)

    assert before == files_of(path)
    assert 0 == verify(path).exit_code


def test_a_segment_that_was_removed_under_the_writer_is_told_at_once(tmp_path: Path) -> None:
    """It ends with the process: an append that promises more does not return."""
    path = made(tmp_path / "log")
    log = sl.append(path, compact=False)
    see(log, 2)
    (live,) = path.glob("*.mcap")
    live.unlink()

    with pytest.raises(LogPoisonedError, match="removed while it was written"):
        see(log, 1)
    log.close()


def test_a_segment_that_was_exchanged_while_it_was_compacted_stays(tmp_path: Path) -> None:
    """The copy is of another file: it does not take the place of one that nobody has read."""
    path = made(tmp_path / "log", sightings=25)
    first, other = path / "log_000000.mcap", tmp_path / "other.mcap"
    before = files_of(path)

    def exchanged_before(copy: SegmentWriter, segment: Segment) -> None:
        shutil.copy(first, other)
        other.replace(first)
        install_over(copy, segment)

    with pytest.raises(FileExistsError, match="was exchanged for another file"):
        compact_segment(LogFolder.held(path), first.name, install=exchanged_before)

    assert before == files_of(path)


def overwritten(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def copied_over(path: Path) -> None:
    shutil.copy(path, path.with_suffix(".copy"))
    path.with_suffix(".copy").replace(path)


@pytest.mark.parametrize("change", [Path.unlink, overwritten, copied_over])
@pytest.mark.parametrize("rolls", [0, 1])
def test_a_closed_segment_that_is_no_more_what_was_written_is_told(
    tmp_path: Path, change: Callable[[Path], None], rolls: int
) -> None:
    """Not before it would be needed: at the next roll, and at the end."""
    log = sl.create(tmp_path / "log", tz="UTC", compact=False)
    log.add_door()
    see(log, 25)
    change(tmp_path / "log" / "log_000000.mcap")

    def proceed() -> None:
        see(log, 10 * rolls)
        log.close()

    with pytest.raises(LogPoisonedError, match=r"_000000\.mcap was removed, exchanged"):
        proceed()


def test_a_file_in_the_way_of_the_next_segment_is_not_replaced(tmp_path: Path) -> None:
    """Whoever put it there, it is not ours; what was written before stays."""
    path = made(tmp_path / "log")
    (path / "log_000001.mcap").write_bytes(VICTIM)
    (path / "log_000001.mcap").rename(tmp_path / "kept")
    log = sl.append(path, compact=False)
    (tmp_path / "kept").rename(path / "log_000001.mcap")

    with pytest.raises(LogPoisonedError, match="File exists"):
        see(log, 20)
    log.close()

    assert VICTIM == (path / "log_000001.mcap").read_bytes()
    (path / "log_000001.mcap").unlink()
    assert 10 == sum(len(batch) for batch in sl.read(path).batches())


def test_where_there_are_no_hard_links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A look and a rename: nothing that is there is replaced, either."""

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(1, os.strerror(1))

    monkeypatch.setattr(os, "link", refuse)
    path = made(tmp_path / "log", sightings=25)

    folder = LogFolder.held(path)
    temporary, fd = folder.new_file("x.mcap")
    os.close(fd)
    with pytest.raises(FileExistsError):
        folder.put_new(temporary, "log_000001.mcap")
    folder.remove(temporary)

    assert 0 == verify(path).exit_code
    assert 26 == sum(len(batch) for batch in sl.read(path).batches())


def noted(monkeypatch: pytest.MonkeyPatch, *names: str) -> list[str]:
    """Return a list that tells of the calls of these functions of `os`, as they come."""
    calls: list[str] = []

    def noting(name: str, function: Callable[..., object]) -> Callable[..., object]:
        def call(*args: object, **more: object) -> object:
            calls.append(name)
            return function(*args, **more)

        return call

    for name in names:
        monkeypatch.setattr(os, name, noting(name, getattr(os, name)))
    return calls


def test_a_power_cut_leaves_a_new_segment_one_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its own is on the disk before the other one goes."""
    folder = LogFolder.held(tmp_path)
    temporary, fd = folder.new_file("x.mcap")
    os.close(fd)
    calls = noted(monkeypatch, "link", "fsync", "unlink")

    folder.put_new(temporary, "x.mcap")

    assert ["link", "fsync", "unlink"] == calls
    assert [tmp_path / "x.mcap"] == list(tmp_path.iterdir())


def test_what_is_written_whole_is_on_the_disk_before_it_has_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And the name before the call returns: a power cut leaves the old one or the new one."""
    calls = noted(monkeypatch, "fsync", "replace")

    LogFolder.held(tmp_path).write_atomic("closed.json", [b"new"])

    assert ["fsync", "replace", "fsync"] == calls


@pytest.mark.parametrize("link", [Path.symlink_to, Path.hardlink_to])
def test_a_temporary_file_that_somebody_foresaw_is_not_written_to(
    tmp_path: Path,
    victim: Path,
    link: Callable[[Path, Path], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nothing is made where something is."""
    path = made(tmp_path / "log")
    monkeypatch.setattr(os, "urandom", lambda _: b"\xbe\xef")
    link(path / f".closed.json.{os.getpid()}-beef.tmp", victim)

    with pytest.raises(FileExistsError):
        LogFolder.held(path).write_atomic("closed.json", [b"{}"])

    assert VICTIM == victim.read_bytes()


def test_a_pipe_in_a_logs_folder_is_not_waited_for(tmp_path: Path) -> None:
    """Opening one for reading ends when somebody writes, which may be never."""
    os.mkfifo(tmp_path / "closed.json")
    told: list[str] = []

    def read() -> None:
        try:
            told.append(repr(LogFolder(tmp_path).read_bytes("closed.json")))
        except LogAccessError as error:
            told.append(str(error))

    reading = threading.Thread(target=read, daemon=True)
    reading.start()
    reading.join(20)

    (said,) = told
    assert "closed.json" in said


@pytest.mark.parametrize(
    "put", [Path.symlink_to, Path.hardlink_to, lambda path, _: os.mkfifo(path)]
)
def test_a_lock_file_that_is_a_link_or_a_pipe_is_refused(
    tmp_path: Path, victim: Path, put: Callable[[Path, Path], None]
) -> None:
    """A log may come from a stranger: the lock file is emptied, and must be no other file."""
    path = made(tmp_path / "log")
    (path / ".lock").unlink()
    put(path / ".lock", victim)

    with pytest.raises(LogAccessError, match=r"\.lock: expected a file of this folder alone"):
        sl.append(path)
    assert VICTIM == victim.read_bytes()


@pytest.mark.parametrize("link", [Path.symlink_to, Path.hardlink_to])
@pytest.mark.parametrize("name", ["metadata.yaml", "closed-0-6.json"])
def test_what_is_written_beside_the_segments_follows_no_link(
    tmp_path: Path, victim: Path, name: str, link: Callable[[Path, Path], None]
) -> None:
    """The link is replaced, or the log refused; the other file stays what it is."""
    path = made(tmp_path / "log")
    text = (path / name).read_bytes()
    (path / name).unlink()
    victim.write_bytes(text)
    link(path / name, victim)

    try:
        with sl.append(path, compact=False) as log:
            see(log, 3)
    except LogError as error:
        assert name in str(error)

    assert text == victim.read_bytes()


def test_a_kept_tail_follows_no_link(tmp_path: Path, victim: Path) -> None:
    """A link lies where the torn tail is to be kept."""
    path = made(tmp_path / "log")
    log = sl.append(path, compact=False)
    see(log, 2)
    (live,) = path.glob("*.mcap")
    whole = live.read_bytes()
    log.close()
    live.write_bytes(whole + b"torn")
    (path / f"{live.name}.torn-{len(whole)}").symlink_to(victim)

    with sl.append(path, compact=False) as log:
        see(log, 1)

    assert VICTIM == victim.read_bytes()
    assert b"torn" == (path / f"{live.name}.torn-{len(whole)}-2").read_bytes()


def test_of_two_creators_one_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both found the folder empty; the other was quicker, and has closed its log already."""
    path = tmp_path / "log"
    is_empty, others = LogFolder.is_empty, [1]

    def then_made(folder: LogFolder) -> bool:
        found = is_empty(folder)
        if others:
            others.pop()
            made(path)
        return found

    path.mkdir()
    monkeypatch.setattr(LogFolder, "is_empty", then_made)

    with pytest.raises(LogExistsError, match="expected a new or empty folder"):
        sl.create(path, tz="UTC")

    assert 6 == sum(len(batch) for batch in sl.read(path).batches())


def test_a_file_that_is_a_hole_is_not_read_to_its_end(tmp_path: Path) -> None:
    """Beside segments, in a folder that may come from a stranger: it takes no room on a disk."""
    log = made(tmp_path / "log")
    os.truncate(log / "metadata.yaml", 2**36)

    assert MOST_BYTES == len(LogFolder(log).read_bytes("metadata.yaml"))
    assert 5 == len(LogFolder(log).read_bytes("metadata.yaml", 5))
    assert DOOR in sl.read(log).replay().doors
    assert not [one for one in verify(log).findings if "chunk" in one.kind]
