"""Where the bytes of a segment come from: ranges of a file or of an object in a store."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from typing import Protocol

Identity = Hashable
"""Of a file on a disk: device and inode; of an object in a store: what changes with its bytes."""

BLOCK_BYTES = 2**20
"""So much is read at once where all of a file is."""


class ByteSource(Protocol):
    """A file's bytes as they were when it was opened, returned as private copies of ranges.

    Offsets are those of the file. Bytes after its end are left out, as by a slice. Only what
    `read` or `read_ranges` requests is read: so a source may have its bytes elsewhere, and fetch
    what is requested.
    """

    @property
    def size(self) -> int:
        """Bytes in all."""

    @property
    def identity(self) -> Identity:
        """The same for the same file under any name, another for its successor."""

    @property
    def is_guarded(self) -> bool:
        """Whether what is cut off meanwhile shows as an error: else, in parts, as zeros."""

    def read(self, start: int, end: int) -> memoryview:
        """Return a range, read-only; nobody changes it any more.

        Raises:
            UnreadableLogError: The disk refuses some of it, or the file was shortened.
        """

    def read_ranges(self, ranges: Sequence[tuple[int, int]]) -> memoryview:
        """Return ranges, concatenated; as `read`."""

    def will_need(self, start: int, end: int) -> None:
        """Begin to fetch a range that is read soon, and return; nothing else is fetched ahead.

        It is a hint: what is read may lie elsewhere.
        """

    def let_go(self, start: int, end: int) -> None:
        """Give up what a range that was read still takes of memory; it can be read again."""


def blocks(source: ByteSource, start: int, end: int) -> Iterator[memoryview]:
    """Yield a long range in parts.

    Raises:
        UnreadableLogError: As `ByteSource.read`.
    """
    for at in range(start, end, BLOCK_BYTES):
        yield source.read(at, min(at + BLOCK_BYTES, end))
