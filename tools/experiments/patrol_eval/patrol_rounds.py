"""Rounds, one after the other, for a week: where the robot went, and what it met there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from patrol_sim.habits import HOUR_NS

from patrol_eval.patrol_planners import RoundPlanner, TryEnded
from patrol_eval.patrol_world import WEEK_NS, PatrolWorld, RoundRules
from semmap_log.core.model.events import Event
from semmap_log.core.model.moments import SECOND_NS

WORKDAY_ROUNDS = (0, 3, *range(6, 19))
WEEKEND_ROUNDS = (0, 4, 7, 9, 11, 13, 15, 17, 19, 22)
WORKDAYS = range(5)
DAYS = 7


@dataclass(frozen=True)
class TryMade:
    """A door that was tried."""

    door: int
    at_s: float
    """Since the round began."""
    passed: bool


@dataclass(frozen=True)
class RoundMade:
    """A round, as it went."""

    start_ns: int
    is_workday: bool
    tries: tuple[TryMade, ...]
    driving_s: float
    events: tuple[Event, ...]


def rounds_of(
    world: PatrolWorld, planner: RoundPlanner, rules: RoundRules, *, week: int = 0
) -> Iterator[RoundMade]:
    """Yield the rounds of a week; after each the planner has learnt what it found."""
    for start_ns, is_workday in starts(world.monday_ns + week * WEEK_NS):
        made = _made(world, planner, rules, start_ns, is_workday=is_workday)
        planner.learn(made.events)
        yield made


def starts(monday_ns: int) -> list[tuple[int, bool]]:
    """Return when the rounds of a week start, and whether that is on a working day: 95."""
    return [
        (monday_ns + (24 * day + hour) * HOUR_NS, day in WORKDAYS)
        for day in range(DAYS)
        for hour in (WORKDAY_ROUNDS if day in WORKDAYS else WEEKEND_ROUNDS)
    ]


def _made(
    world: PatrolWorld, planner: RoundPlanner, rules: RoundRules, start_ns: int, *, is_workday: bool
) -> RoundMade:
    """Return a round: from door to door until nothing is left to try, or the time is over."""
    plan = planner.start(start_ns)
    building, at, now_s, driving_s = world.building, None, 0.0, 0.0
    tries, events = list[TryMade](), list[Event]()
    while (door := plan.next_door()) is not None:
        leg_s = float((building.from_start_s if at is None else building.leg_s[at])[door])
        if now_s + leg_s > rules.budget_s:
            break
        now_s, driving_s = now_s + leg_s, driving_s + leg_s
        met = world.try_door(door, start_ns + round(now_s * SECOND_NS), rules)
        tries.append(TryMade(door, now_s, met.passed))
        events += met.events
        now_s += met.took_s
        plan.tell(TryEnded(door, met.passed, now_s))
        at = door
    return RoundMade(start_ns, is_workday, tuple(tries), driving_s, tuple(events))
