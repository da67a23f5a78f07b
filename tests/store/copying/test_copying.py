"""A log copied: whole, verified, only what is new the second time, and nothing else overwritten."""

from __future__ import annotations

import errno
import json
import os
import resource
import shutil
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.cli import main
from semmap_log.errors import CorruptLogError, LogError, LogExistsError, LogLockedError, OutputError
from semmap_log.log.replay.maintenance import copy, verify
from semmap_log.store.compaction import compact
from semmap_log.store.writing import segment_chain
from tests.marks import marks
from tests.page_reader import READ
from tests.store.beside import recording
from tests.store.logs import digest_of_records, files_of, see, segment_files

CALLS = ("fsync", "replace", "unlink", "open")
"""By which a copying changes what is on the disk."""


@pytest.fixture(autouse=True)
def small_segments(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 10)


@pytest.fixture
def log(tmp_path: Path) -> Iterator[Path]:
    """Two closed segments of 10 events, and a live one of 6, which is being written."""
    with sl.create(tmp_path / "log", tz="UTC", compact=False) as log:
        log.add_door()
        see(log, 25)
        yield tmp_path / "log"


def goes_on(log: Path, count: int = 25) -> None:
    with sl.append(log, compact=False) as writer:
        see(writer, count)


@pytest.fixture
def older(tmp_path: Path) -> Path:
    """A log that nobody writes; it ends with a live segment, as after a crash."""
    path = tmp_path / "live" / "log"
    with sl.create(path, tz="UTC", compact=False) as writer:
        writer.add_door()
        see(writer, 25)
        shutil.copytree(path, tmp_path / "log")
    return tmp_path / "log"


def test_it_is_the_log_and_nothing_is_written_to_that(log: Path, tmp_path: Path) -> None:
    """Beside a writer: no lock is taken on the log, and the copy can be written to."""
    before = files_of(log)

    done = copy(log, tmp_path / "copy")

    assert (26, 3, 0) == (done.events, done.segments, done.kept)
    assert before == files_of(log)
    assert digest_of_records(log) == digest_of_records(tmp_path / "copy")
    assert READ(log).events == READ(tmp_path / "copy").events
    assert () == verify(tmp_path / "copy").findings
    goes_on(tmp_path / "copy", 3)
    assert 29 == verify(tmp_path / "copy").events


def test_the_second_time_only_what_is_new_is_copied(older: Path, tmp_path: Path) -> None:
    """Of what is there already only the ends are looked at."""
    copy(older, tmp_path / "copy")
    first, second, _ = segment_files(tmp_path / "copy")
    inodes = [path.stat().st_ino for path in (first, second)]
    goes_on(older)

    done = copy(older, tmp_path / "copy")

    new = segment_files(older)[2:]
    assert (51, 2, len(new)) == (done.events, done.kept, done.segments)
    assert sum(path.stat().st_size for path in new) == done.bytes
    assert inodes == [path.stat().st_ino for path in (first, second)]
    assert READ(older).events == READ(tmp_path / "copy").events
    assert () == verify(tmp_path / "copy").findings
    again = copy(older, tmp_path / "copy")
    assert (0, 0, done.kept + done.segments) == (again.segments, again.bytes, again.kept)


@pytest.mark.parametrize("merge", [True, False])
def test_a_log_that_was_compacted_since(older: Path, tmp_path: Path, *, merge: bool) -> None:
    """What changed is copied again; what was merged stands in one file there, too."""
    copy(older, tmp_path / "copy")
    goes_on(older)
    compact(older, merge=merge, keep_s=0)

    copy(older, tmp_path / "copy")

    assert [p.name for p in segment_files(older)] == [
        p.name for p in segment_files(tmp_path / "copy")
    ]
    assert READ(older).events == READ(tmp_path / "copy").events
    assert 0 == verify(tmp_path / "copy").exit_code


def test_a_copy_that_was_compacted_by_itself_goes_on(older: Path, tmp_path: Path) -> None:
    """It holds the same events, so what was merged there stays."""
    goes_on(older, 24)
    copy(older, tmp_path / "copy")
    compact(tmp_path / "copy", keep_s=0)
    goes_on(older)

    done = copy(older, tmp_path / "copy")

    assert done.kept > 0
    assert READ(older).events == READ(tmp_path / "copy").events
    assert 0 == verify(tmp_path / "copy").exit_code
    compact(tmp_path / "copy", keep_s=0)
    goes_on(older)
    before = files_of(tmp_path / "copy")
    with pytest.raises(LogError, match=r"the copy was compacted by itself. Copy into a new"):
        copy(older, tmp_path / "copy")
    assert before == files_of(tmp_path / "copy")


def test_a_cut_copy_is_noticed(older: Path, tmp_path: Path) -> None:
    """Its mark tells how far it reaches, its live segment included."""
    copy(older, tmp_path / "copy")
    last = segment_files(tmp_path / "copy")[-1]
    os.truncate(last, last.stat().st_size - 300)

    with pytest.raises(CorruptLogError, match="ended before event 26"):
        sl.read(tmp_path / "copy")


