"""How long a run may take, divided among the kinds that are still to come."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Share:
    """The time of one kind, seconds of a clock."""

    clock: Callable[[], float]
    start: float
    end: float

    def left(self, now: float) -> float:
        """Return how much of it is left."""
        return self.end - now

    def is_over(self, now: float) -> bool:
        """Tell whether none is."""
        return now >= self.end


class Budget:
    """The time of a run: what a kind does not need, the others get."""

    def __init__(self, clock: Callable[[], float], seconds: float | None, kinds: int) -> None:
        """Start it; without `seconds` there is no end."""
        self.clock = clock
        self._end = math.inf if seconds is None else clock() + seconds
        self._to_come = kinds

    def next_share(self) -> Share:
        """Return the time of the next kind, from now on."""
        now = self.clock()
        share = (self._end - now) / self._to_come
        self._to_come -= 1
        return Share(self.clock, now, now + share)
