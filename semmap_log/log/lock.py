"""One writer a log: an advisory lock on a file of its own, taken before anything else is opened."""

from __future__ import annotations

import fcntl
import os
from contextlib import suppress
from pathlib import Path

from semmap_log.errors import LogAccessError, LogLockedError
from semmap_log.log.form import LOCK_NAME


class WriterLock:
    """Held until released or until the process ends, however it ends; the file may stay."""

    def __init__(self, folder: Path) -> None:
        """Take the lock.

        Raises:
            LogLockedError: Another process, or another writer of this one, has it.
            LogAccessError: The folder cannot be written to.
        """
        path = folder / LOCK_NAME
        try:
            self._fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise LogAccessError(
                f"{folder}: cannot be opened for writing: {error.strerror}. "
                "Reading works; to write, copy the log to a place of your own."
            ) from error
        try:
            fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            holder = os.pread(self._fd, 32, 0).decode("ascii", "replace").strip()
            os.close(self._fd)
            who = f"process {holder}" if holder else "another process"
            raise LogLockedError(
                f"{folder}: {who} is writing to this log; a log has one writer at a time. "
                "Reading works; to write, stop that one first."
            ) from None
        self._pid = os.getpid()
        self._tell(f"{self._pid}\n")

    def release(self) -> None:
        """Let the next writer in; in a forked child only let go of the file."""
        if self._fd < 0:
            return
        if os.getpid() == self._pid:
            self._tell("")
            fcntl.flock(self._fd, fcntl.LOCK_UN)  # a child may still have the file open
        os.close(self._fd)
        self._fd = -1

    def _tell(self, who: str) -> None:
        """Write who holds the lock: only for messages, so a full disk does not matter."""
        with suppress(OSError):
            os.ftruncate(self._fd, 0)
            os.pwrite(self._fd, who.encode(), 0)
