"""What a robot's camera makes of a door: a sighting, right as often as its accuracies say."""

from __future__ import annotations

import random
from dataclasses import dataclass

from patrol_sim.world import World
from semmap_log.core.model.doors import NAN, DoorId, DoorState
from semmap_log.core.model.events import DoorObserved


@dataclass(frozen=True, slots=True)
class Sensor:
    """What tells open doors from closed ones, and how often it is right."""

    source: str
    accuracy_open: float
    accuracy_closed: float
    measures_opening: bool = False
    blinded: float = 0.004
    """Share of looks in which somebody stands in the way."""
    errs: bool = True
    """False: this time it happens to be right, however accurate it says it is."""

    def look(self, door_id: DoorId, world: World, at_ns: int, rng: random.Random) -> DoorObserved:
        """Return a sighting, right or wrong, of how a door stands then."""
        state = world.state(door_id, at_ns)
        seen = self._read(state, rng) if self.errs else state
        opening = NAN
        if self.measures_opening and seen.is_known:
            opening = world.opening(door_id, at_ns) if seen is DoorState.OPEN else 0.0
        return DoorObserved(
            happened_ns=at_ns, door_id=door_id, state=seen, opening=opening,
            accuracy_open=self.accuracy_open, accuracy_closed=self.accuracy_closed,
        )  # fmt: skip

    def _read(self, state: DoorState, rng: random.Random) -> DoorState:
        if rng.random() < self.blinded:
            return DoorState.UNKNOWN
        if state is DoorState.OPEN and rng.random() >= self.accuracy_open:
            return DoorState.CLOSED
        if state is DoorState.CLOSED and rng.random() >= self.accuracy_closed:
            return DoorState.OPEN
        return state
