"""What rounds were worth: visits, failed approaches, and when the reachable rooms were visited."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

from patrol_eval.patrol_rounds import RoundMade
from patrol_eval.patrol_world import PatrolWorld, RoundRules


@dataclass(frozen=True)
class RoundScores:
    """Sums over rounds, in the order of the table; a share of two is a figure."""

    failed: int = 0
    """Approaches to a door that did not let the robot in."""
    failed_workdays: int = 0
    reachable: int = 0
    """Rooms with a door that lets the robot in for 90 % of the round."""
    reached: int = 0
    """Of these, those that were visited."""
    visited: int = 0
    """Rooms, reachable or not."""
    latency_s: float = 0.0
    """Sum over reachable rooms of when they were visited; not at all counts as the round's end."""
    last_s: float = 0.0
    """Sum over rounds of when the last reachable room was visited."""
    driving_s: float = 0.0
    rounds: int = 0

    def __add__(self, other: RoundScores) -> RoundScores:
        """Return the sums of both."""
        names = [field.name for field in fields(self)]
        return RoundScores(**{name: getattr(self, name) + getattr(other, name) for name in names})


def scored(
    world: PatrolWorld, made: RoundMade, rules: RoundRules, reachable: Sequence[bool]
) -> RoundScores:
    """Return what a round was worth."""
    room_of = {door: place for place, room in enumerate(world.building.rooms)
               for door in room.doors}  # fmt: skip
    visits = {room_of[one.door]: one.at_s for one in made.tries if one.passed}
    times_s = [visits.get(place, rules.budget_s) for place, is_it in enumerate(reachable) if is_it]
    failed = sum(not one.passed for one in made.tries)
    return RoundScores(
        failed=failed,
        failed_workdays=failed * made.is_workday,
        reachable=sum(reachable),
        reached=sum(is_it and place in visits for place, is_it in enumerate(reachable)),
        visited=len(visits),
        latency_s=sum(times_s),
        last_s=max(times_s, default=0.0),
        driving_s=made.driving_s,
        rounds=1,
    )
