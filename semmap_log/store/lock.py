"""One writer a log: a lock that only a writer can take, before anything is opened for writing.

The lock is flock on `.lock`, which every file system has. Whoever may read a file may lock it, so
only users who may write this one may read it: it is made with mode 0600. One that an older version
has made readable for everybody is replaced by one that is not.

The folder is locked as well, where possible: so an older version is refused at once, and deleting
the lock file does not admit a second writer. Everybody may read, and so lock, a folder. A stranger
who does so keeps no writer out.

The lock file is emptied and written to, so it must be a file of this folder alone: neither a link
to another file nor a second name of one.
"""

from __future__ import annotations

import errno
import os
import stat
from contextlib import suppress
from typing import Any

from semmap_log.core.io.lock_holders import is_held_by_strangers
from semmap_log.errors import LogAccessError, LogLockedError
from semmap_log.store.byte_layout import LOCK_NAME, NEW_LOCK_NAME
from semmap_log.store.folder import LogFolder

try:
    import fcntl
except ImportError:  # Windows: nobody writes there, `check_can_write`
    fcntl: Any = None  # type: ignore[no-redef]

_HOLDER_BYTES = 64
"""Of the lock file's text: the number of a process."""
_PRIVATE = 0o600
_GROUP_AND_OTHERS_READ, _GROUP_AND_OTHERS_WRITE = 0o044, 0o022


class WriterLock:
    """Held until released or until the process ends, however it ends; the file may stay."""

    def __init__(self, folder: LogFolder) -> None:
        """Take the lock.

        Raises:
            LogLockedError: Another process, or another writer of this one, has it.
            LogAccessError: The folder cannot be written to, or its lock file is not one.
        """
        self._pid = os.getpid()
        self._fds: list[int] = []
        self._file = -1
        """The lock file, among these."""
        self._remedy = ""
        try:
            is_new = self._lock_file(folder)
            self._lock_folder(folder, is_new=is_new)
        except BlockingIOError:
            holder = _holder(folder)
            self._release()
            raise LogLockedError(
                f"{folder.path}: {holder} is writing to this log; a log has one writer at a time. "
                f"Reading works; to write, stop that one first.{self._remedy}"
            ) from None
        except LogAccessError:
            self._release()
            raise
        except OSError as error:
            self._release()
            raise LogAccessError(
                f"{folder.path}: cannot be opened for writing: {error.strerror}. "
                "Reading works; to write, copy the log to a place of your own."
            ) from error
        self._tell(f"{self._pid}\n")

    def release(self) -> None:
        """Let the next writer in; in a forked child only close the files."""
        if not self._fds:
            return
        if os.getpid() == self._pid:
            self._tell("")
            for fd in reversed(self._fds):
                with suppress(OSError):
                    fcntl.flock(fd, fcntl.LOCK_UN)  # a child may still have the file open
        self._release()

    def _lock_file(self, folder: LogFolder) -> bool:
        """Lock the lock file; return whether it was made now.

        Raises:
            BlockingIOError: Somebody else has it.
        """
        fd, is_new = self._opened(folder)
        status = _checked(fd, folder, LOCK_NAME)
        is_ours, is_public = _try_lock(fd), _is_public(status.st_mode)
        if not is_ours and not (is_public and self._is_strangers(fd, folder)):
            raise BlockingIOError
        if not folder.is_there(LOCK_NAME, fd):  # exchanged since it was opened: by another writer
            raise BlockingIOError
        if is_public and not self._make_private(folder, fd, status) and not is_ours:
            raise BlockingIOError
        return is_new

    def _opened(self, folder: LogFolder) -> tuple[int, bool]:
        try:
            fd, is_new = folder.open(LOCK_NAME, os.O_RDWR | os.O_CREAT | os.O_EXCL, _PRIVATE), True
        except FileExistsError:
            fd, is_new = _opened_there(folder, LOCK_NAME), False
        self._fds.append(fd)
        self._file = fd
        return fd, is_new

    def _is_strangers(self, fd: int, folder: LogFolder) -> bool:
        """Return whether strangers have locked a lock file that they can read."""
        at = folder.open_itself()
        try:
            is_strangers = is_held_by_strangers(fd, at)
        finally:
            os.close(at)
        if is_strangers is None:
            self._remedy = (
                f" If nobody writes: another user who can read {folder / LOCK_NAME} may hold the "
                "lock; remove that file, and the next one will be readable for its owner only."
            )
        return bool(is_strangers)

    def _make_private(self, folder: LogFolder, old: int, status: os.stat_result) -> bool:
        """Put a lock file that strangers cannot read in the place of one that they can.

        On success both are held. Return whether the old one's owner and the file system allow it.

        Raises:
            BlockingIOError: Another process is about to do so.
        """
        new = _opened_there(folder, NEW_LOCK_NAME)
        self._fds.append(new)
        _checked(new, folder, NEW_LOCK_NAME)
        if not _try_lock(new) or not folder.is_there(NEW_LOCK_NAME, new):
            raise BlockingIOError
        can_be = _takes_after(new, status)
        if can_be and folder.is_there(LOCK_NAME, old):
            folder.put(NEW_LOCK_NAME, LOCK_NAME)
            self._file = new
            return True
        folder.remove(NEW_LOCK_NAME)
        if can_be:
            raise BlockingIOError
        return False

    def _lock_folder(self, folder: LogFolder, *, is_new: bool) -> None:
        """Lock the folder, if no stranger has, on file systems that can (some servers cannot).

        Args:
            folder: The folder.
            is_new: Whether there was no lock file: then it may be that of who holds the folder.

        Raises:
            BlockingIOError: A writer has it.
        """
        fd = folder.open_itself()
        self._fds.append(fd)
        try:
            if _try_lock(fd):
                return
        except OSError:
            self._close(fd)
            return
        is_strangers = is_held_by_strangers(fd, fd)
        if is_strangers or (is_strangers is None and not is_new):
            self._close(fd)
            return
        if is_new:
            folder.remove(LOCK_NAME)
        if is_strangers is None:
            self._remedy = (
                f" If nobody writes: another user who can read {folder.path} may hold the lock "
                f"while there is no lock file; make an empty {folder / LOCK_NAME}."
            )
        raise BlockingIOError

    def _close(self, fd: int) -> None:
        self._fds.remove(fd)
        os.close(fd)

    def _release(self) -> None:
        while self._fds:
            os.close(self._fds.pop())

    def _tell(self, who: str) -> None:
        """Write who holds the lock: only for messages, so a full disk does not matter."""
        with suppress(OSError):
            os.ftruncate(self._file, 0)
            os.pwrite(self._file, who.encode(), 0)


