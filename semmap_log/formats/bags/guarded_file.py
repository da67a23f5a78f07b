"""A foreign file for a library that believes what the file says of its own sizes."""

from __future__ import annotations

from pathlib import Path
from typing import Any, BinaryIO

from semmap_log.formats.bags.unpacking import MOST_BYTES
from semmap_log.formats.parsing.foreign_file import open_regular


class GuardedPath:
    """Stands for a path: what is opened by it reads at most 256 MiB at once."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __str__(self) -> str:
        return str(self._path)

    def exists(self) -> bool:
        """Tell whether something is there."""
        return self._path.exists()

    def open(self, _mode: str) -> _GuardedFile:
        """Open it for reading bytes.

        Raises:
            FormatError: It is no regular file, or cannot be read.
        """
        return _GuardedFile(open_regular(self._path))


class _GuardedFile:
    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def read(self, size: int) -> bytes:
        """Return so many bytes, or all up to the end.

        Raises:
            ValueError: That is more than any record has.
        """
        if size > MOST_BYTES:
            raise ValueError(f"expected records of at most 256 MiB, got {size:,} bytes")
        return self._file.read(size)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)
