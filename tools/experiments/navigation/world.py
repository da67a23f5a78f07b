"""The world of a run: its clock, its doors, and what they do to the laser's beams."""

from __future__ import annotations

from collections.abc import Callable

from navigation.door_daemon import DoorDaemon
from navigation.floors import Floor
from navigation.laser import Laser
from semmap_log.core.model.doors import DoorId

Heard = Callable[[float, DoorId, bool], None]
"""What is told of a door that opened or closed: when (s), which, whether it is open now."""


class World:
    """What is true. Time goes on when somebody lets it; doors toggle on the way."""

    def __init__(self, floor: Floor, daemon: DoorDaemon, laser: Laser, *, every_s: float) -> None:
        """Shut the doors that the daemon has shut, at second 0.

        Args:
            floor: Where the doors are.
            daemon: How they stand; it iterates from now on.
            laser: Whose beams end at shut doors.
            every_s: Between two iterations.
        """
        self.now_s = 0.0
        self.version = 0
        """Another number after each iteration that toggled a door."""
        self._floor, self._daemon, self._laser = floor, daemon, laser
        self._every_s, self._iterations = every_s, 0
        self._listeners: list[Heard] = []
        for door in floor.door_ids:
            self._put(door)

    @property
    def is_open(self) -> dict[DoorId, bool]:
        """How each door stands."""
        return self._daemon.is_open

    def tell(self, listener: Heard) -> None:
        """Call this for each door that opens or closes, as it does."""
        self._listeners.append(listener)

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        until_s = self.now_s + seconds
        while (next_s := (self._iterations + 1) * self._every_s) <= until_s:
            self.now_s = next_s
            self._iterations += 1
            self._iterate()
        self.now_s = until_s

    def _iterate(self) -> None:
        toggled = self._daemon.iterate()
        for door in toggled:
            self._put(door)
        self.version += bool(toggled)
        for door in toggled:
            for listener in self._listeners:
                listener(self.now_s, door, self.is_open[door])

    def _put(self, door: DoorId) -> None:
        """Move a door's leaf into its frame, or out of the world."""
        width = self._floor.geometry.width
        walls = self._floor.walls.reshape(-1)
        solid = self._laser.solid.reshape(-1)
        for cell in self._floor.leaf_cells[door].tolist():
            solid[self._laser.at(divmod(cell, width))] = not self.is_open[door] or walls[cell]
