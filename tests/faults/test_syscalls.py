"""Processes killed, calls that fail, limits met: short forms of `tools/faults.py`."""

from __future__ import annotations

import errno
import os
import threading
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import LogAccessError, LogPoisonedError
from semmap_log.store.compaction import background
from semmap_log.store.reading import segment_folder
from semmap_log.store.segment import SegmentWriter
from semmap_log.store.writing import segment_chain
from tests.faults.running import faults, is_tried


@pytest.mark.slow
def test_a_process_may_be_killed_at_any_call(tmp_path: Path) -> None:
    """Before each call on the folder, in half of a write, and again in the recovery."""
    said = faults("syscalls", 60, tmp_path)

    is_tried(said, at_least=60)


@pytest.mark.slow
def test_any_call_may_fail(tmp_path: Path) -> None:
    """Once or for ever: the program is told, goes on, and what had failed is stored once or not."""
    said = faults("errors", 60, tmp_path)

    is_tried(said, at_least=60)


@pytest.mark.slow
def test_limits_of_the_machine_are_met_and_lifted(tmp_path: Path) -> None:
    """A full disk, a file too large, no more files; read-only and not ours: read, never written."""
    said = faults("limits", 9, tmp_path)

    is_tried(said, at_least=9)


def test_a_log_that_could_not_be_opened_can_be_opened_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whichever reading of a segment fails on the way: the lock is not kept."""
    path = tmp_path / "log"
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 1)
    with sl.create(path, tz="UTC", compact=False) as log:
        for _ in range(2):
            log.add_door()
    real, failed = segment_folder.segment_in, 0

    for good in range(10):
        left = iter(range(good))

        def failing(path: Path, *how: object, left=left, **more: object):
            if next(left, None) is None:
                raise LogAccessError(f"{path}: cannot be read: Input/output error.")
            return real(path, *how, **more)

        monkeypatch.setattr(segment_folder, "segment_in", failing)
        try:
            sl.append(path, compact=False).close()
        except LogAccessError:
            failed += 1
        monkeypatch.setattr(segment_folder, "segment_in", real)
        sl.append(path, compact=False).close()

    assert failed >= 2


def test_a_close_that_fails_ends_the_background_thread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The next writer must not meet it at work: both would write the same temporary file."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 30)
    monkeypatch.setattr(background, "PAUSE_S", 0.02)
    log = sl.create(tmp_path / "log", tz="UTC")
    for _ in range(31):
        log.add_door()

    def full(self: SegmentWriter) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(SegmentWriter, "close", full)
        with pytest.raises(LogPoisonedError, match="No space left"):
            log.close()

    assert [] == [t.name for t in threading.enumerate() if "compaction" in t.name]
