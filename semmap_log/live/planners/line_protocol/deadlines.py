"""When clients are to be told that their time is over."""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable

from semmap_log.live.planners.line_protocol.connection import Connection

FEW = 64


class Deadlines:
    """One for each client at most; most are over before their time."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, Connection]] = []
        self._count = 0
        self._most = FEW
        """So many are kept, those that are over included, before these are sought out."""

    def __len__(self) -> int:
        return len(self._heap)

    def set(self, connection: Connection, seconds: float, at_deadline: Callable[[], None]) -> None:
        """Call something after a time, unless the client's deadline is another by then."""
        connection.deadline_s = time.monotonic() + seconds
        connection.at_deadline = at_deadline
        self._count += 1  # no two are alike, and connections cannot be compared
        heapq.heappush(self._heap, (connection.deadline_s, self._count, connection))
        if len(self._heap) > self._most:
            self._heap = [each for each in self._heap if each[2].deadline_s == each[0]]
            heapq.heapify(self._heap)
            self._most = max(FEW, 2 * len(self._heap))

    def next_s(self) -> float | None:
        """Return for how many seconds there is nothing to do; None: for ever."""
        return max(self._heap[0][0] - time.monotonic(), 0.0) if self._heap else None

    def meet(self) -> None:
        """Call what is due."""
        while self._heap and self._heap[0][0] <= time.monotonic():
            deadline_s, _, connection = heapq.heappop(self._heap)
            if connection.deadline_s == deadline_s:
                connection.deadline_s = None
                connection.at_deadline()
