"""One world, patrolled for some weeks by each planner: what each was worth, week by week."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from patrol_eval.building import PatrolledBuilding, clinic
from patrol_eval.patrol_planners import (
    Fixed,
    Learnt,
    NearestFirst,
    RoundPlanner,
    Truthful,
)
from patrol_eval.patrol_rounds import rounds_of
from patrol_eval.patrol_scores import RoundScores, scored
from patrol_eval.patrol_world import PatrolWorld, RoundRules
from patrol_eval.short_tour import short_tour
from semmap_log.analysis.planning.door_chances import SkipRule

LOCKED = 0.05
"""With the true schedule a door is left out below that share."""


@dataclass(frozen=True)
class TrialOptions:
    """What is tried."""

    rules: RoundRules = field(default_factory=RoundRules)
    weeks: int = 2
    planners: tuple[str, ...] = ("fixed", "nearest", "ours", "true")
    skip: SkipRule = field(default_factory=SkipRule)
    estimator: str = "filter"
    learn_every: int = 1
    """Rounds: ours takes in what it met after each so many; more are quicker, and no better."""


@lru_cache(1)
def the_building() -> tuple[PatrolledBuilding, list[int]]:
    """Return the clinic, and the tour of the fixed round: places in its rooms."""
    building = clinic()
    first = [room.doors[0] for room in building.rooms]
    tour = short_tour(building.from_start_s[first], building.leg_s[np.ix_(first, first)])
    return building, tour


def tried(seed: int, options: TrialOptions) -> dict[str, Any]:
    """Return the scores of each planner in the world of a seed: planner -> a list of weeks."""
    building, tour = the_building()
    world = PatrolWorld(building, seed, weeks=options.weeks)
    made = _planners(world, tour, options)
    reachable: dict[int, list[bool]] = {}
    return {
        "seed": seed,
        "planners": {
            name: [
                asdict(_week(world, planner, options.rules, week, reachable))
                for week in range(options.weeks)
            ]
            for name in options.planners
            for planner in [made[name]()]
        },
    }


def _planners(
    world: PatrolWorld, tour: list[int], options: TrialOptions
) -> Mapping[str, Callable[[], RoundPlanner]]:
    building, rules = world.building, options.rules
    return {
        "fixed": lambda: Fixed(building, tour),
        "nearest": lambda: NearestFirst(building),
        "ours": lambda: Learnt(
            world, rules, options.skip,
            estimator=options.estimator, learn_every=options.learn_every,
        ),
        "all": lambda: Learnt(
            world, rules, SkipRule(0.0),
            estimator=options.estimator, learn_every=options.learn_every,
        ),
        "true": lambda: Truthful(world, rules, LOCKED),
    }  # fmt: skip


def _week(
    world: PatrolWorld, planner: RoundPlanner, rules: RoundRules, week: int,
    reachable: dict[int, list[bool]],
) -> RoundScores:  # fmt: skip
    total = RoundScores()
    for made in rounds_of(world, planner, rules, week=week):
        if made.start_ns not in reachable:
            reachable[made.start_ns] = world.reachable(made.start_ns, rules)
        total += scored(world, made, rules, reachable[made.start_ns])
    return total
