"""A file's bytes, mapped: they can be read when the file is replaced or removed meanwhile."""

from __future__ import annotations

import mmap
import os
import stat
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semmap_log.errors import LogAccessError, NotALogError, UnreadableLogError
from semmap_log.log.reading.byte_source import Identity
from semmap_log.log.reading.mapped_memory import MappedMemory


@dataclass(frozen=True, slots=True)
class MappedFile:
    """A file as it was when it was mapped: a `ByteSource`. It is copied from, never looked at."""

    path: Path
    """Under which it was opened, for messages."""
    size: int
    identity: Identity
    """Device and inode: the same for the same file under any name, another for its successor."""
    memory: MappedMemory | None
    """None for an empty file."""

    def read(self, start: int, end: int) -> memoryview:
        """Return a copy of a range; as `ByteSource.read`."""
        return self.read_ranges(((start, end),))

    def read_ranges(self, ranges: Sequence[tuple[int, int]]) -> memoryview:
        """Return copies of ranges, one behind the other; as `ByteSource.read_ranges`."""
        wanted = [(start, max(0, min(end, self.size) - start)) for start, end in ranges]
        copy = np.empty(sum(size for _, size in wanted), np.uint8)
        at: int = copy.__array_interface__["data"][0]
        for start, size in wanted:
            if size:
                self._copy(start, size, at)
                at += size
        self._check_end(max((start + size for start, size in wanted if size), default=0))
        return copy.data.toreadonly()

    def will_need(self, start: int, end: int) -> None:
        """Ask the disk for bytes that are read soon; nothing else is read ahead."""
        if self.memory is not None:
            self.memory.will_need(start, end)

    def let_go(self, start: int, end: int) -> None:
        """Give the memory back in which bytes that were read lie; they can be read again.

        The kernel keeps what was read of a mapped file on the process's account until then.
        """
        if self.memory is not None:
            self.memory.let_go(start, end)

    def _copy(self, start: int, size: int, target: int) -> None:
        assert self.memory is not None, "of an empty file no byte is wanted"
        if size > mmap.PAGESIZE:
            self.memory.will_need(start, start + size)  # else it comes page by page
        try:
            copied = self.memory.copy(start, size, target)
        except OSError as error:
            raise UnreadableLogError(self.path, start, f"{error.strerror}") from error
        if copied < size:
            at = start + copied
            raise UnreadableLogError(self.path, at, self._why_unreadable(at))

    def _check_end(self, end: int) -> None:
        """Check that the file still reaches to where the bytes end that were read.

        Behind the end of a file that was cut, the last page of it is full of zeros.
        """
        size = self._size_now()
        if size is not None and size < end:
            raise UnreadableLogError(self.path, size, self._shortened(size))

    def _why_unreadable(self, at: int) -> str:
        size = self._size_now()
        if size is not None and size <= at:
            return self._shortened(size)
        try:
            fd = os.open(self.path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
            try:
                if size is not None:
                    os.pread(fd, 1, at)
            finally:
                os.close(fd)
        except OSError as error:
            return f"{error.strerror}. To see what is damaged: semmap-log verify LOG."
        return "what was there when the file was opened is not there now, or for a moment was not"

    def _shortened(self, size: int) -> str:
        return f"the file had {self.size} bytes when it was opened, and was shortened to {size}"

    def _size_now(self) -> int | None:
        """Return how long the file is; None if it has another name now, or none."""
        try:
            status = self.path.stat()
        except OSError:
            return None
        is_same = (status.st_dev, status.st_ino) == self.identity
        return status.st_size if is_same else None


def map_file(path: Path) -> MappedFile:
    """Return a file's bytes as they are now, without keeping a file descriptor.

    Raises:
        NotALogError: It is no regular file.
        LogAccessError: It cannot be read; `FileNotFoundError` is its cause where it has gone.
    """
    try:
        fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except OSError as error:
        raise LogAccessError(f"{path}: cannot be read: {error.strerror}.") from error
    try:
        status = os.fstat(fd)
        if not stat.S_ISREG(status.st_mode):
            raise NotALogError(f"{path}: not a regular file.")
        memory = MappedMemory(fd, status.st_size) if status.st_size else None
        return MappedFile(path, status.st_size, (status.st_dev, status.st_ino), memory)
    except OSError as error:
        raise LogAccessError(f"{path}: cannot be read: {error.strerror}.") from error
    finally:
        os.close(fd)
