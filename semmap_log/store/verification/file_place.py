"""Where the files of a verification are: on a disk, or another place that returns bytes.

All bytes of a file are read by calls, as its place returns them, with zeros where it refuses:
touching a mapped page that cannot be read would end the process. A file may be larger than memory,
so only a window of it is kept.
"""

from __future__ import annotations

import mmap
import os
import stat
from bisect import bisect_left
from collections.abc import Hashable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path, PurePath
from typing import Protocol

from semmap_log.core.io.checksum import crc32
from semmap_log.core.io.disk import open_plainly, read_into, read_page_into
from semmap_log.core.messages import BAG_METADATA_NAME
from semmap_log.errors import LogAccessError
from semmap_log.store.byte_layout import MOST_LIST_BYTES
from semmap_log.store.closed_mark import ClosedMark, read_mark
from semmap_log.store.folder import LogFolder
from semmap_log.store.manifest import ShippedSegment
from semmap_log.store.removed_part import RemovedPart, read_removed_part

WINDOW_BYTES = 2**22
"""So much is read at once."""


class Vanished(Exception):  # noqa: N818  # a turn of events, not an error: the caller begins again
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


class OpenedFile(Protocol):
    """A file, as long as it is open."""

    @property
    def size(self) -> int:
        """Bytes in all, when it was opened."""

    @property
    def identity(self) -> Hashable:
        """What distinguishes it from another file of its name."""

    @property
    def is_regular(self) -> bool:
        """Whether it is a file, no pipe or folder."""

    def read_into(self, target: memoryview, at: int) -> int:
        """Read bytes from an offset into `target`; return how many: 0 after the file's end.

        Raises:
            OSError: Those at the offset cannot be read.
        """


class FilePlace(Protocol):
    """The files of one log: nothing of what they say is believed."""

    @property
    def path(self) -> PurePath:
        """Where they lie, for messages; of a single segment its own."""

    def is_folder(self) -> bool:
        """Return whether it is a log's folder rather than a single file."""

    def files(self) -> Sequence[PurePath]:
        """Return all files there, below `path`.

        Raises:
            OSError: It cannot be listed.
        """

    def opened(self, file: PurePath) -> AbstractContextManager[OpenedFile]:
        """Open a file.

        Raises:
            FileNotFoundError: It is gone.
            OSError: It cannot be opened.
        """

    def flaws(self) -> Sequence[tuple[PurePath, str]]:
        """Return which of the files are not what was put there, and why, before they are read."""

    def differences(self, found: Sequence[ShippedSegment]) -> Sequence[tuple[PurePath, str]]:
        """Return in what the files that were read differ from what was put there.

        Args:
            found: What the closed segments say themselves; their SHA-256 is left out.
        """

    def mark(self) -> ClosedMark | None:
        """Return the content of the last mark, or None.

        Raises:
            CorruptLogError: It is not what was written.
        """

    def removed(self) -> RemovedPart | None:
        """Return which segments were removed from this place once they were shipped; None: none.

        Raises:
            CorruptLogError: What says so is not what was written.
        """

    def bag_metadata(self) -> str | None:
        """Return the text of metadata.yaml; nothing where there is none; None: none belongs there.

        Raises:
            LogAccessError: It cannot be read.
        """


class DiskFile:
    """An `OpenedFile` by its descriptor."""

    def __init__(self, fd: int) -> None:
        self._fd = fd
        status = os.fstat(fd)
        self.size = status.st_size
        self.identity = (status.st_dev, status.st_ino)
        self.is_regular = stat.S_ISREG(status.st_mode)

    def read_into(self, target: memoryview, at: int) -> int:
        """Read as much as the disk gives; as `OpenedFile.read_into`."""
        try:
            return read_into(self._fd, target, at)
        except OSError:
            return read_page_into(self._fd, target, at)


class DiskPlace:
    """A `FilePlace`: a folder, or one file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def is_folder(self) -> bool:
        """Return whether it is a folder now."""
        return self.path.is_dir()

    def files(self) -> list[PurePath]:
        """Return all that is in the folder."""
        return list(self.path.iterdir())

    @contextmanager
    def opened(self, file: PurePath) -> Iterator[OpenedFile]:
        """Open a file; as `FilePlace.opened`."""
        fd = open_plainly(Path(file))
        try:
            yield DiskFile(fd)
        finally:
            os.close(fd)

    def flaws(self) -> Sequence[tuple[PurePath, str]]:
        """Return none: a disk does not say what was put there."""
        return ()

    def differences(self, _found: Sequence[ShippedSegment]) -> Sequence[tuple[PurePath, str]]:
        """Return none, as `flaws`."""
        return ()

    def mark(self) -> ClosedMark | None:
        """Return what the last mark says; as `FilePlace.mark`."""
        return read_mark(LogFolder(self.path))

    def removed(self) -> RemovedPart | None:
        """Return what shipped.json says; as `FilePlace.removed`."""
        return read_removed_part(LogFolder(self.path))

    def bag_metadata(self) -> str:
        """Return the text of metadata.yaml; as `FilePlace.bag_metadata`."""
        try:
            data = LogFolder(self.path).read_bytes(BAG_METADATA_NAME, MOST_LIST_BYTES)
        except (FileNotFoundError, LogAccessError):  # or it is no regular file
            return ""
        except OSError as error:
            path = self.path / BAG_METADATA_NAME
            raise LogAccessError(f"{path}: cannot be read: {error.strerror}.") from error
        return data.decode(errors="replace")
