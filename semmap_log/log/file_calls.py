"""Reading an open file at a place, on every system."""

from __future__ import annotations

import mmap
import os


def read_into(fd: int, target: memoryview, at: int) -> int:
    """Read bytes of an open file from an offset on; return how many: 0 behind its end.

    Raises:
        OSError: As the kernel says.
    """
    if hasattr(os, "preadv"):  # not on macOS
        return os.preadv(fd, [target], at)
    data = os.pread(fd, len(target), at)
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
