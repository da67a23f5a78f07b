"""What reading asks of the system, as far as each one has it.

Windows knows neither folders that are opened nor links that are not followed, macOS no `preadv`:
what is missing is left out. Who writes needs all of it: `check_can_write`.
"""

from __future__ import annotations

import mmap
import os
from pathlib import Path

from semmap_log.errors import LogAccessError

NO_LINK = getattr(os, "O_NOFOLLOW", 0)
"""A link in the file's place is an error."""
PLAIN = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
"""A pipe in the file's place is not waited for, no child inherits it, no line end is changed."""
FOLDER = getattr(os, "O_DIRECTORY", 0)
CAN_OPEN_FOLDERS = bool(FOLDER)


def open_plainly(path: Path) -> int:
    """Return a descriptor of a file that is read; it may be a pipe or a device.

    Raises:
        OSError: As the system says.
    """
    return os.open(path, os.O_RDONLY | PLAIN)


_NEEDED = ("O_DIRECTORY", "O_NOFOLLOW", "O_CLOEXEC", "fdatasync", "link")
"""Of `os`, by whoever writes."""


def check_can_write(path: Path) -> None:
    """Return if this system has what keeps a log whole while it is written.

    Raises:
        LogAccessError: It has not; names what is missing.
    """
    from importlib.util import find_spec

    missing = ["fcntl (locks on files)"] if find_spec("fcntl") is None else []
    missing += [f"os.{name}" for name in _NEEDED if not hasattr(os, name)]
    if not os.supports_dir_fd:
        missing.append("dir_fd (folders that are held open)")
    if missing:
        raise LogAccessError(
            f"{path}: a log cannot be written on this system, which lacks {', '.join(missing)}. "
            "Reading works. To write, use Linux; on Windows: WSL."
        )


def read_into(fd: int, target: memoryview, at: int) -> int:
    """Read bytes of an open file from an offset on; return how many: 0 behind its end.

    Raises:
        OSError: As the kernel says.
    """
    if hasattr(os, "preadv"):  # not on macOS
        return os.preadv(fd, [target], at)
    if hasattr(os, "pread"):
        data = os.pread(fd, len(target), at)
    else:  # Windows; nobody else has this descriptor
        os.lseek(fd, at, os.SEEK_SET)
        data = os.read(fd, len(target))
    target[: len(data)] = data
    return len(data)


def read_page_into(fd: int, target: memoryview, at: int) -> int:
    """Read some bytes where reading more has failed, to the end of a page at most.

    Around a bad sector one read fails for all that the kernel fetches together.

    Raises:
        OSError: As the kernel says: that page cannot be read.
    """
    room = mmap.PAGESIZE - at % mmap.PAGESIZE
    if hasattr(os, "posix_fadvise"):  # not on macOS
        os.posix_fadvise(fd, at, len(target), os.POSIX_FADV_DONTNEED)
        os.posix_fadvise(fd, 0, 0, os.POSIX_FADV_RANDOM)
    return read_into(fd, target[:room], at)
