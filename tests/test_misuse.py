"""What hostile callers tried and must not get away with: each of these once broke a log."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorObserved, RobotPose
from semmap_log.errors import (
    CommandError,
    InvalidEventError,
    LogError,
    LogLockedError,
    MomentError,
    SemmapError,
)
from semmap_log.interop.importing.importing import import_file
from tests.conftest import SteadyClock


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_interrupt_at_any_moment_leaves_a_log_that_opens(tmp_path: Path) -> None:
    """Ctrl-C inside `append`, by a caller who goes on."""
    is_armed = False

    def interrupt(_number: int, _frame: object) -> None:
        if is_armed:
            raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    path = tmp_path / "log"
    log = sl.create(path, tz="UTC")
    door = log.add_door()
    acknowledged = 1
    try:
        for i in range(120):
            with contextlib.suppress(KeyboardInterrupt, SemmapError):
                is_armed = True
                signal.setitimer(signal.ITIMER_REAL, 0.0001 + (i % 30) * 0.0001)
                for _ in range(20):
                    log.observe(door, "open")
                    acknowledged += 1
                is_armed = False
            is_armed = False
            signal.setitimer(signal.ITIMER_REAL, 0)
            with contextlib.suppress(SemmapError):
                log.close()
            log = sl.append(path)
            numbers = [n for batch in log.batches() for n in batch.number.tolist()]
            assert list(range(len(numbers))) == numbers
            assert acknowledged <= len(numbers)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
        log.close()

    assert len(numbers) == sum(commit.count for commit in sl.read(path).commits())


def test_what_an_append_reads_cannot_append(tmp_path: Path) -> None:
    """Both would take the same event numbers."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door()

        def events():
            log.observe(door, "open")
            yield DoorObserved(door_id=door, state=DoorState.CLOSED)

        with pytest.raises(LogError, match="under way"):
            log.append(events())
        log.observe(door, "open")

    assert 1 == sl.read(tmp_path / "log").replay().event


@pytest.mark.parametrize("state", [5, 200, None, "ajar", True + 6])
def test_a_state_that_is_none_is_refused(state: object, tmp_path: Path) -> None:
    """Before it is in the log for ever."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door()

        with pytest.raises(InvalidEventError, match="OPEN CLOSED"):
            log.observe(door, state)
        with pytest.raises(InvalidEventError, match="OPEN CLOSED"):
            log.append([DoorObserved(door_id=door, state=state)])


@pytest.mark.parametrize("actor", ["\0", "\udcff", 5])
def test_a_note_that_cannot_be_stored_is_refused(actor: object, tmp_path: Path) -> None:
    """Texts are checked where they come in, on the command line and in Python alike."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        with pytest.raises(InvalidEventError, match=r"Note.actor"):
            log.add_door(actor=actor)

        assert -1 == log.replay().event


def test_an_empty_commit_is_refused(tmp_path: Path) -> None:
    """There is nothing to say."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        with pytest.raises(CommandError, match="at least one event"):
            log.append([])
        with pytest.raises(CommandError, match="16 bytes"):
            log.append([DoorAdded(door_id=DoorId(1))], command_id=b"short")

        assert 0 == sum(1 for _ in log.commits())


def test_relative_times_of_commands_count_from_now(tmp_path: Path, clock: SteadyClock) -> None:
    """A question counts from the log's end; what happened "5 min ago" happened five minutes ago."""
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        door = log.add_door(at="now")
        clock.now_ns += 7 * 86_400 * 10**9
        log.observe(door, "open", at="5 min ago")
        (seen,) = log.history(kinds=[DoorObserved])

        assert 5 * 60 * 10**9 == pytest.approx(clock.now_ns - seen.happened_ns, abs=10**9)
        assert seen.happened_ns == log.end_ns()
        assert log.replay(at="now")[door].state is DoorState.OPEN
        with pytest.raises(MomentError, match="swap"):
            log.diff("now", "1h ago")


