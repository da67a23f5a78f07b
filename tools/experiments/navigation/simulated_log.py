"""A log whose clock is a simulation's: the same events give the same bytes."""

from __future__ import annotations

import random
from pathlib import Path

from patrol_sim.journal import SimulatedClock

import semmap_log as sl
from semmap_log.core.model.commits import Note
from semmap_log.core.model.events import Event
from semmap_log.log import compact


class SimulatedLog:
    """Collects events, and writes them as one commit when told to.

    A commit is recorded when the last of its events happened.
    """

    def __init__(
        self, path: Path, building: str, robot: str, entropy: random.Random, start_ns: int
    ) -> None:
        """Make the log.

        Args:
            path: Its folder.
            building: Its name.
            robot: The robot's name.
            entropy: Where its ids come from.
            start_ns: What its clock shows at first.
        """
        self._path = path
        self._clock = SimulatedClock(start_ns, entropy.randbytes(16))
        self._log = sl.create(
            path, tz="UTC", building=building, robot=robot, clock=self._clock,
            entropy=entropy.randbytes, durability="none", compact=False,
        )  # fmt: skip
        self._waiting: list[Event] = []

    @property
    def now_ns(self) -> int:
        """What its clock shows: when the last event happened."""
        return self._clock.now_ns

    def add(self, *events: Event) -> None:
        """Let events wait for the next commit; they say when they happened, none before another."""
        self._waiting += events
        assert events[-1].happened_ns is not None
        self._clock.now_ns = events[-1].happened_ns

    def commit(self, **note: str) -> None:
        """Write what waits, if anything does."""
        if self._waiting:
            self._log.append(self._waiting, note=Note(**note))
            self._waiting = []

    def close(self, **note: str) -> None:
        """Write what waits, close the log, and make it small and quick to read."""
        self.commit(**note)
        self._log.close()
        compact(self._path, merge=False)
