"""A file's bytes, mapped: they can be read even if the file is replaced or removed meanwhile.

The mapped bytes are never touched directly: the kernel copies them, and reports where it cannot.
Touching a mapped page that the disk refuses, or that lies past the end of a file that was cut
meanwhile, raises no error but a signal that ends the process. A system call that meets such a page
stops there. So the bytes are copied by one: `process_vm_readv` from the process to itself. It needs
no file descriptor and no privilege.

Where that call is not available (macOS; a sandbox that forbids it), the pages are populated before
they are copied (MADV_POPULATE_READ, Linux 5.14), and a file that is cut in the instant between the
two still ends the process. Where that is not available either, nothing is checked: then a sector
that cannot be read also ends the process.
"""

from __future__ import annotations

import ctypes
import errno
import mmap
import os
import stat
import sys
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from semmap_log.core.io.byte_source import Identity
from semmap_log.core.io.disk import read_into, read_page_into
from semmap_log.core.texts import command_line
from semmap_log.errors import LogAccessError, NotALogError, UnreadableLogError
from semmap_log.store.folder import LogFolder


@dataclass(frozen=True, slots=True)
class MappedFile:
    """A file as it was when it was mapped: a `ByteSource`. No mapped byte is ever looked at.

    While the file has the name under which it was opened, it is opened by that again and read: the
    system says then what it cannot give, and why. Once it was replaced, renamed or removed, its
    bytes are copied from the mapping, which keeps them.
    """

    path: Path
    """For messages."""
    folder: LogFolder
    """In which it was opened, under its name."""
    size: int
    identity: Identity
    """Device and inode: the same for the same file under any name, another for its successor."""
    memory: MappedMemory | None
    """None for an empty file, and where files cannot be mapped: then it is read by its name alone,
    and what another file has taken the name of is gone."""

    @property
    def is_guarded(self) -> bool:
        """Whether it is still read by its name: in a mapping the last page ends in zeros."""
        fd = self._reopened()
        if fd is not None:
            os.close(fd)
        return fd is not None

    def read(self, start: int, end: int) -> memoryview:
        """Return a copy of a range; as `ByteSource.read`."""
        return self._read_all(((start, max(0, min(end, self.size) - start)),))

    def read_ranges(self, ranges: Sequence[tuple[int, int]]) -> memoryview:
        """Return copies of ranges, concatenated; as `ByteSource.read_ranges`."""
        return self._read_all([(a, max(0, min(b, self.size) - a)) for a, b in ranges])

    def _read_all(self, wanted: Sequence[tuple[int, int]]) -> memoryview:
        """Return copies of what begins at each offset and has that size."""
        # Not a bytearray, which would be filled with zeros first.
        copy = np.empty(sum([size for _, size in wanted]), np.uint8).data
        if not copy:
            return copy
        fd, at = self._reopened(), 0
        try:
            for start, size in wanted:
                part = copy[at : at + size]
                if fd is None:
                    self._copy(start, part)
                else:
                    self._read(fd, start, part)
                at += size
        finally:
            if fd is not None:
                os.close(fd)
        return copy.toreadonly()

    def will_need(self, start: int, end: int) -> None:
        """Ask the disk for bytes that are read soon; nothing else is read ahead."""
        if self.memory is not None:
            self.memory.will_need(start, end)

    def let_go(self, start: int, end: int) -> None:
        """Give the memory back in which bytes that were read lie; they can be read again.

        The kernel keeps what was copied from a mapping on the process's account until then.
        """
        if self.memory is not None:
            self.memory.let_go(start, end)

    def _reopened(self) -> int | None:
        """Open the file by its name; None: another has it now, or none, or it may not be opened."""
        try:
            fd = self.folder.open_to_read(self.path.name)
        except OSError:
            return None
        status = os.fstat(fd)
        if (status.st_dev, status.st_ino) == self.identity:
            return fd
        os.close(fd)
        return None

    def _read(self, fd: int, start: int, target: memoryview) -> None:
        """Read a range by its descriptor."""
        done = 0
        while done < len(target):
            try:
                got = _read_some(fd, target[done:], start + done)
            except OSError as error:
                raise self._unreadable(start + done, f"{error.strerror}; {self._to_do}") from error
            if not got:
                now = os.fstat(fd).st_size
                problem = f"the file had {self.size} bytes when it was opened; it was cut to {now}"
                raise self._unreadable(start + done, problem)
            done += got

    def _copy(self, start: int, target: memoryview) -> None:
        """Copy a range from the mapping."""
        if not target:
            return
        if self.memory is None:  # it cannot be mapped on this system
            raise self._unreadable(start, "the file was replaced; reopen the log")
        try:
            copied = self.memory.copy(start, target)
        except OSError as error:
            raise self._unreadable(start, f"{error.strerror}") from error
        if copied < len(target):
            problem = "the disk refuses it, or the file was cut; another file now has its name"
            raise self._unreadable(start + copied, problem)

    @property
    def _to_do(self) -> str:
        log = self.path.parent
        verify, recover = (command_line(verb, log) for verb in ("verify", "recover"))
        return f"all such places: {verify}; to save the rest: {recover}"

    def _unreadable(self, at: int, problem: str) -> UnreadableLogError:
        return UnreadableLogError(self.path, at, problem)


def _read_some(fd: int, target: memoryview, at: int) -> int:
    try:
        return read_into(fd, target, at)
    except OSError:
        return read_page_into(fd, target, at)


def map_file(path: Path, folder: LogFolder | None = None) -> MappedFile:
    """Return a file's bytes as they are now, without keeping a file descriptor.

    Args:
        path: The file, for messages.
        folder: Where it is found by its name; None: where its path says.

    Raises:
        NotALogError: It is no regular file.
        LogAccessError: It cannot be read; `FileNotFoundError` is its cause where it has gone.
    """
    folder = folder or LogFolder(path.parent)
    try:
        fd = folder.open_to_read(path.name)
    except OSError as error:
        raise LogAccessError(f"{path}: cannot be read: {error.strerror}.") from error
    try:
        status = os.fstat(fd)
        if not stat.S_ISREG(status.st_mode):
            raise NotALogError(f"{path}: not a regular file.")
        memory = MappedMemory(fd, status.st_size) if status.st_size and can_map() else None
        return MappedFile(path, folder, status.st_size, (status.st_dev, status.st_ino), memory)
    except OSError as error:
        raise LogAccessError(f"{path}: cannot be read: {error.strerror}.") from error
    finally:
        os.close(fd)


MOST_AT_ONCE = 2**19
"""Bytes requested of the disk in one call; the kernel cuts a longer request short."""

_MADV_POPULATE_READ = 22
_REFUSED = (errno.ENOSYS, errno.EPERM, errno.EACCES)
_FAILED = ctypes.c_void_p(-1).value


class MappedMemory:
    """A file that is mapped without keeping a descriptor; unmapped with the last reference to this.

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
        """Advise the kernel to load bytes from the disk."""
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
    return _checked_copy(source, size, target)


def _checked_copy(source: int, size: int, target: int) -> int:
    """Do the same without the call that copies: ask for the pages, then copy them."""
    while not _are_there(source, size):
        in_page = mmap.PAGESIZE - source % mmap.PAGESIZE
        if size <= in_page:
            return 0
        size = max(in_page, size // 2)
    ctypes.memmove(target, source, size)
    return size


def _are_there(address: int, size: int) -> bool:
    """Return whether pages can be read; True where that cannot be found out."""
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
    """Return whether the C library can map files: not on Windows."""
    try:
        _library()
    except (OSError, TypeError, AttributeError):
        return False
    return hasattr(mmap, "MAP_SHARED")
