"""What a robot that only looks has learnt: how well it forecasts the week after."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from patrol_sim.habits import HOUR_NS

from patrol_eval.building import PatrolledBuilding
from patrol_eval.looking_rounds import Looker, Planned, Tour, looked
from patrol_eval.patrol_report import interval
from patrol_eval.patrol_trials import the_building
from patrol_eval.patrol_world import WEEK_NS, PatrolWorld
from patrol_eval.short_tour import short_tour
from semmap_log.analysis.planning.door_chances import UNKNOWN_P
from semmap_log.analysis.probabilities.belief_fold import Beliefs
from semmap_log.core.model.doors import DoorState

EVERY_NS = HOUR_NS // 2
"""The week after is asked for that often."""
CONTINUING = "goes on where it stopped"
TRUE = "true schedule"


def learning_tried(
    seed: int, *, weeks: int, budget_s: float, learn_every: int = 1
) -> dict[str, Any]:
    """Return the Brier score of each looker in the world of a seed, and the true schedule's."""
    building, _ = the_building()
    world = PatrolWorld(building, seed, weeks=weeks + 1)
    times_ns = world.monday_ns + weeks * WEEK_NS + np.arange(0, WEEK_NS, EVERY_NS, dtype=np.int64)
    happened = np.array([_states(world, door, times_ns) for door in range(len(building))])
    true = np.array([world.shares(door, times_ns) for door in range(len(building))])
    brier = {TRUE: _brier(true, happened)}
    for name, looker in _lookers(building, budget_s, learn_every).items():
        beliefs = looked(world, looker, budget_s=budget_s, weeks=weeks)
        known_ns = int(times_ns[0])
        brier[name] = _brier(forecasts(beliefs, building, times_ns, known_ns), happened)
    return {"seed": seed, "brier": brier}


def _lookers(building: PatrolledBuilding, budget_s: float, learn_every: int) -> dict[str, Looker]:
    tour = short_tour(building.from_start_s, building.leg_s)
    return {
        CONTINUING: Tour(tour, stays=True),
        "fixed, from home": Tour(tour, stays=False),
        "ours, likely open first": Planned(
            building, budget_s, by_age=False, learn_every=learn_every
        ),
        "ours, longest unseen first": Planned(building, budget_s, by_age=True),
    }


def forecasts(
    beliefs: Beliefs, building: PatrolledBuilding, times_ns: NDArray[np.int64], known_ns: int
) -> NDArray[np.float64]:
    """Return P of each door, row, at each time; a door of which too little is known as others."""
    known = np.full(len(times_ns), known_ns)
    said = [beliefs.predict(door, times_ns, known) for door in building.door_ids]
    p_open = np.array([each.p_open for each in said])
    is_known = np.array([each.is_known for each in said])
    counts = is_known.sum(axis=0)
    sums = np.where(is_known, p_open, 0.0).sum(axis=0)
    others = np.where(counts > 0, sums / np.maximum(counts, 1), UNKNOWN_P)
    return np.where(is_known, p_open, others)


def _states(world: PatrolWorld, door: int, times_ns: NDArray[np.int64]) -> NDArray[np.float64]:
    truth = world.truths[door]
    return np.array([truth.state(at) is DoorState.OPEN for at in times_ns.tolist()], np.float64)


def _brier(p_open: NDArray[np.float64], happened: NDArray[np.float64]) -> float:
    return float(((p_open - happened) ** 2).mean())


def learning_report(trials: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return means, and differences from the tour that goes on, percent, paired by seed."""
    names = list(trials[0]["brier"])
    of = {name: np.array([trial["brier"][name] for trial in trials]) for name in names}
    floor, base = of[TRUE], of[CONTINUING]
    return {
        "seeds": [trial["seed"] for trial in trials],
        "brier": {name: float(each.mean()) for name, each in of.items()},
        "differences": {
            name: {
                "brier, %": interval((of[name] / base - 1) * 100),
                "excess over the true schedule, %": interval(
                    ((of[name] - floor) / (base - floor) - 1) * 100
                ),
            }
            for name in names
            if name not in {TRUE, CONTINUING}
        },
    }


def print_learning(found: dict[str, Any]) -> None:
    """Print it for people."""
    print(f"{len(found['seeds'])} seeds, Brier score of the next week's forecast:")
    for name, score in found["brier"].items():
        print(f"  {name:28}{score:8.4f}")
    print(f"against the tour that {CONTINUING}, paired, 95 % interval:")
    for name, figures in found["differences"].items():
        for figure, each in figures.items():
            print(f"  {name:28}{figure:36}{each['mean']:+7.1f} +- {each['half_width']:.1f}")
