"""A file's bytes, mapped: they stay readable when the file is replaced or removed."""

from __future__ import annotations

import ctypes
import mmap
import os
import stat
import weakref
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from semmap_log.errors import LogAccessError, NotALogError
from semmap_log.log.folder import LogFolder

MOST_AT_ONCE = 2**19
"""Bytes asked of the disk in one call; a longer request the kernel cuts short."""


@dataclass(frozen=True, slots=True)
class MappedFile:
    """A file as it was when it was mapped."""

    data: memoryview
    identity: tuple[int, int]
    """Device and inode: the same for the same file under any name, another for its successor."""
    address: int = 0
    """Where its bytes lie in memory; 0 for an empty file."""

    def will_need(self, start: int, end: int) -> None:
        """Ask the disk for bytes that are read soon; nothing else is read ahead."""
        first = start // mmap.PAGESIZE * mmap.PAGESIZE
        for at in range(first, end, MOST_AT_ONCE) if self.address else ():
            size = min(MOST_AT_ONCE, end - at)
            _library().madvise(self.address + at, size, mmap.MADV_WILLNEED)

    def let_go(self, start: int, end: int) -> None:
        """Give the memory back in which bytes that were read lie; they stay readable.

        The kernel keeps what was read of a mapped file on the process's account until then.
        """
        first = -(-start // mmap.PAGESIZE) * mmap.PAGESIZE
        size = end // mmap.PAGESIZE * mmap.PAGESIZE - first
        if self.address and size > 0:
            _library().madvise(self.address + first, size, mmap.MADV_DONTNEED)


def map_file(path: Path, folder: LogFolder | None = None) -> MappedFile:
    """Return a file's bytes as they are now, without keeping a file descriptor.

    Args:
        path: The file, for messages.
        folder: Where it is found by its name; None: where its path says.

    Raises:
        NotALogError: It is no regular file.
        LogAccessError: It cannot be read; `FileNotFoundError` is its cause where it has gone.
    """
    try:
        fd = (folder or LogFolder(path.parent)).open_to_read(path.name)
    except OSError as error:
        raise LogAccessError(f"{path}: cannot be read: {error.strerror}.") from error
    try:
        status = os.fstat(fd)
        if not stat.S_ISREG(status.st_mode):
            raise NotALogError(f"{path}: not a regular file.")
        identity = (status.st_dev, status.st_ino)
        if not status.st_size:
            return MappedFile(memoryview(b""), identity)
        data, address = _map(fd, status.st_size)
        return MappedFile(data, identity, address)
    except OSError as error:
        raise LogAccessError(f"{path}: cannot be read: {error.strerror}.") from error
    finally:
        os.close(fd)


def _map(fd: int, size: int) -> tuple[memoryview, int]:
    """Map a file as the C library does; return its bytes, and where they lie in memory.

    Python's own mmap keeps a descriptor for each mapping (before 3.13), and a process may have
    1,024: a log of five years has more segments.
    """
    # A type for each power of two only, since Python never forgets one. What is mapped beyond the
    # file's end is address space, never looked at.
    room = 1 << (size - 1).bit_length()
    address = _library().mmap(None, room, mmap.PROT_READ, mmap.MAP_SHARED, fd, 0)
    if address == _FAILED:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    _library().madvise(address, room, mmap.MADV_RANDOM)  # a moment reads a MiB of many
    held = (ctypes.c_ubyte * room).from_address(address)
    # Every view of the bytes holds `held`: they are unmapped when the last one has gone.
    weakref.finalize(held, _library().munmap, address, room).atexit = False
    return memoryview(held).cast("B").toreadonly()[:size], address


_FAILED = ctypes.c_void_p(-1).value


@cache
def _library() -> Any:
    library = ctypes.CDLL(None, use_errno=True)
    library.mmap.restype = ctypes.c_void_p
    library.mmap.argtypes = [
        ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_long,
    ]  # fmt: skip
    library.munmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t]
    library.madvise.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
    return library
