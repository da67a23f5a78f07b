"""The thesis's StageDoorSensor: it compares the map with the world near the robot (E.1).

Where they differ, it notices with 90 percent, at each look. Beyond the thesis it also says, when
the robot comes near and then once a minute, that a door is as the map has it: who learns from the
log how often a door is open would otherwise hear of changes only, and doubt the door beside it.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from semmap_log.core.model.doors import DoorId

AGAIN_S = 60.0
"""So often it says that nothing has changed."""


@dataclass
class DoorSensor:
    """The sensor: what it noticed, it says."""

    rng: random.Random
    notices: float = 0.9
    """P(it notices a difference)."""
    _told_s: dict[DoorId, float] = field(default_factory=dict)
    """When it last said how a door is; only of those that have been near since."""

    def look(
        self,
        at_s: float,
        near: Iterable[DoorId],
        world: Mapping[DoorId, bool],
        known: Mapping[DoorId, bool],
    ) -> list[tuple[DoorId, bool]]:
        """Return (door, is open) of what it has to say.

        Args:
            at_s: When it looks.
            near: The doors near the robot, in an order that does not change.
            world: Whether each door stands open.
            known: The same, as the map has it; doors that the map lacks are passed over.
        """
        near = [door for door in near if door in known]
        self._told_s = {door: self._told_s[door] for door in near if door in self._told_s}
        told = [
            (door, world[door]) for door in near if self._says(at_s, door, world[door], known[door])
        ]
        self._told_s.update((door, at_s) for door, _ in told)
        return told

    def _says(self, at_s: float, door: DoorId, is_open: bool, was_open: bool) -> bool:  # noqa: FBT001
        if is_open != was_open:
            return self.rng.random() < self.notices
        return at_s - self._told_s.get(door, -math.inf) >= AGAIN_S
