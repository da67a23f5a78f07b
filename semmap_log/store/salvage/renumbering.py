"""Event numbers of a damaged log -> those of the log that is made from what survives."""

from __future__ import annotations

from bisect import bisect_right


class Renumbering:
    """Runs of events that survive; what was lost between them leaves no gap in the new numbers."""

    def __init__(self) -> None:
        self._old: list[int] = []
        """First old number of each run."""
        self._new: list[int] = []
        """Its new number."""
        self._counts: list[int] = []
        self.next_event = 0
        """The new number that comes next."""

    def keep_all_below(self, old: int) -> None:
        """Let all events below a number keep theirs, gaps included; to be called first."""
        self._old, self._new, self._counts = [0], [0], [old]
        self.next_event = old

    def keep(self, old: int, count: int = 1) -> int:
        """Return the new number of an event that survives; to be called in ascending order.

        Args:
            old: Its number.
            count: So many from it on survive, or were taken out on purpose and leave a gap.
        """
        new = self.next_event
        if self._old and old == self._old[-1] + self._counts[-1]:
            self._counts[-1] += count
        elif count:
            self._old.append(old)
            self._new.append(new)
            self._counts.append(count)
        self.next_event = new + count
        return new

    def below(self, old: int) -> int:
        """Return how many surviving events have a lower number: the new number, if it survives."""
        run = bisect_right(self._old, old) - 1
        if run < 0:
            return 0
        return self._new[run] + min(old - self._old[run], self._counts[run])

    def range(self, first: int, last: int) -> tuple[int, int] | None:
        """Return the new first and last number of those of a range that survive; None: none."""
        new_first, behind = self.below(first), self.below(last + 1)
        return (new_first, behind - 1) if behind > new_first else None
