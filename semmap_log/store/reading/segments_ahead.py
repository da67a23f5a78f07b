"""Segments asked for before their turn: where they lie in a store, each asking takes a while."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from semmap_log.store.reading.segment_scan import Segment

MOST_SEGMENTS = 32
"""So many are on their way at a time."""
MOST_BYTES = 2**23
"""And so many bytes: a part of what a process keeps of what it has fetched."""
SMALL_BYTES = 2**20
"""A smaller segment comes whole, since a request costs more than its bytes."""
END_BYTES = 2**16
"""Of a large one only both ends come before its turn, which tell what chunks it has."""


class SegmentsAhead:
    """The way through segments that a manifest tells of, the next ones on their way.

    As the read-ahead of an operating system it begins with few, and doubles them while the reading
    goes on, so that a question that ends early has not paid for much.
    """

    def __init__(
        self, segments: Sequence[Segment], is_wanted: Callable[[int], bool], *, takes_all: bool
    ) -> None:
        """Ask for nothing yet.

        Args:
            segments: In the order in which they are read.
            is_wanted: Told a place in them: whether anything of it will be read, as far as the
                manifest knows.
            takes_all: Whether all of it is read then, rather than some chunks.
        """
        self._segments = segments
        self._is_wanted = is_wanted
        self._whole_bytes = MOST_BYTES // 2 if takes_all else SMALL_BYTES
        self._next = 0
        self._most = 1

    def at(self, place: int) -> None:
        """Ask for what follows a segment that is read now."""
        self._next = max(self._next, place + 1)
        coming = sum(map(self._bytes_of, self._segments[place + 1 : self._next]))
        end = min(place + 1 + self._most, len(self._segments))
        self._most = min(2 * self._most, MOST_SEGMENTS)
        while self._next < end and coming < MOST_BYTES:
            segment = self._segments[self._next]
            if segment.told is not None and self._is_wanted(self._next):
                coming += self._bytes_of(segment)
                self._ask(segment)
            self._next += 1

    def _bytes_of(self, segment: Segment) -> int:
        return segment.size if segment.size <= self._whole_bytes else 2 * END_BYTES

    def _ask(self, segment: Segment) -> None:
        if segment.size <= self._whole_bytes:
            segment.source.will_need(0, segment.size)
        else:
            segment.source.will_need(0, END_BYTES)
            segment.source.will_need(segment.size - END_BYTES, segment.size)
