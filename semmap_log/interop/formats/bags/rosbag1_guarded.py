"""rosbags' reader of ROS 1's `.bag`, with limits to what it unpacks and reads at once."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from struct import unpack_from
from typing import Any, BinaryIO

from rosbags.rosbag1 import Reader

from semmap_log.interop.formats.bags.unpacking import MOST_BYTES, Tally, unpack
from semmap_log.interop.formats.parsing.foreign_file import open_regular


class GuardedPath:
    """Stands for a path: what is opened by it reads at most 256 MiB at once."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __str__(self) -> str:
        return str(self._path)

    def exists(self) -> bool:
        """Return whether something is there."""
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


INDEX_HEAD_BYTES = 55
"""A header of 47 bytes, its length, and that of what follows."""
MOST_INDEX_BYTES = 48 * 2**20
"""Of a connection in a chunk: four million messages."""


class GuardedReader(Reader):  # type: ignore[misc]  # rosbags has no types
    """Reads a `.bag`; see `unpacking` for the limits."""

    def __init__(self, path: Path) -> None:
        super().__init__(GuardedPath(path))
        self._tally = Tally(path.stat().st_size)

    def read_chunk(self) -> Any:
        """Read a chunk's header; what it holds is unpacked within limits.

        Raises:
            ReaderError: There is no chunk.
        """
        chunk = super().read_chunk()
        packing = chunk.decompressor.__module__.split(".")[0]
        name = {"bz2": "bz2", "lz4": "lz4"}.get(packing, "none")
        return chunk._replace(decompressor=partial(self._unpacked, compression=name))

    def _unpacked(self, data: bytes, *, compression: str) -> bytes:
        unpacked = unpack(data, compression)
        self._tally.add(len(unpacked))
        return unpacked

    def read_index_data(self, pos: int, indexes: Any) -> None:
        """Read where the messages of a connection are in a chunk.

        Raises:
            ValueError: There are more than any chunk has.
        """
        assert self.bio is not None
        head = self.bio.read(INDEX_HEAD_BYTES)
        if len(head) < INDEX_HEAD_BYTES:
            raise ValueError("its index is cut")
        (size,) = unpack_from("<I", head, INDEX_HEAD_BYTES - 4)
        if size > MOST_INDEX_BYTES:
            raise ValueError(f"expected an index of at most 48 MiB a chunk, got {size:,} bytes")
        self.bio.seek(-INDEX_HEAD_BYTES, 1)
        super().read_index_data(pos, indexes)