def test_a_torn_tail_and_what_is_not_the_logs_are_left_out(older: Path, tmp_path: Path) -> None:
    """And that is told."""
    with segment_files(older)[-1].open("ab") as file:
        file.write(b"\x06torn")
    (older / "index").mkdir()
    (older / "notes.txt").touch()

    done = copy(older, tmp_path / "copy")

    assert (5, ("index", "notes.txt")) == (done.torn_bytes, done.left_out)
    assert () == verify(tmp_path / "copy").findings


def test_what_is_no_earlier_copy_is_refused(older: Path, tmp_path: Path) -> None:
    """By what was expected and what was found; nothing there changes."""
    there = tmp_path / "copy"
    copy(older, there)
    goes_on(there, 1)
    before = files_of(there)
    with pytest.raises(LogError, match=r"event 25, got one"):
        copy(older, there)
    goes_on(older, 3)
    with pytest.raises(LogError, match=r"before event 27"):
        copy(older, there)
    sl.create(tmp_path / "other", tz="UTC").close()
    with pytest.raises(LogError, match=r"expected an earlier copy of .*got another log"):
        copy(tmp_path / "other", there)
    assert before == files_of(there)


def test_a_place_that_is_no_copy_is_left_alone(older: Path, tmp_path: Path) -> None:
    """Somebody's folder, a file, the log's own folder: not even a lock file is put there."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").touch()
    (tmp_path / "file").touch()
    for place in ("mine", "file"):
        with pytest.raises(LogError, match=r"choose another place|this is a file"):
            copy(older, tmp_path / place)
    for inside in (older, older / "copy"):
        with pytest.raises(OutputError, match="lies in the log's own folder"):
            copy(older, inside)
    assert [tmp_path / "mine" / "thesis.txt"] == list((tmp_path / "mine").iterdir())
    with pytest.raises(LogExistsError):
        copy(older, tmp_path / "mine")


def test_a_copy_that_is_written_is_refused(older: Path, tmp_path: Path) -> None:
    """It has one writer, as any log."""
    copy(older, tmp_path / "copy")
    with sl.append(tmp_path / "copy"), pytest.raises(LogLockedError):
        copy(older, tmp_path / "copy")


@pytest.mark.parametrize("number", [2, 3, 5])
@pytest.mark.parametrize("place", [0.3, 0.8, 0.9, 0.99])
def test_a_damaged_log_leaves_the_copy_as_it_was(
    older: Path, tmp_path: Path, number: int, place: float
) -> None:
    """The error names the log's own file, the copy has no new file, and goes on later."""
    there = tmp_path / "copy"
    copy(older, there)
    goes_on(older, 30)
    path = segment_files(older)[number]
    whole = path.read_bytes()
    before = files_of(there)
    at = int(place * len(whole))
    path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :])

    with pytest.raises(CorruptLogError, match=path.name) as damaged:
        copy(older, there)

    assert str(older) in str(damaged.value)
    assert before == {name: data for name, data in files_of(there).items() if name in before}
    assert all(name in before or name.endswith(".tmp") for name in files_of(there))
    assert 26 == len(READ(there).events)
    path.write_bytes(whole)
    copy(older, there)
    assert READ(older).events == READ(there).events
    assert not list(there.glob(".*.tmp"))


def test_full_finds_what_is_damaged_in_the_copy(older: Path, tmp_path: Path) -> None:
    """And copies it again; without it nobody looks there."""
    there = tmp_path / "copy"
    copy(older, there)
    path = segment_files(there)[0]
    whole = path.read_bytes()
    at = len(whole) // 2
    path.write_bytes(whole[:at] + bytes([whole[at] ^ 255]) + whole[at + 1 :])
    assert 0 == copy(older, there).segments

    done = copy(older, there, full=True)

    assert (1, 2) == (done.segments, done.kept)
    assert whole == path.read_bytes()
    assert 0 == verify(there).exit_code


def died(call: str, number: int, act: Callable[[], object], *, error: int | None) -> bool:
    """Do something in a child, whose n-th call of the system kills it, or fails; was there one?"""
    pid = os.fork()
    if pid == 0:
        left = number

        def counted(real: Callable[..., Any]) -> Callable[..., Any]:
            def called(*args: Any, **how: Any) -> Any:
                nonlocal left
                writes = call != "open" or (len(args) > 1 and args[1] & os.O_CREAT)
                left -= bool(writes)
                if writes and left < 0 and error is None:
                    os.kill(os.getpid(), signal.SIGKILL)
                if writes and left == -1 and error is not None:
                    raise OSError(error, os.strerror(error))
                return real(*args, **how)

            return called

        setattr(os, call, counted(getattr(os, call)))
        try:
            act()
        except OutputError:
            os._exit(3)
        except BaseException:  # noqa: BLE001 - the parent is told
            os._exit(4 if left < 0 else 5)
        os._exit(0)
    _, status = os.waitpid(pid, 0)
    assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) in (0, 3, 4), os.WEXITSTATUS(status)
    return os.WIFSIGNALED(status) or os.WEXITSTATUS(status) != 0


