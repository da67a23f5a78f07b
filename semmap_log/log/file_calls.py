"""Reading an open file at a place, on every system."""

from __future__ import annotations

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
