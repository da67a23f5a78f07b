"""A log's folder: its files by name, whatever becomes of the folder's own name meanwhile.

A writer *holds* the folder: files are found by its descriptor, so that a folder that is moved away,
and another one under its name, cannot lead a writer into another log. A reader uses the absolute
path that was fixed at opening: a log that `recover` has put in place of a damaged one is found
there.

Nothing that is written follows a link: a log's folder may come from a stranger, and no file
outside of it may change. New files are made only under free names; existing ones are replaced by a
rename.
"""

from __future__ import annotations

import errno
import os
import stat
import weakref
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from semmap_log.core.io.disk import FOLDER, NO_LINK, PLAIN, TEMPORARY_SUFFIX, check_can_write
from semmap_log.core.io.virtual_logs import VirtualLog, check_not_virtual, virtual_log
from semmap_log.core.texts import command_line
from semmap_log.errors import LogAccessError
from semmap_log.store.byte_layout import LOCK_NAME, is_temporary

if TYPE_CHECKING:
    from typing_extensions import Buffer


_NEW = os.O_RDWR | os.O_CREAT | os.O_EXCL
_MODE = 0o644

_CANNOT_LINK = {errno.EPERM, errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOTSUP}
"""What file systems say that have no hard links (FAT, some network servers)."""


MOST_BYTES = 2**26
"""Limit for a file that is read whole: one that lists, or describes, the segments of a log."""
Version = tuple[int, int, int, int]
"""Device, inode, size and time of the last change of a file."""


def version_of(status: os.stat_result) -> Version:
    """Return what changes when a file is exchanged, or written to."""
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


