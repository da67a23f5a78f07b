"""The building that is patrolled: its rooms, their doors, and how long it takes between doors."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from patrol_sim.clinic import HOME, LIFT

import semmap_log as sl
from semmap_log.analysis.planning.patrol_round import PatrolTarget
from semmap_log.analysis.rooms import OUTSIDE, Place, RoomId, RoomPlan, TravelTimes, room_plan
from semmap_log.core.model.doors import DoorId

CLINIC = Path(__file__).resolve().parents[3] / "recordings" / "clinic_week"
BEFORE_CHANGES = "2026-03-02T03:00"
"""In the recording no door has been added or walled up yet."""
HOME_LEVEL = 2
LEVELS = (1, 2)
RIDE_S = 45.0


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


def clinic() -> PatrolledBuilding:
    """Return the clinic's rooms that open from the hall of their level.

    The recording has no lift; it is put where the robot of the recording takes it.
    """
    log = sl.read(CLINIC)
    plan = room_plan(log, at=BEFORE_CHANGES)
    halls = _halls(plan)
    rooms = {
        room: doors
        for room in plan.graph.rooms
        if room not in halls and (doors := _doors_from(plan, room, halls))
    }
    ids = sorted(door for doors in rooms.values() for door in doors)
    times = TravelTimes.of_plan(plan)
    before = [_before(plan, times, door, halls) for door in ids]
    shut = set(ids)  # it does not go through rooms to save a way
    where = {door: place for place, door in enumerate(ids)}
    return PatrolledBuilding(
        tuple(ids),
        tuple(plan.door_map[door].label for door in ids),
        tuple(
            PatrolTarget(f"room {room}", tuple(where[door] for door in doors))
            for room, doors in rooms.items()
        ),
        _times_s(times, [Place(HOME_LEVEL, *HOME)], before, shut)[0],
        _times_s(times, before, before, shut),
        log.info.timezone,
    )


def _halls(plan: RoomPlan) -> set[RoomId]:
    """Return the room of most doors of each level."""
    graph = plan.graph
    return {
        max(
            (room.room_id for room in graph.rooms.values() if room.level == level),
            key=lambda room: len(graph.doors_of(room)),
        )
        for level in plan.levels
    }


def _doors_from(plan: RoomPlan, room: RoomId, halls: set[RoomId]) -> list[DoorId]:
    """Return the doors that lead into a room from a hall."""
    graph = plan.graph
    doors = graph.doors_of(room)
    return [door for door in doors if graph.doorways[door].beyond(room) in halls - {OUTSIDE}]


def _before(plan: RoomPlan, times: TravelTimes, door: DoorId, halls: set[RoomId]) -> Place:
    """Return where the robot stands in the hall before a door."""
    left, right = times.before(door)
    place = left if plan.graph.doorways[door].left in halls else right
    assert place is not None, f"no floor before door {door}"
    return place


def _times_s(
    times: TravelTimes, sources: list[Place], targets: list[Place], shut: set[DoorId]
) -> NDArray[np.float64]:
    """Return how long it takes, by the lift where it must be."""
    found = times.between(sources, targets, shut)
    for one, other in permutations(LEVELS):
        to_lift = times.between(sources, [Place(one, *LIFT)], shut)
        onward = times.between([Place(other, *LIFT)], targets, shut)
        found = np.minimum(found, to_lift + RIDE_S + onward)
    return found
