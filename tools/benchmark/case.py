"""A row of the table: the same task, done by us and by others."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import repeat
from statistics import median
from typing import Any


@dataclass(frozen=True, slots=True)
class Work:
    """What a peer does in its own process, once it is prepared."""

    once: Callable[[Any], Any]
    """Timed: one turn, from an input to a result."""
    inputs: Iterator[Any] = field(default_factory=lambda: repeat(None))
    """Not timed: what each turn is given; at least as many as there are turns."""
    answer: Callable[[Any], Any] = lambda result: result
    """Not timed: the last turn's result as a plain value that can be compared."""


@dataclass(frozen=True, slots=True)
class Peer:
    """Somebody who can do a case's task."""

    name: str
    prepare: Callable[[], Work]
    """Called in the child process: imports, opening, a warm cache. Must be picklable."""
    expected: object
    """What its answer must be, found out in another way than its own."""
    units: float = 1
    """How many units of the case's figure a turn does; a slow peer may do a part of the task."""
    promise: str = ""
    """What DESIGN section 9 says of it, in the table's words."""


@dataclass(frozen=True, slots=True)
class Case:
    """A task, and the peers who do it in turns: ours first."""

    group: str
    """What `--only` calls it."""
    title: str
    unit: str
    """`µs` or `ms` (a time per unit), else what a rate counts: `events/s`."""
    peers: tuple[Peer, ...]
    rounds: int
    burst: int = 1
    """Turns of a peer in a round."""
    has_memory: bool = True
    """Whether the memory of the peer's process says something."""
    events: int | None = None
    """How many events the log holds; None: that does not matter."""

    @property
    def turns(self) -> int:
        """How often each peer does the task: the first round warms up, and does not count."""
        return (1 + self.rounds) * self.burst


@dataclass(frozen=True, slots=True)
class Measured:
    """What came out for one peer."""

    peer: Peer
    seconds: tuple[float, ...] = ()
    """Of each turn that counts."""
    peak_bytes: int = 0
    """Most memory its process had while it worked."""
    agrees: bool = False
    """Whether its answer was the expected one."""
    problem: str = ""
    """Why there is no figure."""

    @property
    def median_s(self) -> float:
        """Seconds per unit."""
        return median(self.seconds) / self.peer.units

    @property
    def least_s(self) -> float:
        """Seconds per unit, at best."""
        return min(self.seconds) / self.peer.units
