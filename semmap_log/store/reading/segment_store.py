"""Where a log's segments lie: a folder on a disk, or another place that can give ranges of bytes.

What the reader asks of it is told here, once for all places. Writing, recovery and compaction need
a folder: a robot writes to its disk.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from pathlib import PurePath
from typing import TYPE_CHECKING, Protocol

from semmap_log.core.io.byte_source import ByteSource
from semmap_log.store.closed_mark import ClosedMark

if TYPE_CHECKING:
    from semmap_log.store.manifest import ShippedSegment

Listing = list[tuple[str, Hashable]]
"""The name of each segment file, by name, and what tells it from another file of that name."""


class SegmentStore(Protocol):
    """The files of one log, as a reader sees them. A closed segment never changes under its name.

    It may be asked again and again while somebody writes there.
    """

    @property
    def path(self) -> PurePath:
        """Where the log lies, as it was given: for messages."""

    @property
    def given(self) -> PurePath:
        """The same, whatever becomes of the working directory."""

    def segments(self) -> Listing:
        """Return the segments that are there now, at least one.

        Raises:
            NotALogError: There is none.
            LogAccessError: They cannot be listed.
        """

    def open(self, name: str) -> ByteSource:
        """Return a segment's bytes as they are now.

        Raises:
            NotALogError: It is no file.
            LogAccessError: It cannot be read; `FileNotFoundError` is its cause where it has gone.
        """

    def told(self, name: str) -> ShippedSegment | None:
        """Return what a manifest says of a closed segment, so that it need not be opened for it."""

    def size_of(self, name: str) -> int:
        """Return how many bytes a segment has now: a live one grows.

        Raises:
            OSError: It is gone, or cannot be asked.
        """

    def mark(self) -> ClosedMark | None:
        """Return how far the log reached when its last segment was closed; None: nobody knows.

        Raises:
            CorruptLogError: What says so is not what was written.
            LogAccessError: It cannot be read.
        """

    def closed_names(self) -> Sequence[str]:
        """Return the segments that are known as closed: asked where there is no mark."""
