"""A mapped file whose bytes nobody looks at: the kernel copies them, and says where it cannot.

A look at a mapped page that the disk refuses, or that lies behind the end of a file which was cut
meanwhile, is no error but a signal that ends the process. A system call that meets such a page
stops there. So what is wanted is copied by one: `process_vm_readv` from the process to itself. It
needs no file descriptor, and no privilege.

Where that is not to be had (macOS; a sandbox that forbids it), the pages are asked for before they
are copied (MADV_POPULATE_READ, Linux 5.14), and a file that is cut in the instant between the two
still ends the process. Where that is not to be had either, nothing is asked: then so does a sector
that cannot be read.
"""

from __future__ import annotations

import ctypes
import errno
import mmap
import os
import sys
import weakref
from functools import cache
from typing import Any

import numpy as np

MOST_AT_ONCE = 2**19
"""Bytes asked of the disk in one call; a longer request the kernel cuts short."""

_MADV_POPULATE_READ = 22
_REFUSED = (errno.ENOSYS, errno.EPERM, errno.EACCES)
_FAILED = ctypes.c_void_p(-1).value


class MappedMemory:
    """A file that is mapped without a descriptor being kept; unmapped when nobody holds this.

    Python's own mmap keeps a descriptor for each (before 3.13), and a process may have 1,024: a log
    of five years has more segments.
    """

    __slots__ = ("__weakref__", "_address", "_size")

    def __init__(self, fd: int, size: int) -> None:
        """Map the first `size` bytes of a file, at least one.

        Raises:
            OSError: As the file system says.
        """
        library = _library()
        address = library.mmap(None, size, mmap.PROT_READ, mmap.MAP_SHARED, fd, 0)
        if address == _FAILED:
            raise _last_error()
        self._address: int = address
        self._size = size
        library.madvise(address, size, mmap.MADV_RANDOM)  # a moment reads a MiB of many
        weakref.finalize(self, library.munmap, address, size).atexit = False

    def copy(self, start: int, target: memoryview) -> int:
        """Copy bytes; return how many: fewer, where the next cannot be read.

        Args:
            start: Where they lie in the file.
            target: Filled with them; all of them lie in what was mapped.

        Raises:
            OSError: It is not the file: there is no memory, for one.
        """
        done, size = 0, len(target)
        address: int = np.frombuffer(target, np.uint8).ctypes.data
        while done < size:
            copied = _copy(self._address + start + done, size - done, address + done)
            if not copied:
                break
            done += copied
        return done

    def will_need(self, start: int, end: int) -> None:
        """Have the disk asked for bytes."""
        first = start // mmap.PAGESIZE * mmap.PAGESIZE
        end = min(end, self._size)
        for at in range(first, end, MOST_AT_ONCE):
            size = min(MOST_AT_ONCE, end - at)
            _library().madvise(self._address + at, size, mmap.MADV_WILLNEED)

    def let_go(self, start: int, end: int) -> None:
        """Give back the pages that lie within; the kernel counts what was copied as ours, too."""
        first = -(-start // mmap.PAGESIZE) * mmap.PAGESIZE
        size = end // mmap.PAGESIZE * mmap.PAGESIZE - first
        if size > 0:
            _library().madvise(self._address + first, size, mmap.MADV_DONTNEED)


class _Range(ctypes.Structure):
    """As `struct iovec`."""

    _fields_ = (("address", ctypes.c_void_p), ("size", ctypes.c_size_t))


def _copy(source: int, size: int, target: int) -> int:
    """Copy some of the bytes, from the first on; 0: the first cannot be read.

    Raises:
        OSError: As `MappedMemory.copy`.
    """
    call = _library().process_vm_readv
    if call is not None:
        ours, theirs = _Range(target, size), _Range(source, size)
        copied: int = call(os.getpid(), ctypes.byref(ours), 1, ctypes.byref(theirs), 1, 0)
        if copied >= 0:
            return copied
        if ctypes.get_errno() == errno.EFAULT:
            return 0
        if ctypes.get_errno() not in _REFUSED:
            raise _last_error()
    return _asked_copy(source, size, target)


def _asked_copy(source: int, size: int, target: int) -> int:
    """Do the same without the call that copies: ask for the pages, then copy them."""
    while not _are_there(source, size):
        in_page = mmap.PAGESIZE - source % mmap.PAGESIZE
        if size <= in_page:
            return 0
        size = max(in_page, size // 2)
    ctypes.memmove(target, source, size)
    return size


def _are_there(address: int, size: int) -> bool:
    """Tell whether pages can be read; where nobody can tell, that they can."""
    if not sys.platform.startswith("linux"):
        return True
    first = address // mmap.PAGESIZE * mmap.PAGESIZE
    failed = _library().madvise(first, address + size - first, _MADV_POPULATE_READ)
    return not failed or ctypes.get_errno() == errno.EINVAL  # a kernel that does not know it


def _last_error() -> OSError:
    number = ctypes.get_errno()
    return OSError(number, os.strerror(number))


class _Library:
    """What is used of the C library."""

    def __init__(self) -> None:
        library: Any = ctypes.CDLL(None, use_errno=True)
        word, size, number = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int
        self.mmap = library.mmap
        self.mmap.restype = word
        self.mmap.argtypes = [word, size, number, number, number, ctypes.c_long]
        self.munmap = library.munmap
        self.munmap.argtypes = [word, size]
        self.madvise = library.madvise
        self.madvise.argtypes = [word, size, number]
        self.process_vm_readv = getattr(library, "process_vm_readv", None)
        if self.process_vm_readv is not None:
            self.process_vm_readv.restype = ctypes.c_ssize_t
            self.process_vm_readv.argtypes = [
                number, word, ctypes.c_ulong, word, ctypes.c_ulong, ctypes.c_ulong,
            ]  # fmt: skip


@cache
def _library() -> _Library:
    return _Library()


@cache
def can_map() -> bool:
    """Tell whether files can be mapped by the C library: not on Windows."""
    try:
        _library()
    except (OSError, TypeError, AttributeError):
        return False
    return hasattr(mmap, "MAP_SHARED")
