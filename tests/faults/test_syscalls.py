"""Processes killed and calls that fail: the short forms of `tools/faults.py syscalls errors`."""

from __future__ import annotations

from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import LogAccessError
from semmap_log.log import reader
from tests.faults.running import faults, is_tried


def test_a_process_may_be_killed_at_any_call(tmp_path: Path) -> None:
    """
    Before each call on the folder, in half of a write, and again in the recovery.
    """
    said = faults("syscalls", 150, tmp_path)

    is_tried(said, at_least=150)


def test_any_call_may_fail(tmp_path: Path) -> None:
    """
    Once or for ever: the program is told, goes on, and what had failed is stored once or not.
    """
    said = faults("errors", 150, tmp_path)

    is_tried(said, at_least=150)


def test_a_log_that_could_not_be_opened_can_be_opened_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """
    Whichever reading of a segment fails on the way: the lock is not kept.
    """
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as log:
        log.add_door()
    real, failed = reader.open_segment, 0

    for good in range(10):
        left = iter(range(good))

        def failing(path: Path, left=left, **more: object):
            if next(left, None) is None:
                raise LogAccessError(f"{path}: cannot be read: Input/output error.")
            return real(path, **more)

        monkeypatch.setattr(reader, "open_segment", failing)
        try:
            sl.append(path).close()
        except LogAccessError:
            failed += 1
        monkeypatch.setattr(reader, "open_segment", real)
        sl.append(path).close()

    assert failed >= 2
