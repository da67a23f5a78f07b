"""Compaction in a thread beside the writer: it does its work, and never becomes the writer's."""

from __future__ import annotations

import logging
import os
import resource
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.errors import LogError
from semmap_log.store.bag_metadata import ClosedSegment
from semmap_log.store.compaction import background, compact_segment
from semmap_log.store.compaction.background import BackgroundCompactor
from semmap_log.store.compaction.merge import needs_compaction
from semmap_log.store.folder import LogFolder
from semmap_log.store.reading.segment_reading import statistics_of
from semmap_log.store.reading.segment_scan import Segment, open_segment
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.writing import segment_chain
from tests.store.logs import digest_of_records, segment_files, write_log


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A log of three closed segments of many small chunks."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 100)
    return write_log(tmp_path / "log", 250)


class Installed:
    """Remembers what was installed, and lets a test wait for it."""

    def __init__(self) -> None:
        self.calls: list[tuple[ClosedSegment, str]] = []
        self._more = threading.Condition()

    def __call__(self, segment: ClosedSegment) -> None:
        with self._more:
            self.calls.append((segment, threading.current_thread().name))
            self._more.notify_all()

    def wait_for(self, count: int) -> None:
        with self._more:
            assert self._more.wait_for(lambda: len(self.calls) >= count, timeout=100)


@pytest.fixture
def installed() -> Installed:
    return Installed()


@pytest.fixture
def compactor(log: Path, installed: Installed) -> Iterator[BackgroundCompactor]:
    compactor = BackgroundCompactor(LogFolder(log), installed)
    yield compactor
    compactor.close(wait=False)


def wait_until(true: Callable[[], bool]) -> None:
    """Return once something is true."""
    deadline = time.monotonic() + 100
    while not true():
        assert time.monotonic() < deadline, "waited 100 s in vain"
        time.sleep(0.001)


def compaction_threads() -> list[threading.Thread]:
    return [t for t in threading.enumerate() if t.name == "semmap_log compaction"]


def temporaries(log: Path) -> list[str]:
    return [path.name for path in log.iterdir() if path.name.endswith(".tmp")]


def test_segments_are_compacted_one_after_the_other(
    log: Path, compactor: BackgroundCompactor, installed: Installed
) -> None:
    """Each that is added becomes smaller, holds the same records, and is reported in the thread."""
    files, before = segment_files(log), digest_of_records(log)
    sizes = [path.stat().st_size for path in files]

    for path in files:
        compactor.add(path.name)
    installed.wait_for(3)

    assert [path.name for path in files] == [said.name for said, _ in installed.calls]
    assert {"semmap_log compaction"} == {thread for _, thread in installed.calls}
    assert before == digest_of_records(log)
    assert all(path.stat().st_size < size for path, size in zip(files, sizes, strict=True))
    for path, (said, _) in zip(files, installed.calls, strict=True):
        assert statistics_of(open_segment(path)) == said


def test_no_thread_before_there_is_work(log: Path, compactor: BackgroundCompactor) -> None:
    """A writer that never rolls pays for no thread; one that does has one, a daemon."""
    assert [] == compaction_threads()

    compactor.add(segment_files(log)[0].name)

    assert [True] == [thread.daemon for thread in compaction_threads()]


