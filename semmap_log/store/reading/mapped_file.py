"""A file's bytes, mapped: they can be read when the file is replaced or removed meanwhile."""

from __future__ import annotations

import os
import stat
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from semmap_log.core.io.byte_source import Identity
from semmap_log.core.io.file_calls import read_into, read_page_into
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.texts import command_line
from semmap_log.errors import LogAccessError, NotALogError, UnreadableLogError
from semmap_log.store.folder import LogFolder
from semmap_log.store.reading.mapped_memory import MappedMemory, can_map


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
        """Return copies of ranges, one behind the other; as `ByteSource.read_ranges`."""
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
            raise self._unreadable(start, "another file has its name now; open the log anew")
        try:
            copied = self.memory.copy(start, target)
        except OSError as error:
            raise self._unreadable(start, f"{error.strerror}") from error
        if copied < len(target):
            problem = "the disk refuses it, or the file was cut; another file has its name now"
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
