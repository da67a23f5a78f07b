"""A row of the table: the same task, done by us and by others."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import repeat
from math import ceil
from statistics import median
from typing import Any


@dataclass(frozen=True, slots=True, eq=False)
class Near:
    """Expected numbers; equal to a sequence of as many, each of them near its own."""

    values: tuple[float, ...]
    within: float
    """Of each value: so much of it, or of 1e-3 where it is less."""

    def __eq__(self, other: object) -> bool:
        """Tell whether an answer is right."""
        if not isinstance(other, Sequence) or len(other) != len(self.values):
            return False
        return all(
            abs(found - expected) <= self.within * max(abs(expected), 1e-3)
            for found, expected in zip(other, self.values, strict=True)
        )

    __hash__ = None  # type: ignore[assignment]  # near is not transitive


@dataclass(frozen=True, slots=True)
class Work:
    """What a peer does in its own process, once it is prepared."""

    once: Callable[[Any], Any]
    """Timed: one turn, from an input to a result."""
    inputs: Iterator[Any] = field(default_factory=lambda: repeat(None))
    """Not timed: what each turn is given; at least as many as there are turns."""
    answer: Callable[[Any], Any] = lambda result: result
    """Not timed: the last turn's result as a plain value that can be compared."""
    note: Callable[[Any], str] = lambda _: ""
    """Not timed: what else the table says of the last turn's result."""
    read_bytes: Callable[[], int] | None = None
    """How many bytes it has had from its store so far; None: those that the disk gave."""


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
    """What is promised of it, in the table's words: `≥ 80x` our speed, `< 150 ms`."""
    beside: int = 0
    """Which of the case's peers it is compared with: ours, with as many cores."""
    cores: int | None = None
    """Its process is held on so many cores; None: it may use all."""
    store_bytes: int = 0
    """Size of what it reads from, where the share that it read is asked for."""


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
    burst_s: float = float("inf")
    """A peer's turns in a round end after this time: slow ones take fewer."""
    has_memory: bool = True
    """Whether the memory of the peer's process says something."""
    memory_promise: bool = True
    """Whether we promise to stay below `promises.MEMORY_MB`: not where a map is that large."""
    memory_mb: int | None = None
    """What we promise to stay below instead."""
    events: int | None = None
    """How many events the log holds; None: that does not matter."""
    warms_up: bool = True
    """Whether a first round does not count; very long tasks go without."""
    tail_promise: str | None = None
    """What is promised of our slowest turns (p99), perhaps nothing; None: they are not shown."""
    worst_promise: str = ""
    """What is promised of the slowest of all."""
    share_promise: str = ""
    """What is promised of the share of the bytes that we read."""
    growth_promise: str | None = None
    """What is promised of our time in a larger log; None: its growth is not shown."""
    key: str = ""
    """What it is, for growth: the same at all sizes."""


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
    cpu_seconds: tuple[float, ...] = ()
    """Of the processor, all cores together, in each turn that counts."""
    read_bytes: tuple[int, ...] = ()
    """What each turn that counts had its store give: the disk, unless it is another."""
    note: str = ""
    """What else there is to say."""

    @property
    def median_s(self) -> float:
        """Seconds per unit."""
        return median(self.seconds) / self.peer.units

    @property
    def cpu_s(self) -> float:
        """Seconds of the processor per unit: less at the mercy of what else the machine does."""
        return median(self.cpu_seconds) / self.peer.units

    @property
    def least_s(self) -> float:
        """Seconds per unit, at best."""
        return min(self.seconds) / self.peer.units

    @property
    def p99_s(self) -> float:
        """Seconds per unit that 99 of 100 turns stay within."""
        ranked = sorted(self.seconds)
        return ranked[ceil(0.99 * len(ranked)) - 1] / self.peer.units

    @property
    def worst_s(self) -> float:
        """Seconds per unit of the slowest turn."""
        return max(self.seconds) / self.peer.units

    @property
    def share_read(self) -> float | None:
        """Which part of its store a turn read; None: not asked, or not to be seen."""
        if not self.peer.store_bytes or not any(self.read_bytes):
            return None
        return median(self.read_bytes) / self.peer.store_bytes
