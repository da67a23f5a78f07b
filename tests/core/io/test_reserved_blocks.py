"""Blocks reserved behind a growing file: nobody sees them, and they are given back."""

from __future__ import annotations

import errno
import os
import shutil
from collections import namedtuple
from collections.abc import Iterator
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.io import reserved_blocks
from semmap_log.core.io.reserved_blocks import STEP_BYTES, ReservedBlocks

SYNCS = reserved_blocks._MANY_SYNCS


@pytest.fixture
def fd(tmp_path: Path) -> Iterator[int]:
    """A file of 100 bytes, on a file system that can reserve blocks."""
    fd = os.open(tmp_path / "file", os.O_RDWR | os.O_CREAT)
    os.write(fd, bytes(100))
    try:
        reserved_blocks.reserve(fd, 100, 1)
    except OSError as error:
        os.close(fd)
        pytest.skip(f"this file system reserves nothing: {error}")
    yield fd
    os.close(fd)


def _taken(fd: int) -> int:
    """Return how many bytes a file has on its disk."""
    return os.fstat(fd).st_blocks * 512


def test_they_are_had_and_given_back(fd: int) -> None:
    """From the eighth sync on, a step at a time; the size stays."""
    blocks = ReservedBlocks(fd)
    for _ in range(SYNCS - 1):
        blocks.synced(100)
    few = _taken(fd)
    blocks.synced(100)
    one = _taken(fd)
    blocks.synced(STEP_BYTES)
    two = _taken(fd)

    assert few < STEP_BYTES <= one < 2 * STEP_BYTES <= two
    assert 100 == os.fstat(fd).st_size
    blocks.release(100)
    assert few >= _taken(fd)
    assert bytes(100) == os.pread(fd, 200, 0)


def test_a_disk_that_is_nearly_full_keeps_its_blocks(
    fd: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is free then is for others, and for what is written."""
    room = namedtuple("room", ["f_bavail", "f_frsize"])  # noqa: PYI024 - as os.fstatvfs tells it
    monkeypatch.setattr(os, "fstatvfs", lambda _: room(10_000, 4096))
    blocks = ReservedBlocks(fd)
    before = _taken(fd)

    for _ in range(SYNCS):
        blocks.synced(100)

    assert before == _taken(fd)


def test_where_there_are_none_nothing_is_said() -> None:
    """A pipe has no blocks; a disk may know no reserving."""
    reading, writing = os.pipe()
    blocks = ReservedBlocks(writing)
    with pytest.raises(OSError, match=os.strerror(errno.ENOTTY)):
        reserved_blocks.reserve(writing, 0, 1)

    for _ in range(SYNCS):
        blocks.synced(0)
    blocks.release(0)

    os.write(writing, b"still there")
    assert b"still there" == os.read(reading, 20)
    os.close(reading)
    os.close(writing)


@pytest.mark.usefixtures("fd")  # or skip
def test_a_log_has_them_while_it_is_written(tmp_path: Path) -> None:
    """Readers and copies see the commits and nothing behind."""
    path = tmp_path / "log"
    log = sl.create(path, tz="UTC")
    door = log.add_door()
    for _ in range(SYNCS):
        log.observe(door, "open")
    live = path / "log_000000.mcap"
    assert live.stat().st_blocks * 512 >= STEP_BYTES
    assert SYNCS + 1 == sum(len(batch) for batch in sl.read(path).batches())
    killed = shutil.copytree(path, tmp_path / "killed") / live.name
    with killed.open("ab") as file:
        reserved_blocks.reserve(file.fileno(), killed.stat().st_size, STEP_BYTES)
    assert killed.stat().st_blocks * 512 >= STEP_BYTES

    log.close()
    sl.append(killed.parent).close()

    for closed in (live, killed):
        assert closed.stat().st_blocks * 512 < closed.stat().st_size + STEP_BYTES // 4
        assert SYNCS + 1 == sum(len(batch) for batch in sl.read(closed.parent).batches())
