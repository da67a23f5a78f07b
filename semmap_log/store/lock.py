"""One writer a log: advisory locks, taken before anything is opened for writing.

The folder itself is locked first, so that nobody can make room for a second writer by deleting
the lock file; then the lock file, which says who it is, and which every file system can lock.
It is emptied and written to, so it must be a file of this folder alone: neither a link to another
one nor another's second name.
"""

from __future__ import annotations

import errno
import os
import stat
from contextlib import suppress
from typing import Any

from semmap_log.errors import LogAccessError, LogLockedError
from semmap_log.store.folder import LogFolder
from semmap_log.store.form import LOCK_NAME

try:
    import fcntl
except ImportError:  # Windows: nobody writes there, `check_can_write`
    fcntl: Any = None  # type: ignore[no-redef]

_HOLDER_BYTES = 64
"""Of the lock file's text: the number of a process."""


class WriterLock:
    """Held until released or until the process ends, however it ends; the file may stay."""

    def __init__(self, folder: LogFolder) -> None:
        """Take the lock.

        Raises:
            LogLockedError: Another process, or another writer of this one, has it.
            LogAccessError: The folder cannot be written to, or its lock file is none.
        """
        self._pid = os.getpid()
        self._fds: list[int] = []
        try:
            self._lock_folder(folder)
            self._lock_file(folder)
        except BlockingIOError:
            self._let_go()
            raise LogLockedError(
                f"{folder.path}: {_holder(folder)} is writing to this log; a log has one "
                "writer at a time. Reading works; to write, stop that one first."
            ) from None
        except LogAccessError:
            self._let_go()
            raise
        except OSError as error:
            self._let_go()
            raise LogAccessError(
                f"{folder.path}: cannot be opened for writing: {error.strerror}. "
                "Reading works; to write, copy the log to a place of your own."
            ) from error
        self._tell(f"{self._pid}\n")

    def release(self) -> None:
        """Let the next writer in; in a forked child only let go of the files."""
        if not self._fds:
            return
        if os.getpid() == self._pid:
            self._tell("")
            for fd in reversed(self._fds):
                with suppress(OSError):
                    fcntl.flock(fd, fcntl.LOCK_UN)  # a child may still have the file open
        self._let_go()

    def _lock_folder(self, folder: LogFolder) -> None:
        """Lock the folder, on file systems that can (some servers of files cannot)."""
        self._fds.append(folder.open_itself())
        try:
            fcntl.flock(self._fds[-1], fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise
        except OSError:
            os.close(self._fds.pop())

    def _lock_file(self, folder: LogFolder) -> None:
        try:
            self._fds.append(folder.open(LOCK_NAME, os.O_RDWR | os.O_CREAT))
        except OSError as error:
            if error.errno in {errno.ELOOP, errno.ENXIO}:
                raise _no_lock_file(folder) from None
            raise
        status = os.fstat(self._fds[-1])
        if not stat.S_ISREG(status.st_mode) or status.st_nlink > 1:
            raise _no_lock_file(folder)
        fcntl.flock(self._fds[-1], fcntl.LOCK_EX | fcntl.LOCK_NB)

    def _let_go(self) -> None:
        while self._fds:
            os.close(self._fds.pop())

    def _tell(self, who: str) -> None:
        """Write who holds the lock: only for messages, so a full disk does not matter."""
        with suppress(OSError):
            os.ftruncate(self._fds[-1], 0)
            os.pwrite(self._fds[-1], who.encode(), 0)


def _no_lock_file(folder: LogFolder) -> LogAccessError:
    return LogAccessError(
        f"{folder / LOCK_NAME}: expected a file of this folder alone, got a link, or something "
        "else; nothing was written to it. If no writer is at work, remove it."
    )


def _holder(folder: LogFolder) -> str:
    """Return who has the lock, as far as the lock file tells."""
    try:
        holder = folder.read_bytes(LOCK_NAME, _HOLDER_BYTES).decode("ascii", "replace").strip()
    except OSError:
        holder = ""
    return f"process {holder}" if holder else "another process"
