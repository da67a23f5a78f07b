"""The thesis's StageDoorSensor: it compares the map with the world near the robot (E.1).

Where they differ, it notices with 90 percent, at each look. Beyond the thesis it also says once a
visit that a door is as the map has it: who learns from the log how often a door is open would
otherwise hear of changes only.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from semmap_log.domain.doors import DoorId


@dataclass
class DoorSensor:
    """The sensor: what it noticed, it says."""

    rng: random.Random
    notices: float = 0.9
    """P(it notices a difference)."""
    _near: set[DoorId] = field(default_factory=set)
    """Doors of which it has said how they are since the robot came near."""

    def look(
        self, near: Iterable[DoorId], world: Mapping[DoorId, bool], known: Mapping[DoorId, bool]
    ) -> list[tuple[DoorId, bool]]:
        """Return (door, is open) of what it has to say.

        Args:
            near: The doors near the robot, in an order that does not change.
            world: Whether each door stands open.
            known: The same, as the map has it; doors that the map lacks are passed over.
        """
        near = [door for door in near if door in known]
        self._near &= set(near)
        told = [(door, world[door]) for door in near if self._says(door, world, known)]
        self._near.update(door for door, _ in told)
        return told

    def _says(
        self, door: DoorId, world: Mapping[DoorId, bool], known: Mapping[DoorId, bool]
    ) -> bool:
        if world[door] != known[door]:
            return self.rng.random() < self.notices
        return door not in self._near
