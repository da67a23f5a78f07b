"""How far the reading of a log has come: told to who waits, and no longer kept in memory."""

from __future__ import annotations

from collections.abc import Sequence

from semmap_log.core.io.progress import Progress
from semmap_log.store.pages import Page
from semmap_log.store.reading.segment_scan import Segment

MOST_MAPPED = 2**24
"""So much of what was read of mapped files stays on the process's account."""


class ReadProgress:
    """The way through segments, one behind the other."""

    def __init__(self, segments: Sequence[Segment], progress: Progress | None) -> None:
        self._progress = progress
        self._done = 0
        """Bytes of the segments that were passed."""
        self._todo = sum(segment.size for segment in segments) if progress else 0
        self._kept_from = 0
        """In the segment that is read: what lies before was let go of."""

    def reached(self, segment: Segment, page: Page) -> None:
        """Take note of a page that was used, and all before it."""
        if page.offset - self._kept_from > MOST_MAPPED:
            segment.source.let_go(self._kept_from, page.offset)
            self._kept_from = page.offset
        if self._progress:
            self._progress(self._done + page.offset, self._todo)

    def passed(self, segment: Segment, *, is_read: bool) -> None:
        """Take note of a segment's end."""
        self._done += segment.size
        if is_read and self._done > MOST_MAPPED:
            segment.source.let_go(self._kept_from, segment.size)
        self._kept_from = 0
        if self._progress:
            self._progress(self._done, self._todo)
