"""One writer: whoever comes second is refused and changes nothing; readers see whole commits."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path

import pytest
from fault_injection.fault import Outcome
from fault_injection.rivals import race, read_during_everything

import semmap_log as sl
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded, RobotPose
from semmap_log.errors import LogError, LogLockedError

APPEND = "import sys, semmap_log as sl; sl.append(sys.argv[1]).close()"


def _everything(folder: Path) -> dict[str, tuple[int, int, bytes]]:
    """Return name -> (inode, mtime, bytes) of all that is in a folder, and of itself."""
    files = {p.name: (p.stat().st_ino, p.stat().st_mtime_ns, p.read_bytes())
             for p in folder.iterdir()}  # fmt: skip
    status = folder.stat()
    return {**files, ".": (status.st_ino, status.st_mtime_ns, b"")}


def _is_refused(log: Path) -> bool:
    """Tell whether another process is told that somebody is writing."""
    done = subprocess.run(
        [sys.executable, "-c", APPEND, log], capture_output=True, text=True, check=False
    )
    return "LogLockedError" in done.stderr


def _bad(outcomes: list[Outcome]) -> list[Outcome]:
    return [outcome for outcome in outcomes if not outcome.is_good]


def test_the_loser_leaves_every_byte_and_time_alone(tmp_path: Path) -> None:
    """A second writer, in this process or another, does not so much as touch the lock file."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as log:
        log.add_door()
        before = _everything(path)

        with pytest.raises(LogLockedError):
            sl.append(path)
        refused = _is_refused(path)

        assert refused
        assert before == _everything(path)


@pytest.mark.slow
def test_nothing_is_opened_for_writing_before_the_lock_is_held(tmp_path: Path) -> None:
    """In a recovery, where most is written, each change of a file comes after both locks."""
    path = tmp_path / "log"
    _killed_writer(path)
    (path / ".log_000000.mcap.1.tmp").write_bytes(b"left behind")
    code = """
import os, sys, semmap_log as sl
import semmap_log.store.writing.writer
log, seen = sys.argv[1], []
def hook(event, args):
    name = str(args[0])
    ours = name.startswith(log) or not os.path.isabs(name) and "log" in name or name == ".lock"
    if event == "open" and ours and args[2] & (os.O_WRONLY | os.O_RDWR):
        seen.append("lock file" if str(args[0]).endswith(".lock") else "write")
    elif event == "fcntl.flock":
        seen.append("flock")
    elif event in ("os.rename", "os.remove", "os.truncate", "os.link"):
        seen.append("write")
sys.addaudithook(hook)
sl.append(log).close()
print(*seen)
"""

    done = subprocess.run(
        [sys.executable, "-c", code, path], capture_output=True, text=True, check=True
    )
    seen = done.stdout.split()

    opened = ["lock", "file"]  # once to make it, once as it is there
    assert [*opened, *opened, "flock", "flock", "write"] == seen[:7]
    assert 5 < seen.count("write")


def test_a_deleted_lock_file_lets_nobody_in(tmp_path: Path) -> None:
    """Somebody tidies up while the log is written."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as log:
        (path / ".lock").unlink()

        with pytest.raises(LogLockedError, match="another process is writing"):
            sl.append(path)
        assert _is_refused(path)
        log.add_door()

    sl.append(path).close()
    assert 1 == len(sl.read(path).replay())


def test_a_lock_file_that_nobody_holds_is_no_obstacle(tmp_path: Path) -> None:
    """Whatever is written in it: also the number of a process that lives."""
    path = tmp_path / "log"
    _killed_writer(path)
    for said in ("", "999999999\n", "1\n", "garbage \xff" * 9):
        (path / ".lock").write_text(said, "latin-1")

        with sl.append(path) as log:
            log.add_door()

    assert 5 == len(sl.read(path).replay())


def _killed_writer(path: Path) -> None:
    code = (
        "import os, sys, semmap_log as sl\n"
        "log = sl.create(sys.argv[1], tz='UTC'); log.add_door(); os.kill(os.getpid(), 9)"
    )
    done = subprocess.run([sys.executable, "-c", code, path], check=False)
    assert -signal.SIGKILL == done.returncode


@pytest.mark.slow
def test_what_a_forked_child_does_releases_nothing(tmp_path: Path) -> None:
    """It cannot append or sync; it closes the log, collects garbage and ends."""
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as log:
        log.add_door()
        before = (path / "log_000000.mcap").read_bytes()
        child = os.fork()
        if child == 0:
            try:
                os._exit(_try_everything(log))
            finally:
                os._exit(1)
        _, status = os.waitpid(child, 0)

        assert 3 == os.waitstatus_to_exitcode(status)
        assert before == (path / "log_000000.mcap").read_bytes()
        assert _is_refused(path)
        log.add_door()
        log.sync()
    assert 2 == len(sl.read(path).replay())
    assert sl.read(path)._reader.segments[-1].closed


def _try_everything(log: sl.DoorLogWriter) -> int:
    """Return how many of a child's calls were refused."""
    refused = 0
    pose = RobotPose(x=0.0, y=0.0, theta=0.0)
    for call in (log.add_door, log.start_patrol, partial(log.append, [pose])):
        with pytest.raises(LogError, match="forked child cannot append"):
            call()
        refused += 1
    log.close()
    del log
    gc.collect()
    return refused


def test_the_lock_is_free_though_a_child_lives_on(tmp_path: Path) -> None:
    """A child that was forked while the log was open keeps nobody out once the log is closed."""
    log = sl.create(tmp_path / "log", tz="UTC")
    child = os.fork()
    if child == 0:
        time.sleep(60)
        os._exit(0)
    try:
        log.close()

        with sl.append(tmp_path / "log") as again:
            again.add_door()
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


@pytest.mark.parametrize("durability", ["event", "batch", "flush", "none"])
def test_threads_share_a_log(durability: str, tmp_path: Path) -> None:
    """Each commit of each thread is stored once, under the number that its thread was told."""
    threads, each = 6, 15
    told: dict[int, int] = {}

    def append(name: int) -> None:
        for i in range(each):
            door = name * 1000 + i + 1
            told[log.append([DoorAdded(door_id=DoorId(door))]).first_event] = door

    with sl.create(tmp_path / "log", tz="UTC", durability=durability) as log:
        workers = [threading.Thread(target=append, args=(name,)) for name in range(threads)]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()

    events = [e for batch in sl.read(tmp_path / "log").batches() for e in batch]
    assert list(range(threads * each)) == [e.number for e in events]
    assert told == {e.number: e.event.door_id for e in events if isinstance(e.event, DoorAdded)}


@pytest.mark.slow
def test_processes_that_race_lose_and_invent_nothing(memory: Path) -> None:
    """Three processes open, append and close one log as fast as they can."""
    outcomes = list(race(memory / "race", races=6))

    assert 3 * 6 + 1 == len(outcomes)
    assert [] == _bad(outcomes)


@pytest.mark.slow
def test_readers_see_prefixes_whatever_happens_to_the_log(memory: Path) -> None:
    """For a few seconds: writing, rolling, compacting, kills and recoveries; whole commits only."""
    for seconds in (3, 20, 80):  # on a busy machine not all readers get their turn in so few
        outcomes = list(read_during_everything(memory / f"busy-{seconds}", 7, seconds=seconds))

        assert [] == _bad(outcomes)
        assert 4 == len(outcomes)
        if all(outcome.checked for outcome in outcomes):
            return
    pytest.fail("some readers saw nothing in 80 seconds")
