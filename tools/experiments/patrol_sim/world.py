"""The building as it is: its doors by name, how each really stands, and what its plan says."""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from patrol_sim.habits import HOUR_NS, DoorTruth, Habit
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorAnnotated, Event, FloorMap


@dataclass(slots=True)
class World:
    """What is true, whoever knows it. Times are nanoseconds, UTC."""

    monday_ns: int
    """Local midnight with which the simulated week begins."""
    doors: dict[DoorId, DoorAdded]
    floors: Mapping[int, FloorMap]
    names: dict[DoorId, str]
    truths: dict[DoorId, DoorTruth] = field(default_factory=dict)
    habits: dict[DoorId, Habit] = field(default_factory=dict)
    built_ns: dict[DoorId, int] = field(default_factory=dict)
    """When doors came that the plan does not have."""
    gone_ns: dict[DoorId, int] = field(default_factory=dict)
    """When doors were walled up."""

    @classmethod
    def from_plan(cls, plan: Iterable[Event], monday_ns: int) -> World:
        """Return the building that an imported plan describes; nothing has moved in it yet."""
        world = cls(monday_ns, {}, {}, {})
        floors = {}
        for event in plan:
            match event:
                case DoorAdded():
                    world.doors[event.door_id] = event
                case DoorAnnotated(key="name"):
                    world.names[event.door_id] = event.value
                case FloorMap():
                    floors[event.level] = event
        world.floors = floors
        return world

    def named(self, name: str) -> DoorId:
        """Return the door of that name."""
        return next(door_id for door_id, known in self.names.items() if known == name)

    def moment(self, day: int, clock: str) -> int:
        """Return the moment of a clock time such as 07:45 on a day of the week, 0 = Monday."""
        hours, minutes = map(int, clock.split(":"))
        return self.monday_ns + (day * 24 + hours) * HOUR_NS + minutes * 60 * 10**9

    def exists(self, door_id: DoorId, at_ns: int) -> bool:
        """Tell whether the door was there then."""
        return self.built_ns.get(door_id, 0) <= at_ns < self.gone_ns.get(door_id, at_ns + 1)

    def state(self, door_id: DoorId, at_ns: int) -> DoorState:
        """Return how the door really stands; MOVING in the seconds around a change."""
        truth = self.truths[door_id]
        if at_ns - truth.last_change_ns(at_ns) < MOVES_NS:
            return DoorState.MOVING
        return truth.state(at_ns)

    def opening(self, door_id: DoorId, at_ns: int) -> float:
        """Return how far an open door stands open: chosen anew each time that it is opened."""
        since_ns = self.truths[door_id].last_change_ns(at_ns)
        return random.Random(f"{door_id} {since_ns}").randint(16, 32) / 32

    def is_locked(self, door_id: DoorId, at_ns: int) -> bool:
        """Tell whether nobody would open the door at that hour."""
        habit = self.habits.get(door_id)
        return habit is not None and habit.is_locked((at_ns - self.monday_ns) / HOUR_NS)


MOVES_NS = 3 * 10**9
"""A door takes this long to open or close."""