class LogFolder:
    """A folder in which a log lies, or will."""

    def __init__(
        self, path: Path, fd: int | None = None, name: str = "", *, made: VirtualLog | None = None
    ) -> None:
        """Name a folder, or what a log is made of; `held` opens a folder, too.

        Args:
            path: The path.
            fd: Of the folder, where it is open.
            name: Its own name.
            made: Where its files are, of a log that was made of others.

        Raises:
            LogError: A log cannot be made of others.
        """
        self.path = path
        """As it was given: for messages."""
        self.given = Path(os.path.abspath(path))
        """Where it was when it was opened, whatever becomes of the working directory."""
        self._elsewhere = made if made is not None or fd is not None else virtual_log(path)
        self.absolute = self.given if self._elsewhere is None else self._elsewhere.path
        """Where its files are: elsewhere, if they were made."""
        self._fd = fd
        self.name = name or path.name
        """The folder's own name when it was opened."""
        if fd is not None:
            weakref.finalize(self, os.close, fd)

    @classmethod
    def held(cls, path: Path) -> LogFolder:
        """Return a folder that is kept open as long as anybody has it.

        Raises:
            LogAccessError: It is no folder, or this system lacks what writing needs.
            OSError: As the system says.
        """
        check_not_virtual(path)
        check_can_write(path)
        fd = os.open(path, os.O_RDONLY | FOLDER | PLAIN)
        return cls(path, fd, path.resolve().name)

    @classmethod
    def of(cls, folder: LogFolder | Path) -> LogFolder:
        """Return the folder of that path, unless it is one already."""
        return folder if isinstance(folder, LogFolder) else cls(folder)

    def __truediv__(self, name: str) -> Path:
        """Return a file's path, for messages."""
        return self.path / name

    def open(self, name: str, flags: int, mode: int = _MODE) -> int:
        """Return a descriptor of a file; neither a link is followed nor a pipe waited for.

        Raises:
            OSError: As the system says.
        """
        return os.open(self._at(name), flags | NO_LINK | PLAIN, mode, dir_fd=self._fd)

    def open_to_read(self, name: str) -> int:
        """Return a descriptor of a file, or of what it links to, as a person may have set it up.

        Raises:
            OSError: As the system says.
        """
        return os.open(self._at(name), os.O_RDONLY | PLAIN, dir_fd=self._fd)

    def open_itself(self) -> int:
        """Return a descriptor of the folder.

        Raises:
            OSError: As the system says.
        """
        return os.open(self._at("."), os.O_RDONLY | FOLDER | PLAIN, dir_fd=self._fd)

    def files(self) -> list[tuple[str, int]]:
        """Return name and inode of all that is in the folder, by name.

        Raises:
            OSError: As the system says.
        """
        at = self.absolute if self._fd is None else self._fd
        with os.scandir(at) as entries:
            return sorted((entry.name, entry.inode()) for entry in entries)

    def names(self) -> list[str]:
        """Return the names of all that is in the folder.

        Raises:
            OSError: As the system says.
        """
        return os.listdir(self.absolute if self._fd is None else self._fd)

    def status(self, name: str, *, follows: bool = False) -> os.stat_result:
        """Return what the system says of a file; if it `follows`, of what that links to.

        Raises:
            OSError: As the system says.
        """
        return os.stat(self._at(name), dir_fd=self._fd, follow_symlinks=follows)

    def has(self, name: str) -> bool:
        """Return whether a file of that name exists."""
        try:
            self.status(name)
        except FileNotFoundError:
            return False
        return True

    def identity(self, name: str) -> tuple[int, int]:
        """Return device and inode of a file, or of what it links to.

        Raises:
            OSError: As the system says.
        """
        status = self.status(name, follows=True)
        return status.st_dev, status.st_ino

    def version(self, name: str) -> Version:
        """Return what changes when a file is exchanged, or written to.

        Raises:
            OSError: As the system says.
        """
        return version_of(self.status(name))

    def is_there(self, name: str, fd: int) -> bool:
        """Return whether a name still belongs to the file that is open there."""
        ours = os.fstat(fd)
        try:
            return os.path.samestat(ours, self.status(name))
        except FileNotFoundError:
            return False

    def is_at(self, path: Path) -> bool:
        """Return whether a path leads to this folder, which is held open."""
        try:
            return os.path.samestat(self.status("."), os.stat(path))
        except FileNotFoundError:
            return False

    def read_bytes(self, name: str, most: int = MOST_BYTES) -> bytes:
        """Return what is in a regular file; of a longer one so many bytes at most.

        None of ours is longer than the default. A hole of a file may be of any length.

        Raises:
            FileNotFoundError: There is nothing of that name.
            LogAccessError: It is no regular file.
            OSError: As the system says.
        """
        with self.regular_file(name) as file:
            return file.read(min(most, os.fstat(file.fileno()).st_size + 1))

    def regular_file(self, name: str) -> BinaryIO:
        """Return a regular file, open to be read.

        Raises:
            FileNotFoundError: There is nothing of that name.
            LogAccessError: It is no regular file.
            OSError: As the system says.
        """
        try:
            fd = self.open(name, os.O_RDONLY)
        except OSError as error:
            if error.errno == errno.ELOOP:
                raise self._no_file(name) from None
            raise
        file = os.fdopen(fd, "rb")
        if not stat.S_ISREG(os.fstat(fd).st_mode):
            file.close()
            raise self._no_file(name)
        return file

    def new_file(self, name: str) -> tuple[str, int]:
        """Make a file under a temporary name, to be renamed later; return that name and the file.

        Raises:
            OSError: As the system says.
        """
        temporary = f".{name}.{os.getpid()}-{os.urandom(4).hex()}{TEMPORARY_SUFFIX}"
        return temporary, self.open(temporary, _NEW | os.O_APPEND)

    def put_new(self, temporary: str, name: str) -> None:
        """Give a file a name that is free; it survives a power cut.

        By a hard link, which never replaces anything. On file systems that have none (FAT, some
        network servers) by a look and a rename: there the writer's lock alone keeps others out.

        Raises:
            FileExistsError: The name is taken.
            OSError: As the system says.
        """
        here = {"src_dir_fd": self._fd, "dst_dir_fd": self._fd}
        try:
            os.link(self._at(temporary), self._at(name), **here, follow_symlinks=False)
        except OSError as error:
            if error.errno not in _CANNOT_LINK:
                raise
            if self.has(name):
                raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), name) from None
            self.put(temporary, name)
            return
        self.sync()  # before the other name goes: a power cut must leave one of the two
        self.remove(temporary)

    def put(self, temporary: str, name: str) -> None:
        """Give a file a name, in place of what has it; it survives a power cut.

        Raises:
            OSError: As the system says.
        """
        os.replace(self._at(temporary), self._at(name), src_dir_fd=self._fd, dst_dir_fd=self._fd)
        self.sync()

    def write_atomic(self, name: str, data: Iterable[Buffer]) -> None:
        """Put a file of these blocks in place of what has the name, whole or not at all, synced.

        Raises:
            OSError: As the system says.
        """
        temporary, fd = self.new_file(name)
        try:
            with os.fdopen(fd, "wb") as file:
                file.writelines(data)
                file.flush()
                os.fsync(fd)
            self.put(temporary, name)
        except BaseException:
            with suppress(OSError):
                self.remove(temporary)
            raise

    def remove(self, name: str) -> None:
        """Remove a file, if it is there.

        Raises:
            OSError: As the system says.
        """
        with suppress(FileNotFoundError):
            os.unlink(self._at(name), dir_fd=self._fd)

    def sync(self) -> None:
        """Make the folder's entries (new names, renames) survive a power cut.

        Raises:
            OSError: As the system says.
        """
        _synced(self.open_itself())

    def sync_file(self, name: str) -> None:
        """Make what was written to a file, by whomever, survive a power cut.

        Raises:
            OSError: As the system says.
        """
        _synced(self.open_to_read(name))

    def remove_stale_files(self) -> None:
        """Remove the temporary files of writers that were killed; only for who holds the lock.

        Raises:
            OSError: As the system says.
        """
        for name, _ in self.files():
            if is_temporary(name):
                self.remove(name)

    def is_empty(self) -> bool:
        """Return whether the folder contains only what a killed writer left."""
        return all(is_temporary(name) or name == LOCK_NAME for name, _ in self.files())

    def _at(self, name: str) -> str:
        """Return the name in the folder that is held open, else the whole path."""
        return name if self._fd is not None else str(self.absolute / name)

    def _no_file(self, name: str) -> LogAccessError:
        problem = f"{self.path / name}: expected a regular file; a log has no others"
        return LogAccessError(f"{problem}. Move it elsewhere.")


def _synced(fd: int) -> None:
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


_MAGIC = (b"PK\3\4", b"PK\5\6")
"""Of a zip that holds something, and of one that holds nothing."""


def is_zip(path: Path) -> bool:
    """Return whether a path leads to a zip file, judged by its first bytes."""
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            return False
        with path.open("rb") as file:
            return file.read(len(_MAGIC[0])) in _MAGIC
    except OSError:
        return False


def not_a_folder(path: Path) -> str:
    """Return why a file is no log, and what to do if it is a packed one."""
    if not is_zip(path):
        return f"{path}: a log is a folder, this is a file."
    unpack = command_line(str(path), program="unzip")
    return f"{path}: a log is a folder, this is a zip file; unpack it first: {unpack}"
