"""What is computed once holds no lock while it is: neither for other objects, nor in a child."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.store.reading import segment_scan

LONG_S = 20
"""Whoever waits longer waits for ever."""


@pytest.fixture
def logs(tmp_path: Path) -> list[Path]:
    """Two logs whose last segments are closed."""
    paths = [tmp_path / "one", tmp_path / "other"]
    for path in paths:
        with sl.create(path, tz="UTC", compact=False) as log:
            log.add_door()
    return paths


@contextmanager
def _summary_being_read(path: Path, patch: pytest.MonkeyPatch) -> Iterator[None]:
    """Have a thread stand in the middle of reading a log's summary."""
    is_there, may_go_on = threading.Event(), threading.Event()
    usual, mine = segment_scan.read_summary, path.name

    def read_summary(file: Path, *rest: object) -> object:
        if file.parent.name == mine and threading.current_thread() is reading:
            is_there.set()
            may_go_on.wait()
        return usual(file, *rest)  # type: ignore[arg-type]

    patch.setattr(segment_scan, "read_summary", read_summary)
    reading = threading.Thread(target=lambda: sl.read(path).replay())
    reading.start()
    try:
        assert is_there.wait(LONG_S)
        yield
    finally:
        may_go_on.set()
        reading.join()


def test_one_log_is_read_while_another_is_being_opened(
    logs: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Threads wait for nothing that belongs to other objects."""
    doors: list[int] = []
    other = threading.Thread(target=lambda: doors.append(len(sl.read(logs[1]).replay().doors)))
    with _summary_being_read(logs[0], monkeypatch):
        other.start()
        other.join(LONG_S)
        waited = other.is_alive()
    other.join()

    assert not waited
    assert [1] == doors


@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
def test_a_forked_child_reads_what_a_thread_was_reading(
    logs: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The thread is not in the child, and so nothing of it may be waited for."""
    with _summary_being_read(logs[0], monkeypatch):
        child = os.fork()
        if not child:
            signal.alarm(LONG_S)
            try:
                os._exit(len(sl.read(logs[0]).replay().doors))
            finally:
                os._exit(99)
        _, status = os.waitpid(child, 0)

    assert 1 == os.waitstatus_to_exitcode(status)
