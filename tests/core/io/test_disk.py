"""Bytes to disk: whole or not at all, whatever the kernel takes of them at a time."""

from __future__ import annotations

import os
import signal
import threading
from pathlib import Path

import pytest

from semmap_log.core.io.disk import replace_file, write_all
from semmap_log.errors import LogAccessError
from semmap_log.store.folder import LogFolder
from semmap_log.store.lock import WriterLock


def test_what_the_kernel_takes_in_parts_is_written_whole() -> None:
    """A signal in the middle of a write to a slow pipe: the kernel says how much it took."""
    data = os.urandom(2**22)
    reading, writing = os.pipe()
    got = bytearray()

    def read_slowly() -> None:
        while block := os.read(reading, 2**14):
            got.extend(block)

    before = signal.signal(signal.SIGALRM, lambda *_: None)
    signal.setitimer(signal.ITIMER_REAL, 0.0005, 0.0005)
    reader = threading.Thread(target=read_slowly)
    reader.start()
    try:
        write_all(writing, data)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
        os.close(writing)
        reader.join()
        os.close(reading)

    assert data == got


def test_a_file_that_cannot_be_replaced_stays(tmp_path: Path) -> None:
    """And nothing temporary is left beside it."""
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "something").touch()

    with pytest.raises(OSError, match="folder"):
        replace_file(tmp_path / "folder", b"data")

    assert ["folder"] == [path.name for path in tmp_path.iterdir()]


def test_what_a_killed_writer_left_is_no_log(tmp_path: Path) -> None:
    """Its temporary files are removed by who has the lock; somebody else's are not."""
    (tmp_path / ".log_000000.mcap.123.tmp").touch()
    WriterLock(LogFolder(tmp_path)).release()
    assert LogFolder(tmp_path).is_empty()
    (tmp_path / ".notes.tmp").touch()
    assert not LogFolder(tmp_path).is_empty()

    LogFolder(tmp_path).remove_stale_files()

    assert [".lock", ".notes.tmp"] == sorted(path.name for path in tmp_path.iterdir())


def test_a_folder_that_is_a_file(tmp_path: Path) -> None:
    """No lock can be taken in it, and it is said."""
    (tmp_path / "file").touch()

    with pytest.raises(LogAccessError, match="cannot be opened for writing"):
        WriterLock(LogFolder(tmp_path / "file"))
