"""Small files of a log, or near one, that are huge: no more is read than may be in them."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.io.checked_file import read_checked, write_checked
from semmap_log.errors import CheckpointError, CorruptLogError, LogLockedError, NotALogError
from semmap_log.log.replay.maintenance import verify
from semmap_log.store.byte_layout import LOCK_NAME, REMOVED_NAME
from tests.log.replay.projections import Numbers

TERABYTE = 2**40


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """
    A closed log of one door.
    """
    with sl.create(tmp_path / "log", tz="UTC") as log:
        log.add_door(x=1.0, y=2.0, theta=0.0, width=0.9, name="front")
    return tmp_path / "log"


def _huge(path: Path, begin: str = "") -> Path:
    """
    A file that begins like that and has a terabyte, in which nothing else is.
    """
    path.write_text(begin, encoding="utf-8")
    os.truncate(path, TERABYTE)
    return path


def _append(log: Path) -> None:
    with sl.append(log):
        _huge(log / LOCK_NAME, "4711 ")
        sl.append(log)


def _replay(log: Path) -> None:
    _huge(log / REMOVED_NAME)
    sl.read(log).replay()


def _checkpoint(log: Path) -> None:
    sl.read(log).fold(Numbers(), checkpoint=_huge(log.parent / "checkpoint"))


def _join(log: Path) -> None:
    sl.read(_huge(log.parent / "building.join.json", "{}"))


@pytest.mark.parametrize(
    ("ask", "error", "said"),
    [
        (_append, LogLockedError, "process 4711"),
        (_replay, CorruptLogError, REMOVED_NAME),
        (_checkpoint, CheckpointError, "expected at most"),
        (_join, NotALogError, "expected at most"),
    ],
)
def test_a_huge_file_is_an_error(
    log: Path, ask: Callable[[Path], None], error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        ask(log)


def test_a_huge_metadata_yaml_hides_nothing(log: Path) -> None:
    """It is a cache, of which the beginning counts."""
    text = (log / "metadata.yaml").read_text(encoding="utf-8")
    _huge(log / "metadata.yaml", text)

    assert 1 == len(sl.read(log).replay().doors)
    assert 0 == verify(log).exit_code
    with sl.append(log) as writer:
        writer.observe("front", "open")

    assert (log / "metadata.yaml").stat().st_size < TERABYTE


def test_a_huge_kept_answer_is_none(tmp_path: Path) -> None:
    path = tmp_path / "x.answer"
    write_checked(path, b"1234")

    assert b"1234" == read_checked(path, 4)
    os.truncate(path, TERABYTE)
    assert read_checked(path, 4) is None
    assert not path.exists()
