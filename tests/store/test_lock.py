"""The lock of a log's writer: who may write is kept out by it, and nobody else keeps it."""

from __future__ import annotations

import errno
import fcntl
import os
import struct
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import LogAccessError, LogLockedError
from semmap_log.store.folder import LogFolder
from semmap_log.store.lock import WriterLock
from tests.other_process import NOBODY, only_root, other_process

F_OFD_SETLK = 37


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "log"
    with sl.create(path, tz="UTC") as made:
        made.add_door()
    return path


def _lock(name: str, how: int = fcntl.LOCK_EX, flags: int = os.O_RDONLY) -> int:
    fd = os.open(name, flags, 0o644)
    fcntl.flock(fd, how | fcntl.LOCK_NB)
    return fd


def _lock_folder() -> int:
    return _lock(".")


def _lock_both() -> list[int]:
    return [_lock("."), _lock(".lock")]


def _share_both() -> list[int]:
    return [_lock(".", fcntl.LOCK_SH), _lock(".lock", fcntl.LOCK_SH)]


def _read_lock() -> int:
    """Take the read lock of fcntl, which needs no right to write, and keeps all write locks out."""
    fd = os.open(".lock", os.O_RDONLY)
    fcntl.fcntl(fd, F_OFD_SETLK, struct.pack("hhqqi4x", fcntl.F_RDLCK, os.SEEK_SET, 0, 0, 0))
    return fd


def _write_as_older_versions() -> list[int]:
    return [_lock("."), _lock(".lock", flags=os.O_RDWR | os.O_CREAT)]


def _mode(log: Path) -> int:
    return (log / ".lock").stat().st_mode & 0o777


def _is_refused(log: Path) -> bool:
    try:
        WriterLock(LogFolder(log)).release()
    except LogLockedError:
        return True
    return False


def _names(log: Path) -> set[str]:
    return {path.name for path in log.iterdir()}


@only_root
@pytest.mark.parametrize("ends", [False, True], ids=["holder lives", "holder left it to a child"])
def test_a_stranger_who_locks_the_folder_keeps_nobody_out(log: Path, ends: bool) -> None:
    """They may read the log, so they may lock its folder; the lock file they cannot even open."""

    def lock() -> int:
        with pytest.raises(PermissionError):
            os.open(".lock", os.O_RDONLY)
        return _lock_folder()

    with other_process(lock, log, uid=NOBODY, leaves=ends), sl.append(log) as writer:
        writer.add_door()
        assert _is_refused(log)
        with pytest.raises(LogLockedError, match=f"process {os.getpid()} is writing"):
            sl.append(log)

    assert 2 == len(sl.read(log).replay())


@only_root
@pytest.mark.parametrize("lock", [_lock_both, _share_both, _read_lock])
def test_a_lock_file_that_everybody_can_read_is_replaced(
    log: Path, lock: Callable[[], object]
) -> None:
    """As an older version made it; a stranger has it locked now, and still has it open later."""
    (log / ".lock").chmod(0o644)
    before = _names(log)

    with other_process(lock, log, uid=NOBODY):
        with sl.append(log) as writer:
            writer.add_door()
            assert _is_refused(log)
        sl.append(log).close()

    assert 0o600 == _mode(log)
    assert before <= _names(log)
    assert ".lock.tmp" not in _names(log)


@only_root
def test_a_stranger_who_locks_a_folder_without_a_lock_file(log: Path) -> None:
    """As a copy is, or a log out of an archive: who holds the folder can be seen."""
    (log / ".lock").unlink()

    with other_process(_lock_folder, log, uid=NOBODY):
        sl.append(log).close()

    assert 0o600 == _mode(log)


@only_root
def test_who_has_locked_the_folder_cannot_be_seen(log: Path) -> None:
    """Without a lock file it may be the writer whose lock file was deleted: what to do is told."""
    (log / ".lock").unlink()
    before = _names(log)

    with other_process(_lock_folder, log, uid=NOBODY, leaves=True):
        for _ in range(2):
            with pytest.raises(LogLockedError, match=r"If nobody writes: .* make"):
                sl.append(log)
        assert before == _names(log)
        (log / ".lock").touch()
        sl.append(log).close()

    assert 0o600 == _mode(log)


@only_root
def test_who_has_locked_a_file_that_all_can_read_cannot_be_seen(log: Path) -> None:
    """It may be a writer of an older version: what to do is told."""
    (log / ".lock").chmod(0o644)

    with other_process(_lock_both, log, uid=NOBODY, leaves=True):
        with pytest.raises(LogLockedError, match=r"If nobody writes: .* remove"):
            sl.append(log)
        (log / ".lock").unlink()
        with pytest.raises(LogLockedError, match="make an empty"):
            sl.append(log)
        (log / ".lock").touch()
        sl.append(log).close()


@pytest.mark.parametrize("mode", [0o600, 0o644])
def test_a_writer_of_an_older_version_keeps_us_out(log: Path, mode: int) -> None:
    """It locks the folder and then the lock file; as whom it runs does not matter."""
    (log / ".lock").chmod(mode)
    before = (log / ".lock").stat()

    with other_process(_write_as_older_versions, log):
        assert _is_refused(log)

    after = (log / ".lock").stat()
    assert (before.st_ino, before.st_mode) == (after.st_ino, after.st_mode)
    sl.append(log).close()


