"""Work of many clients, done in one thread by turns: who has had least of its time comes first."""

from __future__ import annotations

import heapq
import threading
import time
from collections.abc import Iterator
from itertools import count
from weakref import WeakKeyDictionary

from semmap_log.live.planners.line_protocol.connection import Connection

Work = Iterator[object]
"""Does one part each time that it is asked for the next; at its end it is done."""


class Turns:
    """A thread that works for all, one part at a time.

    A client that comes, or comes back, counts as if it had had as much of the thread as who has had
    least: so one that asks now and then waits for one part of another's work, and no longer.
    """

    def __init__(self, name: str, *, rest: float = 0.0) -> None:
        """Begin.

        Args:
            name: Of the thread.
            rest: After each part it rests for so many times as long as the part took: of work that
                only who floods has much of, so that others have the interpreter meanwhile.
        """
        self._rest = rest
        self._waiting: list[tuple[float, int, Connection, Work]] = []
        self._used_s: WeakKeyDictionary[Connection, float] = WeakKeyDictionary()
        self._least_s = 0.0
        """What the client has used whose turn it was last."""
        self._numbers = count()
        self._changed = threading.Condition()
        self._is_closed = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def add(self, client: Connection, work: Work) -> None:
        """Have work done for a client; work that raises is over."""
        with self._changed:
            self._put(client, work, self._used_s.get(client, 0.0))

    def close(self) -> None:
        """Do what was begun, and end."""
        with self._changed:
            self._is_closed = True
            self._changed.notify()
        self._thread.join()

    def _put(self, client: Connection, work: Work, used_s: float) -> None:
        place = max(used_s, self._least_s)
        heapq.heappush(self._waiting, (place, next(self._numbers), client, work))
        self._changed.notify()

    def _run(self) -> None:
        while (chosen := self._next()) is not None:
            used_s, _, client, work = chosen
            begun_s = time.monotonic()
            is_over = client.is_gone or _is_over(work)
            took_s = time.monotonic() - begun_s
            used_s += took_s
            with self._changed:
                self._used_s[client] = used_s
                if not is_over:
                    self._put(client, work, used_s)
            if self._rest:
                time.sleep(self._rest * took_s)

    def _next(self) -> tuple[float, int, Connection, Work] | None:
        """Return whose turn it is, once it is somebody's; None: there is no more to do."""
        with self._changed:
            while not self._waiting:
                if self._is_closed:
                    return None
                self._changed.wait()
            chosen = heapq.heappop(self._waiting)
            self._least_s = max(self._least_s, chosen[0])
            return chosen


def _is_over(work: Work) -> bool:
    """Do the next part of some work, and tell whether it was the last, or has failed."""
    try:
        next(work)
    except Exception:  # noqa: BLE001  StopIteration, or what the work did not expect: others go on
        return True
    return False
