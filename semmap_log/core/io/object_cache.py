"""Blocks of objects, cached on a disk, so that repeated reads need not fetch them again.

A folder may be used by several processes at once. Each block is a file of its own, named by its
content, that appears whole or not at all, with a digest: a damaged one is removed and fetched
again. Nothing is synced: it can all be fetched again.
"""

from __future__ import annotations

import hashlib
import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from semmap_log.core.io.checked_file import TEMPORARY, read_checked, write_checked
from semmap_log.errors import LogAccessError

VARIABLE = "SEMMAP_LOG_CACHE"
"""Of the environment: the folder. Without it, nothing is kept on a disk."""
MOST_BYTES = 2**30
"""So much is kept; what was used longest ago goes first."""
_MOST_BLOCK_BYTES = 2**20
_BLOCK = ".block"
_SWEEPS = 16
"""It is looked through each time that this part of it was written."""
_KEEP_OF_MOST = 0.9
_TEMPORARY_FOR_S = 3600.0
"""Older temporary files were left by a process that was killed."""


class ObjectCache:
    """A folder of blocks."""

    def __init__(self, folder: Path, *, most_bytes: int = MOST_BYTES) -> None:
        """Take a folder, and make it if it is not there.

        Args:
            folder: The folder; one that is made is closed to others, since logs show who was
                where.
            most_bytes: So much is kept, and a sixteenth more until somebody looks.

        Raises:
            LogAccessError: It cannot be made, or is no folder.
        """
        self.folder = folder.absolute()
        self._most_bytes = most_bytes
        self._written = most_bytes  # who begins looks first
        self._lock = threading.Lock()
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        except OSError as error:
            raise LogAccessError(
                f"{folder}: no cache can be there: {error.strerror}. Give another folder, by "
                f"--cache or {VARIABLE}, or none."
            ) from error

    def __reduce__(self) -> tuple[Callable[[Path, int], ObjectCache], tuple[Path, int]]:
        """Return what another process uses it by."""
        return _cache_at, (self.folder, self._most_bytes)

    def get(self, content: str, block: int) -> bytes | None:
        """Return a block, or None if it is not cached.

        Args:
            content: What distinguishes the object from all others, also of its own name.
            block: Its place in it.
        """
        path = self._place_of(content, block)
        data = read_checked(path, _MOST_BLOCK_BYTES)
        if data is None:
            return None
        with suppress(OSError):
            os.utime(path)  # used now
        return data

    def put(self, content: str, block: int, data: bytes) -> None:
        """Keep a block, as `get`; where the disk does not let us, nothing is kept."""
        path = self._place_of(content, block)
        try:
            path.parent.mkdir(mode=0o700, exist_ok=True)
            write_checked(path, data)
        except OSError:
            return
        if self._has_written(len(data)):
            self.sweep()

    def blocks(self) -> list[Path]:
        """Return the files of all blocks, also of those that are not finished."""
        return [
            Path(entry.path)
            for folder in _subfolders(self.folder)
            for entry in _entries(folder)
            if _BLOCK in entry.name
        ]

    def sweep(self) -> None:
        """Remove what was used longest ago, if there is too much."""
        files = sorted(self._files())
        total = sum(size for _, size, _ in files)
        most = self._most_bytes if total <= self._most_bytes else _KEEP_OF_MOST * self._most_bytes
        for _, size, path in files:
            if total <= most:
                return
            with suppress(OSError):
                path.unlink()
            total -= size

    def _has_written(self, count: int) -> bool:
        """Count what was written, and return whether it is time to sweep the cache."""
        with self._lock:
            self._written += count
            if self._written < self._most_bytes // _SWEEPS:
                return False
            self._written = 0
            return True

    def _files(self) -> Iterator[tuple[float, int, Path]]:
        """Yield when each block was used, its size, and its file; remove what nobody finished."""
        old = time.time() - _TEMPORARY_FOR_S
        for folder in _subfolders(self.folder):
            for entry in _entries(folder):
                with suppress(OSError):
                    status = entry.stat(follow_symlinks=False)
                    if not entry.name.startswith(TEMPORARY):
                        yield status.st_mtime, status.st_size, Path(entry.path)
                    elif status.st_mtime < old:
                        Path(entry.path).unlink()

    def _place_of(self, content: str, block: int) -> Path:
        name = hashlib.sha256(f"{block} {content}".encode()).hexdigest()
        return self.folder / name[:2] / f"{name[2:]}{_BLOCK}"


def cache_of_environment() -> ObjectCache | None:
    """Return the cache that the environment names; None: it names none.

    Raises:
        LogAccessError: It cannot be used.
    """
    named = os.environ.get(VARIABLE, "")
    return _cache_in(named) if named else None


def _cache_at(folder: Path, most_bytes: int) -> ObjectCache:
    return ObjectCache(folder, most_bytes=most_bytes)


@lru_cache(maxsize=4)
def _cache_in(folder: str) -> ObjectCache:
    return ObjectCache(Path(folder))


def _subfolders(folder: Path) -> list[str]:
    """Return the folders of blocks; what else lies there is not ours."""
    return [one.path for one in _entries(folder) if len(one.name) == 2 and one.is_dir()]


def _entries(folder: str | Path) -> list[os.DirEntry[str]]:
    """Return what is in a folder; nothing, if it may not be looked into."""
    with suppress(OSError), os.scandir(folder) as entries:
        return list(entries)
    return []
