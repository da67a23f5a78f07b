"""All bytes of a file as its place gives them, read by calls: zeros where it refuses.

A look at a mapped page that cannot be read would end the process. A file may be longer than memory
is, so only a window of it is kept.
"""

from __future__ import annotations

import mmap
from bisect import bisect_left
from pathlib import PurePath

from semmap_log.core.io.checksum import crc32
from semmap_log.store.verification.file_place import OpenedFile

WINDOW_BYTES = 2**22
"""So much is read at once."""


class Vanished(Exception):  # noqa: N818  # a turn of events, not an error: the caller begins anew
    """A file was replaced, shortened or removed since it was listed: a compaction is at work."""


class FileBytes:
    """A file that is sliced as if its bytes were in memory; what was sliced stays as it is."""

    def __init__(self, path: PurePath, file: OpenedFile) -> None:
        """Take a file.

        Args:
            path: Its name, for messages.
            file: Open as long as this is used; as many of its bytes count as it has now.
        """
        self._path = path
        self._file = file
        self._size = file.size
        self._start = 0
        self._window = memoryview(b"")
        self._bad: list[int] = []
        """Where each page begins that the disk refuses, ascending."""

    def __len__(self) -> int:
        return self._size

    def __getitem__(self, part: slice) -> memoryview:
        """Return some bytes, fewer where the file ends.

        Raises:
            Vanished: The file is shorter than it was.
        """
        start, end, _ = part.indices(self._size)
        if not self._start <= start <= end <= self._start + len(self._window):
            self._window = self._read(start, min(max(end, start + WINDOW_BYTES), self._size))
            self._start = start
        return self._window[start - self._start : max(start, end) - self._start]

    def try_all(self) -> None:
        """Ask the disk for every byte.

        Raises:
            Vanished: The file is shorter than it was.
        """
        for start in range(0, self._size, WINDOW_BYTES):
            self[start : start + WINDOW_BYTES]

    def crc_to(self, end: int) -> int:
        """Return the CRC-32 of all bytes before an offset."""
        crc = 0
        for start in range(0, end, WINDOW_BYTES):
            crc = crc32(self[start : min(start + WINDOW_BYTES, end)], crc)
        return crc

    @property
    def unreadable(self) -> list[tuple[int, int]]:
        """The (start, end) of what the disk refused so far."""
        found: list[tuple[int, int]] = []
        for start in self._bad:
            end = min(start + mmap.PAGESIZE, self._size)
            joined = bool(found) and found[-1][1] == start
            found[-1:] = [(found[-1][0], end)] if joined else [*found[-1:], (start, end)]
        return found

    def _read(self, start: int, end: int) -> memoryview:
        data = memoryview(bytearray(end - start))
        at = start
        while at < end:
            stop = self._next_bad(at, end)
            if stop == at:
                at = min(_next_page(at), end)
                continue
            try:
                at += self._read_some(data[at - start : stop - start], at)
            except OSError:
                page = at // mmap.PAGESIZE * mmap.PAGESIZE
                self._bad.insert(bisect_left(self._bad, page), page)
        return data.toreadonly()

    def _next_bad(self, at: int, end: int) -> int:
        """Return where the next page lies that is known to be bad; that offset, if it is in one."""
        place = bisect_left(self._bad, at // mmap.PAGESIZE * mmap.PAGESIZE)
        return min(max(self._bad[place], at), end) if place < len(self._bad) else end

    def _read_some(self, target: memoryview, at: int) -> int:
        got = self._file.read_into(target, at)
        if not got:
            raise Vanished(self._path)
        return got


def _next_page(at: int) -> int:
    return (at // mmap.PAGESIZE + 1) * mmap.PAGESIZE