def test_without_a_time_it_happened_by_the_wall_clock(tmp_path: Path, clock: SteadyClock) -> None:
    """After a jump to 2038 and back, recorded times go on from there; true times are kept."""
    with sl.create(tmp_path / "log", tz="UTC", clock=clock) as log:
        true_ns = clock.now_ns
        clock.now_ns = 2_150_000_000 * 10**9
        door = log.add_door()
        clock.now_ns = true_ns
        log.observe(door, "open")
        (seen,) = log.history(kinds=[DoorObserved])

    assert true_ns < seen.happened_ns < true_ns + 10**9
    assert seen.recorded_ns > 2_150_000_000 * 10**9


def test_a_command_sent_again_is_answered_as_the_first_time(tmp_path: Path) -> None:
    """Also one that could not be done twice: a removal, the end of a round."""
    ids = [bytes([n]) * 16 for n in range(4)]
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door(name="front", command_id=ids[0])
        log.start_patrol(command_id=ids[1])
        log.finish_patrol(command_id=ids[2])
        log.remove_door("front", command_id=ids[3])
    with sl.append(tmp_path / "log") as log:
        assert door == log.add_door(name="front", command_id=ids[0])
        assert (True, 1) == _repeated(log.start_patrol(command_id=ids[1]))
        assert (True, 1) == _repeated(log.finish_patrol(command_id=ids[2]))
        assert log.remove_door("front", command_id=ids[3]).repeated
        with pytest.raises(CommandError, match="with other content"):
            log.start_patrol(command_id=ids[3])

    assert 4 == sum(1 for _ in sl.read(tmp_path / "log").commits())


def _repeated(answer: tuple[object, int]) -> tuple[bool, int]:
    appended, number = answer
    return bool(getattr(appended, "repeated", False)), number


def test_a_number_can_be_a_name(tmp_path: Path) -> None:
    """It means the door that bears it, unless another door has it as its id."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        first, second = log.add_door(name="102"), log.add_door(name="1")

        assert first == log.resolve("102")
        assert second == log.resolve("2")
        with pytest.raises(SemmapError, match=r"'1' can mean 2 doors: .*id 2.*id 1"):
            log.resolve("1")


def test_a_writer_sees_its_own_writes_beside_other_threads(tmp_path: Path) -> None:
    """A question asked at the same time must not make it look stale."""
    stop = threading.Event()
    with sl.create(tmp_path / "log", tz="UTC") as log:
        door = log.add_door()

        def ask() -> None:
            while not stop.is_set():
                log.replay()

        threads = [threading.Thread(target=ask) for _ in range(2)]
        for thread in threads:
            thread.start()
        try:
            for i in range(60):
                state = (DoorState.OPEN, DoorState.CLOSED)[i % 2]
                log.observe(door, state)
                assert log.replay()[door].state is state
        finally:
            stop.set()
            for thread in threads:
                thread.join()


def test_a_child_keeps_no_lock(tmp_path: Path) -> None:
    """A process that was forked while the log was open does not keep the next writer out."""
    log = sl.create(tmp_path / "log", tz="UTC")
    child = os.fork()
    if child == 0:
        signal.pause()
        os._exit(0)
    try:
        log.close()
        sl.append(tmp_path / "log").close()
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


def test_a_pose_after_the_end_is_refused(tmp_path: Path) -> None:
    """Not kept for a timer that can only fail."""
    log = sl.create(tmp_path / "log", tz="UTC")
    log.close()

    with pytest.raises(LogError, match="was closed"):
        log.robot_pose(RobotPose(x=0.0, y=0.0, theta=0.0))
    log.close()


@pytest.mark.parametrize(
    "name", [".hidden", "new\nline", "tab\there", "x" * 250, "Tür 'a' \"b\" %s", "\x01"]
)
def test_any_folder_name_makes_a_log_that_rosbags_opens(name: str, tmp_path: Path) -> None:
    """Segment names and metadata.yaml come from it."""
    from rosbags.highlevel import AnyReader

    path = tmp_path / name
    with sl.create(path, tz="UTC") as log:
        log.add_door()
    with sl.append(path) as log:
        log.add_door()

    assert 2 == len(sl.read(path).replay())
    with AnyReader([path]) as reader:
        assert 2 == sum(c.msgcount for c in reader.connections if c.topic == "/semmap/door_added")


def test_a_killed_init_can_be_done_again(tmp_path: Path) -> None:
    """What it left is ours: a lock file, a temporary segment. Somebody else's file is not."""
    path = tmp_path / "log"
    path.mkdir()
    (path / ".lock").touch()
    (path / ".log_000000.mcap.123.tmp").write_bytes(b"half")

    sl.create(path, tz="UTC").close()

    assert {".lock", "closed-0-0.json", "log_000000.mcap", "metadata.yaml"} == {
        p.name for p in path.iterdir()
    }


