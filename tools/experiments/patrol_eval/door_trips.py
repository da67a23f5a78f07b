"""Trips from room to room: how long ours take against an oracle that knows each door's rates."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from patrol_sim.habits import HOUR_NS, SLOTS, Habit

from patrol_eval.building import PatrolledBuilding
from patrol_eval.patrol_planners import NearestFirst
from patrol_eval.patrol_report import interval
from patrol_eval.patrol_rounds import rounds_of
from patrol_eval.patrol_trials import the_building
from patrol_eval.patrol_world import WEEK_NS, PatrolWorld, RoundRules
from semmap_log.analysis.planning.door_chances import learnt_chances
from semmap_log.analysis.planning.door_trip import with_mean
from semmap_log.analysis.planning.round_task import (
    GOAL,
    NOTHING,
    START,
    AtShutDoor,
    TripDoor,
    TripPolicy,
    TripTask,
    given_up,
    opened,
)
from semmap_log.analysis.probabilities.belief_fold import BeliefProjection, Beliefs
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import DoorAdded
from semmap_log.core.model.moments import SECOND_NS

TRIPS = 1000
IN_ROOM_S, CROSS_S = 3.0, 2.0
PATIENCE_S = 3600.0
"""So long a robot waits at a door at most; then the trip ends there."""
FIRST_H, LAST_H = 7.0, 17.0
"""Trips begin between these hours of working days: later some doors are locked till morning."""
SLOT_S = 1800.0


@dataclass(frozen=True)
class TripAsked:
    """A trip."""

    at_ns: int
    source: int
    """Places in the building's rooms."""
    target: int


def trips_tried(seed: int, learning_weeks: int) -> dict[str, Any]:
    """Return the times of the trips of a seed, seconds: ours, the oracle's, and walking alone."""
    building, _ = the_building()
    world = PatrolWorld(building, seed, weeks=learning_weeks + 1)
    beliefs = _learnt(world, learning_weeks)
    beliefs.learnt(world.monday_ns + (learning_weeks + 1) * WEEK_NS)  # once for all trips
    marginals = [_marginal(habit) for habit in world.habits]
    times: dict[str, list[float]] = {"ours": [], "oracle": [], "walking": [], "expected": []}
    for trip in asked_for(world, seed, learning_weeks):
        doors = [*building.rooms[trip.source].doors, *building.rooms[trip.target].doors]
        ours = _policy(building, trip, doors, _as_learnt(beliefs, building, doors, trip.at_ns))
        true = [_true_door(world, marginals[door], door, trip.at_ns) for door in doors]
        oracle = _policy(building, trip, doors, true)
        free = _policy(building, trip, doors, [TripDoor(1.0, 0.0)] * len(doors))
        times["ours"].append(driven_s(world, ours, doors, trip.at_ns))
        times["oracle"].append(driven_s(world, oracle, doors, trip.at_ns))
        times["walking"].append(free.expected_s)
        times["expected"].append(oracle.expected_s)
    return {"seed": seed, **{name: float(np.mean(each)) for name, each in times.items()}}


