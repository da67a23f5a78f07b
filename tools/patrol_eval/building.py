"""The building that is patrolled: its rooms, their doors, and how long it takes between doors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.domain.doors import DoorId
from semmap_log.planning.patrol_round import PatrolTarget


@dataclass(frozen=True, eq=False)
class PatrolledBuilding:
    """A building; the robot is in its halls, from which all rooms open."""

    door_ids: tuple[DoorId, ...]
    names: tuple[str, ...]
    rooms: tuple[PatrolTarget, ...]
    """Their doors are places in `door_ids`."""
    from_start_s: NDArray[np.float64]
    """(n,)."""
    leg_s: NDArray[np.float64]
    """(n, n)."""
    tz: str

    def __len__(self) -> int:
        return len(self.door_ids)