def test_leftovers_of_killed_writers_are_removed(tmp_path: Path) -> None:
    """By the next writer, who holds the lock."""
    path = tmp_path / "log"
    sl.create(path, tz="UTC").close()
    (path / ".log_000000.mcap.123.tmp").write_bytes(b"half")

    sl.append(path).close()

    assert not list(path.glob(".*.tmp"))


@pytest.mark.parametrize("name", ["f.csv", "f.yaml", "f.jsonl", "f.building.yaml"])
def test_a_pipe_or_device_is_not_imported(name: str, tmp_path: Path) -> None:
    """It is refused at once; it must not hold the writer's lock for ever."""
    os.mkfifo(tmp_path / name)
    with sl.create(tmp_path / "log", tz="UTC") as log, pytest.raises(SemmapError, match="regular"):
        import_file(log, tmp_path / name)


def test_a_pipe_in_the_folder_is_refused(tmp_path: Path) -> None:
    """Reading it would never end."""
    sl.create(tmp_path / "log", tz="UTC").close()
    os.mkfifo(tmp_path / "log" / "x.mcap")

    with pytest.raises(SemmapError, match="not a regular file"):
        sl.read(tmp_path / "log")


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [["replay", "LOG", "--json"], ["history", "LOG"], ["add", "LOG"], ["info", "LOG"]],
    ids=lambda arguments: arguments[0],
)
def test_a_full_disk_behind_stdout_is_one_line(arguments: list[str], tmp_path: Path) -> None:
    """No traceback; exit code 1."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(name="Tür")
    command = [a.replace("LOG", str(tmp_path / "log")) for a in arguments]

    with Path("/dev/full").open("w") as full:
        done = subprocess.run([sys.executable, "-m", "semmap_log", *command], stdout=full,
                              stderr=subprocess.PIPE, text=True, check=False)  # fmt: skip

    assert 1 == done.returncode
    assert 1 == len(done.stderr.splitlines()), done.stderr
    assert "No space left" in done.stderr


@pytest.mark.slow
def test_closed_streams_and_plain_terminals_are_no_error(tmp_path: Path) -> None:
    """stdin and stdout closed, or ASCII only."""
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(name="Tür")
    program = f"{sys.executable} -m semmap_log"
    for command in (f"{program} replay log >&-", f"{program} record log <&-",
                    f"PYTHONIOENCODING=ascii {program} replay log"):  # fmt: skip
        done = subprocess.run(command, shell=True, cwd=tmp_path, capture_output=True, text=True,
                              check=False)  # fmt: skip

        assert 0 == done.returncode, (command, done.stderr)


def test_a_locked_log_says_who_even_on_a_full_disk(tmp_path: Path) -> None:
    """The writer's number in the lock file is decoration: taking the lock does not depend on it."""
    with sl.create(tmp_path / "log", tz="UTC"), pytest.raises(LogLockedError, match="process"):
        sl.append(tmp_path / "log")
