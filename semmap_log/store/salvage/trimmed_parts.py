"""Where something was taken out of what survives of a damaged log, by its new numbers.

The head of a trimmed segment tells where that ends, so it must be known before one is written.
"""

from __future__ import annotations

from dataclasses import dataclass

from semmap_log.store.header import TrimReason


@dataclass(frozen=True, slots=True)
class TrimmedPart:
    """What becomes a trimmed segment of the new log."""

    first_event: int
    next_event: int
    """Number of the first event behind it."""
    reasons: TrimReason


class TrimmedParts:
    """Takes the segments of a damaged log in order, and what was taken out of each."""

    def __init__(self) -> None:
        self._found: list[TrimmedPart] = []
        self._place = -1
        """Which segment is under way …"""
        self._first_event = self._next_event = 0
        self._reasons = TrimReason(0)
        """… and why something was taken out of it."""

    def add(self, place: int, first_event: int, next_event: int, reasons: TrimReason) -> None:
        """Take in a commit, or what stands for some.

        Args:
            place: Of its segment.
            first_event: The new number of its first event.
            next_event: The same of the first event behind it.
            reasons: Why something of it was taken out; 0: nothing was.
        """
        if place != self._place:
            self._end()
            self._place, self._first_event = place, first_event
        self._next_event = next_event
        self._reasons |= reasons

    def found(self) -> tuple[TrimmedPart, ...]:
        """Return all of them."""
        self._end()
        return tuple(self._found)

    def _end(self) -> None:
        if self._reasons:
            part = TrimmedPart(self._first_event, self._next_event, self._reasons)
            self._found.append(part)
        self._reasons = TrimReason(0)