def trips_report(trials: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return how much longer ours take than the oracle's, percent, with a 95 % interval."""
    names = ("walking", "oracle", "expected", "ours")
    return {
        "seeds": [trial["seed"] for trial in trials],
        "trips a seed": TRIPS,
        "mean_s": {name: float(np.mean([trial[name] for trial in trials])) for name in names},
        "ours against the oracle, %": interval(
            [(trial["ours"] / trial["oracle"] - 1) * 100 for trial in trials]
        ),
    }


def print_trips(found: dict[str, Any]) -> None:
    """Print it for people."""
    print(f"{len(found['seeds'])} seeds, {found['trips a seed']} trips each, mean seconds:")
    for name, seconds in found["mean_s"].items():
        print(f"  {name:10}{seconds:10.1f}")
    each = found["ours against the oracle, %"]
    print(f"  ours against the oracle: {each['mean']:+.1f} +- {each['half_width']:.1f} %")


def asked_for(world: PatrolWorld, seed: int, week: int) -> list[TripAsked]:
    """Return the trips of a week: working days, from room to room of a level."""
    rng = random.Random(f"trips {seed}")
    building = world.building
    level_of = [building.names[room.doors[0]][:2] for room in building.rooms]
    trips = list[TripAsked]()
    while len(trips) < TRIPS:
        source, target = rng.sample(range(len(building.rooms)), 2)
        hour = 24 * rng.randrange(5) + rng.uniform(FIRST_H, LAST_H)
        at_ns = world.monday_ns + week * WEEK_NS + round(hour * HOUR_NS)
        if level_of[source] == level_of[target]:
            trips.append(TripAsked(at_ns, source, target))
    return trips


def driven_s(world: PatrolWorld, policy: TripPolicy, doors: Sequence[int], at_ns: int) -> float:
    """Return how long a trip takes that follows a policy, past the doors as they really are."""
    place, found, now_s = START, NOTHING, 0.0
    while True:
        target, takes_s = policy.next_place(place, found)
        if target == GOAL and math.isfinite(takes_s):
            return now_s + policy.walk_s(place, GOAL, found)
        if target == GOAL:  # nobody knows how long: on to the nearest door, and wait
            target = _nearest_side(policy, place, found, len(doors))
        now_s += policy.walk_s(place, target, found)
        door = TripTask.door_at(target)
        waited_s = _until_open_s(world, doors[door], at_ns + round(now_s * SECOND_NS))
        choice = policy.when_shut(target, found).best
        if waited_s > 0 and choice is AtShutDoor.ROUND:
            place, found = target, given_up(found, door)
            continue
        if waited_s >= PATIENCE_S:
            return now_s + PATIENCE_S
        now_s += waited_s + CROSS_S
        place, found = TripTask.other_side(target), opened(found, door)


def _nearest_side(policy: TripPolicy, place: int, found: Any, count: int) -> int:
    sides = [
        side
        for door in range(count)
        if door not in found[0]
        for side in TripTask.sides(door)
        if math.isfinite(policy.walk_s(place, side, found))
    ]
    return min(sides, key=lambda side: policy.walk_s(place, side, found))


def _until_open_s(world: PatrolWorld, door: int, at_ns: int) -> float:
    """Return how long until a door opens, at most as long as the patience."""
    truth = world.truths[door]
    if truth.state(at_ns) is DoorState.OPEN:
        return 0.0
    changes = truth.changes(at_ns, at_ns + round(PATIENCE_S * SECOND_NS))
    opens = [when for when, state in changes if state is DoorState.OPEN]
    return (opens[0] - at_ns) / SECOND_NS if opens else PATIENCE_S


def _policy(
    building: PatrolledBuilding, trip: TripAsked, doors: list[int], known: list[TripDoor]
) -> TripPolicy:
    """Return the policy of a trip: a door's first side is in its room, its other in the hall."""
    sources = len(building.rooms[trip.source].doors)
    places = 2 + 2 * len(doors)
    walk_s = np.full((places, places), np.inf)
    for one, door in enumerate(doors):
        inside, hall = TripTask.sides(one)
        end = START if one < sources else GOAL
        walk_s[end, inside] = walk_s[inside, end] = IN_ROOM_S
        for other, there in enumerate(doors):
            if one != other:
                walk_s[hall, TripTask.sides(other)[1]] = building.leg_s[door, there]
    return TripPolicy(TripTask(walk_s, np.full(len(doors), CROSS_S), tuple(known)))


def _learnt(world: PatrolWorld, weeks: int) -> Beliefs:
    """Return what rounds to the nearest door first teach."""
    fold = BeliefProjection("filter", world.building.tz)
    ids = np.array(world.building.door_ids, np.uint32)
    added = EventBatch.of(DoorAdded, happened_ns=world.monday_ns, door_id=ids)
    beliefs = fold.apply(fold.initial(), added)
    for week in range(weeks):
        for made in rounds_of(world, NearestFirst(world.building), RoundRules(), week=week):
            beliefs = fold.apply(beliefs, EventBatch.from_events(made.events))
    return beliefs


def _as_learnt(
    beliefs: Beliefs, building: PatrolledBuilding, doors: list[int], at_ns: int
) -> list[TripDoor]:
    ids = [building.door_ids[door] for door in doors]
    chances = learnt_chances(beliefs, ids, known_ns=at_ns, start_ns=at_ns, times_s=np.zeros(1))
    learnt: Any = beliefs.learnt()
    p_open = chances.p_passes[:, 0].tolist()
    waits_s = [
        learnt.wait_s(door_id, at_ns, most_s=PATIENCE_S, is_other=True) if known else None
        for door_id, known in zip(ids, chances.is_known.tolist(), strict=True)
    ]
    known_s = with_mean(waits_s)
    return [TripDoor(p, wait_s) for p, wait_s in zip(p_open, known_s, strict=True)]


def _marginal(habit: Habit) -> NDArray[np.float64]:
    """Return P(open) at the beginning of each half hour of the week, by the true rates."""
    p_open, found = habit.share[0], np.zeros(SLOTS)
    for slot in range(2 * SLOTS):
        found[slot % SLOTS] = p_open
        opening, closing = _rates(habit, slot)
        share = opening / (opening + closing)
        p_open = share + (p_open - share) * math.exp(-(opening + closing) * SLOT_S)
    return found


def _rates(habit: Habit, slot: int) -> tuple[float, float]:
    """Return how often a shut door opens, and an open one shuts, per second."""
    opening = habit.leaving_rate(DoorState.CLOSED, slot) / 3600
    return opening, habit.leaving_rate(DoorState.OPEN, slot) / 3600


def _true_door(
    world: PatrolWorld, marginal: NDArray[np.float64], door: int, at_ns: int
) -> TripDoor:
    habit = world.habits[door]
    half_hours = (at_ns - world.monday_ns) / (HOUR_NS / 2)
    slot, gone_s = int(half_hours), (half_hours % 1) * SLOT_S
    opening, closing = _rates(habit, slot)
    share = opening / (opening + closing)
    before = marginal[slot % SLOTS]
    p_open = share + (before - share) * math.exp(-(opening + closing) * gone_s)
    wait_s, left, now_s = 0.0, 1.0, 0.0
    while now_s < PATIENCE_S:
        step_s = min(SLOT_S - gone_s, PATIENCE_S - now_s)
        opening = _rates(habit, slot)[0]
        wait_s += left * -math.expm1(-opening * step_s) / opening
        left *= math.exp(-opening * step_s)
        slot, gone_s, now_s = slot + 1, 0.0, now_s + step_s
    return TripDoor(float(p_open), wait_s)