def test_a_writer_of_an_older_version_that_has_only_the_folder_keeps_us_out(log: Path) -> None:
    """It is about to lock the lock file; or that was deleted, and made again by somebody."""
    with other_process(_lock_folder, log):
        assert _is_refused(log)
    assert not _is_refused(log)


@only_root
@pytest.mark.parametrize("is_attacked", [False, True])
def test_a_writer_keeps_older_versions_out(log: Path, is_attacked: bool) -> None:
    """Both of their locks are taken, or the second where a stranger has the first."""

    def free(name: str, flags: int) -> bool:
        try:
            os.close(_lock(name, flags=flags))
        except BlockingIOError:
            return False
        return True

    def try_as_older_versions() -> None:
        assert not free(f"{log}", os.O_RDONLY)
        assert not free(f"{log}/.lock", os.O_RDWR)

    (log / ".lock").chmod(0o644)
    if is_attacked:
        with other_process(_lock_both, log, uid=NOBODY), sl.append(log):
            try_as_older_versions()
    else:
        with sl.append(log):
            try_as_older_versions()
    assert free(f"{log}", os.O_RDONLY)
    assert free(f"{log}/.lock", os.O_RDWR)


@only_root
def test_a_replaced_lock_file_keeps_its_owner(log: Path) -> None:
    """Root may write to a robot's log; afterwards the robot still can, and so can its group."""
    for mode, expected in ((0o644, 0o600), (0o664, 0o660), (0o666, 0o666)):
        os.chown(log / ".lock", 4321, 8765)
        (log / ".lock").chmod(mode)

        sl.append(log).close()

        status = (log / ".lock").stat()
        assert (4321, expected) == (status.st_uid, _mode(log))
        assert mode == 0o644 or status.st_gid == 8765


@only_root
def test_a_lock_file_of_somebody_else(log: Path) -> None:
    """A group writes the log, and the lock file is another member's: it stays as it is."""
    for path in (log, *log.iterdir()):
        os.chown(path, 4321, NOBODY)
        path.chmod(0o775 if path == log else 0o664)

    with other_process(lambda: WriterLock(LogFolder.held(Path())), log, uid=NOBODY):
        assert _is_refused(log)

    assert 0o664 == _mode(log)
    assert ".lock.tmp" not in _names(log)


@pytest.mark.parametrize("link", [os.link, os.symlink])
def test_the_new_lock_file_is_no_link(
    log: Path, tmp_path: Path, link: Callable[[Path, Path], None]
) -> None:
    """A folder may come from a stranger: no file outside of it gets another owner, mode or text."""
    victim = tmp_path / "victim"
    victim.write_text("precious")
    victim.chmod(0o644)
    before = victim.stat()
    link(victim, log / ".lock.tmp")
    (log / ".lock").chmod(0o644)

    with pytest.raises(LogAccessError, match=r"\.lock\.tmp"):
        sl.append(log)

    assert "precious" == victim.read_text()
    assert before.st_mode == victim.stat().st_mode


def test_two_that_replace_a_lock_file_at_once(log: Path) -> None:
    """The second is refused, whether the first is at it, or done."""
    (log / ".lock").chmod(0o644)

    with other_process(lambda: _lock(".lock.tmp", flags=os.O_RDWR | os.O_CREAT), log):
        assert _is_refused(log)

    assert not _is_refused(log)
    assert 0o600 == _mode(log)


def test_a_lock_file_that_was_exchanged_since_it_was_opened(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its name is another file's now, which another writer has."""
    real = LogFolder.open

    def late(self: LogFolder, name: str, flags: int, mode: int = 0o644) -> int:
        fd = real(self, name, flags, mode)
        if name == ".lock":
            (log / "other").touch(0o600)
            (log / "other").rename(log / ".lock")
        return fd

    monkeypatch.setattr(LogFolder, "open", late)

    assert _is_refused(log)


def test_a_file_system_where_all_can_read_all(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Such as FAT: the lock file is locked as it is, and nothing is left beside it."""
    (log / ".lock").chmod(0o644)

    def fixed(fd: int, mode: int) -> None:
        raise OSError(errno.EPERM, "no modes here")

    monkeypatch.setattr(os, "fchmod", fixed)
    lock = WriterLock(LogFolder(log))
    assert _is_refused(log)
    lock.release()
    assert not _is_refused(log)
    assert 0o644 == _mode(log)
    assert ".lock.tmp" not in _names(log)


@only_root
def test_one_writer_whatever_a_stranger_locks(log: Path) -> None:
    """Four threads open and close while a stranger locks what can be opened."""
    inside, most = 0, 0
    counting = threading.Lock()

    def write(times: int = 25) -> None:
        nonlocal inside, most
        while times:
            try:
                lock = WriterLock(LogFolder(log))
            except LogLockedError:
                continue
            with counting:
                inside += 1
                most = max(most, inside)
            (log / ".lock").chmod(0o644)
            with counting:
                inside -= 1
            lock.release()
            times -= 1

    with other_process(_lock_both_again_and_again, log, uid=NOBODY):
        threads = [threading.Thread(target=write) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    assert 1 == most


def _lock_both_again_and_again() -> None:
    """Go on in a thread of its own."""

    def proceed() -> None:
        held: list[int] = []
        while True:
            for name in (".", ".lock"):
                with suppress(OSError):
                    held.append(_lock(name))
            while len(held) > 1:
                os.close(held.pop(0))

    threading.Thread(target=proceed, daemon=True).start()