def _opened_there(folder: LogFolder, name: str) -> int:
    """Return a descriptor of a lock file that is there, or is made."""
    try:
        return folder.open(name, os.O_RDWR | os.O_CREAT, _PRIVATE)
    except OSError as error:
        if error.errno in {errno.ELOOP, errno.ENXIO}:
            raise _no_lock_file(folder, name) from None
        raise


def _checked(fd: int, folder: LogFolder, name: str) -> os.stat_result:
    """Return the status of a lock file, which is a file of this folder alone."""
    status = os.fstat(fd)
    if not stat.S_ISREG(status.st_mode) or status.st_nlink > 1:
        raise _no_lock_file(folder, name)
    return status


def _no_lock_file(folder: LogFolder, name: str) -> LogAccessError:
    return LogAccessError(
        f"{folder / name}: expected a file of this folder alone, got a link, or something "
        "else; nothing was written to it. If no writer is at work, remove it."
    )


def _try_lock(fd: int) -> bool:
    """Lock a file or folder, unless another process has; return whether it is ours now."""
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _is_public(mode: int) -> bool:
    """Return whether a file can be read by a user who may not write it."""
    return bool(mode & _GROUP_AND_OTHERS_READ & ~_private(mode))


def _private(mode: int) -> int:
    """Return a mode that lets the same users write, and no others read."""
    writers = mode & _GROUP_AND_OTHERS_WRITE
    return _PRIVATE | writers | writers << 1


def _takes_after(fd: int, old: os.stat_result) -> bool:
    """Give a new lock file the old one's writers, and no other readers, if that is possible.

    Args:
        fd: The new one.
        old: Status of the old one.
    """
    gid = old.st_gid if old.st_mode & _GROUP_AND_OTHERS_WRITE else -1
    made = os.fstat(fd)
    try:
        if made.st_uid != old.st_uid or gid not in (-1, made.st_gid):
            os.fchown(fd, old.st_uid, gid)
        os.fchmod(fd, _private(old.st_mode))
    except OSError:
        return False
    return not _is_public(os.fstat(fd).st_mode)


def _holder(folder: LogFolder) -> str:
    """Return who holds the lock, as far as the lock file shows."""
    try:
        holder = folder.read_bytes(LOCK_NAME, _HOLDER_BYTES).decode("ascii", "replace").strip()
    except OSError:
        holder = ""
    return f"process {holder}" if holder else "another process"