@pytest.mark.parametrize(
    ("case", "error"),
    [("new", None), ("grown", None), ("merged", None), ("grown", errno.ENOSPC)],
    ids=["new, killed", "grown, killed", "merged, killed", "grown, full"],
)
@pytest.mark.parametrize("call", CALLS)
def test_stopped_at_any_step_the_copy_is_a_log(
    older: Path, tmp_path: Path, call: str, error: int | None, case: str
) -> None:
    """Killed, or the disk full: what was there, or more of it; and the next copying goes on."""
    former = 0
    if case != "new":
        copy(older, tmp_path / "former")
        former = len(READ(tmp_path / "former").events)
    goes_on(older)
    if case == "merged":
        compact(older, keep_s=0)
    whole, steps = READ(older).events, 0
    for number in range(200):
        there = tmp_path / f"{number}" / "copy"
        if former:
            shutil.copytree(tmp_path / "former", there)

        if not died(call, number, lambda: copy(older, there), error=error):  # noqa: B023
            break

        steps += 1
        if former or (there.exists() and segment_files(there)):
            events = READ(there).events
            assert former <= len(events)
            assert events == whole[: len(events)]
            assert len(events) == sum(len(batch) for batch in sl.read(there).batches())
            assert verify(there).exit_code == 0
        copy(older, there)
        assert READ(there).events == whole
        assert not list(there.glob(".*.tmp"))
        shutil.rmtree(there.parent)
    assert steps >= (0 if call == "unlink" else 2)


def test_what_was_copied_before_a_stop_is_not_copied_again(older: Path, tmp_path: Path) -> None:
    """The finished files of a copying that was killed are verified, and get their names."""
    there = tmp_path / "copy"
    assert died("replace", 0, lambda: copy(older, there), error=None)
    finished = {path.stat().st_ino for path in there.glob(".*.tmp")}

    copy(older, there)

    assert 3 == len(finished)
    assert finished == {path.stat().st_ino for path in segment_files(there)}


def test_a_disk_that_is_really_full(older: Path, tmp_path: Path) -> None:
    """A file may not grow further: one line says so, and the copy is what it was."""
    there = tmp_path / "copy"
    copy(older, there)
    goes_on(older)
    most = segment_files(older)[2].stat().st_size - 1
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, limits[1]))
    try:
        with pytest.raises(OutputError, match="could not be written: File too large"):
            copy(older, there)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)

    assert 26 == len(READ(there).events)
    copy(older, there)
    assert READ(older).events == READ(there).events


def test_beside_a_writer_that_rolls_closes_and_merges(tmp_path: Path) -> None:
    """Each time the first events, all that were acknowledged."""
    log, there = tmp_path / "log", tmp_path / "copy"
    with recording(log, 5) as recorder:
        for _ in range(15):
            acknowledged = recorder.acknowledged
            done = copy(log, there)
            assert acknowledged < done.events == len(READ(there).events)
            time.sleep(0.02)
        recorder.end()
    copy(log, there)
    assert READ(log).events == READ(there).events
    assert 0 == verify(there).exit_code


def test_the_verb(
    older: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was copied, what was there, and what was left out; from a zip file, too."""
    monkeypatch.chdir(tmp_path)
    size = sum(path.stat().st_size for path in segment_files(older))
    (older / "index").mkdir()

    assert 0 == run("copy", "log", "copy")
    said = capsys.readouterr().out
    assert f"copy: 26 events; copied 3 segments, {size:,} bytes, verified; kept 0 that" in said
    assert "left out: index" in said
    assert 0 == run("copy", "log", "copy", "--json")
    as_json = json.loads(capsys.readouterr().out)
    assert (0, 3, 26) == (
        as_json["segments_copied"],
        as_json["segments_kept"],
        as_json["events"],
    )
    assert 1 == run("copy", "log", ".")
    assert 1 == run("copy", "nowhere", "new")
    assert not (tmp_path / "new").exists()
    assert marks(tmp_path / "copy")


def test_progress_reaches_the_end(log: Path, tmp_path: Path) -> None:
    """Each byte counts twice: written, and verified."""
    seen: list[tuple[int, int]] = []
    copy(log, tmp_path / "new", progress=lambda done, total: seen.append((done, total)))

    assert seen == sorted(seen)
    assert seen[-1][0] == seen[-1][1] > 0


def run(*arguments: str) -> int:
    try:
        main(list(arguments))
    except SystemExit as ended:
        return int(ended.code or 0)
    return 0