def test_close_finishes_what_is_under_way_and_drops_the_rest(
    log: Path,
    compactor: BackgroundCompactor,
    installed: Installed,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The first is done, the two that wait stay as they are, the thread is gone."""
    files, (ready, proceed) = segment_files(log), _held_before_the_swap(monkeypatch)
    for path in files:
        compactor.add(path.name)
    assert ready.wait(100)

    closing = threading.Thread(target=compactor.close)
    closing.start()
    wait_until(lambda: compactor._closing)
    proceed.set()
    closing.join(100)

    assert not closing.is_alive()
    assert [] == compaction_threads()
    assert files[:1] == [log / said.name for said, _ in installed.calls]
    assert [False, True, True] == [needs_compaction(open_segment(path)) for path in files]
    assert [] == temporaries(log)


def test_abandoned_at_once(
    log: Path,
    compactor: BackgroundCompactor,
    installed: Installed,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nothing is replaced, no temporary file stays, the thread is gone."""
    real = compactor._pause

    def stands_still_once_it_writes(done: int) -> None:
        if temporaries(log):
            monkeypatch.setattr(background, "PAUSE_S", 100)
        real(done)

    monkeypatch.setattr(compactor, "_pause", stands_still_once_it_writes)
    before = [path.read_bytes() for path in segment_files(log)]
    compactor.add(segment_files(log)[0].name)
    wait_until(lambda: bool(temporaries(log)))

    compactor.close(wait=False)

    assert [] == compaction_threads()
    assert [] == temporaries(log)
    assert [] == installed.calls
    assert before == [path.read_bytes() for path in segment_files(log)]


def test_an_interrupted_close_replaces_nothing_afterwards(
    log: Path,
    compactor: BackgroundCompactor,
    installed: Installed,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Ctrl-C while `close` waits: the lock will be let go, so the segment must stay as it is."""
    (path, *_), (ready, proceed) = segment_files(log), _held_before_the_swap(monkeypatch)
    before = path.read_bytes()
    compactor.add(path.name)
    assert ready.wait(100)

    def interrupted() -> None:
        monkeypatch.undo()
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(compactor._ended, "wait", interrupted)

    with pytest.raises(KeyboardInterrupt):
        compactor.close()
    proceed.set()
    wait_until(compactor._ended.is_set)

    assert [] == installed.calls
    assert [] == temporaries(log)
    assert before == path.read_bytes()


def _held_before_the_swap(
    monkeypatch: pytest.MonkeyPatch,
) -> tuple[threading.Event, threading.Event]:
    """Return what is set when a copy is whole and compared, and what lets it go on."""
    ready, proceed = threading.Event(), threading.Event()

    def held_up(folder: LogFolder, name: str, *, pause: Any, install: Any) -> bool:
        def late(copy: SegmentWriter, replaced: Segment) -> None:
            ready.set()
            assert proceed.wait(100)
            install(copy, replaced)

        return compact_segment(folder, name, pause=pause, install=late)

    monkeypatch.setattr(background, "compact_segment", held_up)
    return ready, proceed


def test_an_append_does_not_wait(
    log: Path, compactor: BackgroundCompactor, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While a compaction stands still, a writer appends, rolls and syncs; nothing is shared."""
    monkeypatch.setattr(background, "PAUSE_S", 60)
    before = segment_files(log)[0].read_bytes()
    compactor.add(segment_files(log)[0].name)
    wait_until(lambda: bool(compaction_threads()))

    write_log(log.parent / "other", 350)
    with sl.append(log, compact=False) as opened:
        for _ in range(30):
            opened.observe(sl.DoorId(1), "open")

    assert before == segment_files(log)[0].read_bytes()
    assert 4 == len(segment_files(log.parent / "other"))


def test_damage_is_logged_and_the_next_is_done(
    log: Path,
    compactor: BackgroundCompactor,
    installed: Installed,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """A flipped bit: the segment stays byte for byte, a warning names it, the next is compacted."""
    broken, sound = segment_files(log)[:2]
    data = bytearray(broken.read_bytes())
    data[open_segment(broken).chunks[50].data_offset + 40] ^= 1
    broken.write_bytes(data)

    with caplog.at_level(logging.WARNING, "semmap_log"):
        compactor.add(broken.name)
        compactor.add(sound.name)
        installed.wait_for(1)

    assert [sound] == [log / said.name for said, _ in installed.calls]
    assert bytes(data) == broken.read_bytes()
    (record,) = caplog.records
    assert ("semmap_log", "WARNING") == (record.name, record.levelname)
    assert f"{broken}: not compacted" in record.getMessage()
    assert "damaged at byte" in record.getMessage()


def test_a_full_disk_is_logged(
    log: Path,
    compactor: BackgroundCompactor,
    installed: Installed,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """All stays as it was, nothing is left behind."""
    path = segment_files(log)[0]
    before = path.read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)

    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
        compactor.add(path.name)
        wait_until(lambda: bool(caplog.records))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)

    assert "File too large" in caplog.text
    assert before == path.read_bytes()
    assert [] == temporaries(log)
    assert [] == installed.calls


def test_a_callback_that_fails_is_logged(log: Path, caplog: pytest.LogCaptureFixture) -> None:
    """The segment is replaced, what went wrong afterwards is said, the thread goes on."""
    listed: list[Path] = []

    def refuse_the_first(said: ClosedSegment) -> None:
        listed.append(log / said.name)
        if len(listed) == 1:
            raise OSError(28, "No space left on device")

    compactor = BackgroundCompactor(LogFolder(log), refuse_the_first)
    for path in segment_files(log)[:2]:
        compactor.add(path.name)
    wait_until(lambda: len(listed) == 2)
    compactor.close()

    assert segment_files(log)[:2] == listed
    assert "compacted, but not listed" in caplog.text
    assert not any(needs_compaction(open_segment(path)) for path in listed)


def test_what_is_compacted_already_is_left_alone(
    log: Path, compactor: BackgroundCompactor, installed: Installed
) -> None:
    """Added twice, replaced once."""
    first, second = segment_files(log)[:2]

    compactor.add(first.name)
    compactor.add(first.name)
    compactor.add(second.name)
    installed.wait_for(2)

    assert [first, second] == [log / said.name for said, _ in installed.calls]


def test_a_forked_child_cannot_use_it(log: Path, compactor: BackgroundCompactor) -> None:
    """In the child `add` is refused, and `close` neither waits nor takes the parent's file away."""
    compactor.add(segment_files(log)[0].name)

    pid = os.fork()
    if pid == 0:
        status = 1
        try:
            compactor.close()
            compactor.add(segment_files(log)[1].name)
        except LogError as error:
            status = 0 if "forked child" in str(error) else 2
        finally:
            os._exit(status)
    _, status = os.waitpid(pid, 0)

    assert 0 == os.waitstatus_to_exitcode(status)


def test_abandoned_before_the_swap(
    log: Path,
    compactor: BackgroundCompactor,
    installed: Installed,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The compared copy is thrown away, since the lock may be gone."""
    (path, *_), (ready, proceed) = segment_files(log), _held_before_the_swap(monkeypatch)
    before = path.read_bytes()
    compactor.add(path.name)
    assert ready.wait(100)
    closing = threading.Thread(target=compactor.close, kwargs={"wait": False})
    closing.start()
    wait_until(compactor._abandoned.is_set)
    proceed.set()
    closing.join()

    assert [] == installed.calls
    assert [] == temporaries(log)
    assert before == path.read_bytes()


def test_without_a_thread_the_writer_goes_on(
    log: Path,
    compactor: BackgroundCompactor,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A machine that gives no more threads: said once a segment, nothing else."""

    def refuse(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refuse)
    compactor.add(segment_files(log)[0].name)
    compactor.close()

    assert "can't start new thread" in caplog.text


def test_closed_it_takes_nothing_more(log: Path, compactor: BackgroundCompactor) -> None:
    """Closing twice is no error; adding afterwards is one."""
    compactor.close()
    compactor.close()

    with pytest.raises(LogError, match="compactor was closed"):
        compactor.add(segment_files(log)[0].name)
