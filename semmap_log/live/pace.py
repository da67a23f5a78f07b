"""When each moment of a log is due, by a clock that nobody sets."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

NowNs = Callable[[], int]
"""A monotonic clock, ns."""


class Pace:
    """The log's time beside the wall's.

    What is due is reckoned from the beginning, never from the message before: being late once, or
    rounding, makes nothing later that follows.
    """

    def __init__(
        self,
        begin_ns: int,
        rate: float = 1.0,
        *,
        longest_gap_ns: int | None = None,
        now_ns: NowNs = time.monotonic_ns,
    ) -> None:
        """Begin now.

        Args:
            begin_ns: The log's time of now.
            rate: Its seconds in one of the wall's; infinite: everything is due at once.
            longest_gap_ns: Stretches of the log without messages that are longer are left out.
            now_ns: The wall's clock.
        """
        self.now_ns = now_ns
        self._rate = rate
        self._longest_gap_ns = longest_gap_ns
        self._log_ns = self._before_ns = self.next_ns = begin_ns
        self._wall_ns = now_ns()

    def due_ns(self, at_ns: int) -> int:
        """Return when, by the wall's clock, the next message is due; the one before is out.

        Args:
            at_ns: Its time in the log, not before that of the message before.
        """
        self._before_ns, self.next_ns = self.next_ns, at_ns
        gap_ns = at_ns - self._before_ns
        if self._longest_gap_ns is not None and gap_ns > self._longest_gap_ns:
            self._log_ns += gap_ns  # as if it came right behind the one before
        return self._wall_ns + round((at_ns - self._log_ns) / self._rate)

    def log_ns(self) -> int:
        """Return the log's time of now: between those of the message before and of the next."""
        if math.isinf(self._rate):
            return self.next_ns
        passed_ns = round((self.now_ns() - self._wall_ns) * self._rate)
        return min(max(self._log_ns + passed_ns, self._before_ns), self.next_ns)
