"""Rounds of a robot that only looks at doors, for as many minutes each: who drives where."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from patrol_eval.building import PatrolledBuilding
from patrol_eval.patrol_rounds import starts
from patrol_eval.patrol_world import WEEK_NS, PatrolWorld
from semmap_log.analysis.planning.door_chances import (
    STEP_S,
    learnt_chances,
    round_times_s,
    unseen_s,
)
from semmap_log.analysis.planning.patrol_round import PatrolRound, PatrolTarget
from semmap_log.analysis.planning.round_task import RoundTask
from semmap_log.analysis.probabilities.belief_fold import BeliefProjection, Beliefs
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.events import DoorAdded, DoorObserved
from semmap_log.core.model.moments import SECOND_NS


class Looker(Protocol):
    """Says to which doors a round goes."""

    stays: bool
    """The robot begins where it stopped; False: at home."""
    learn_every: int
    """Rounds: it takes in what it saw after each so many."""

    def doors(self, beliefs: Beliefs, start_ns: int, at: int | None, /) -> Iterable[int]:
        """Yield the doors of a round that begins at a door, or at home, in their order."""


@dataclass
class Tour:
    """A short tour of all doors: each round goes on where the last one stopped, or begins anew."""

    tour: Sequence[int]
    stays: bool
    learn_every: int = 1

    def doors(self, _beliefs: Beliefs, _start_ns: int, at: int | None, /) -> Iterable[int]:
        """Return the tour, from the next door on."""
        first = 0 if at is None else self.tour.index(at) + 1
        return [*self.tour[first:], *self.tour[:first]]


@dataclass
class Planned:
    """As `patrol-plan`: doors that are likely open first, or those that nobody saw for long."""

    building: PatrolledBuilding
    budget_s: float
    by_age: bool
    stays: bool = True
    learn_every: int = 1

    def doors(self, beliefs: Beliefs, start_ns: int, at: int | None, /) -> Iterable[int]:
        """Return the plan of a round in which no door takes longer than the way there."""
        building, ids, times_s = self.building, self.building.door_ids, np.zeros(1)
        if self.by_age:
            unseen = unseen_s(beliefs, ids, known_ns=start_ns, start_ns=start_ns)
            weights = by_age(np.array(unseen))
        else:
            times_s = round_times_s(self.budget_s)
            weights = learnt_chances(
                beliefs, ids, known_ns=start_ns, start_ns=start_ns, times_s=times_s
            ).p_passes
        nothing = np.zeros(len(building))
        task = RoundTask(
            building.from_start_s if at is None else building.leg_s[at], building.leg_s, weights,
            nothing, nothing, step_s=STEP_S, budget_s=self.budget_s,
        )  # fmt: skip
        each = [PatrolTarget(name, (door,)) for door, name in enumerate(building.names)]
        return [planned.door for planned in PatrolRound(task, each, sweeps=0).plan()]


def by_age(unseen: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return weights (n, 1): the longer a door was not seen, the more; 1: never, or longest."""
    known = unseen[np.isfinite(unseen)]
    longest_s = max(float(known.max(initial=0.0)), 1.0)
    return np.minimum(unseen / longest_s, 1.0)[:, None]


def looked(world: PatrolWorld, looker: Looker, *, budget_s: float, weeks: int) -> Beliefs:
    """Return what a robot has learnt that has looked for some weeks."""
    building = world.building
    fold = BeliefProjection("filter", building.tz)
    ids = np.array(building.door_ids, np.uint32)
    added = EventBatch.of(DoorAdded, happened_ns=world.monday_ns, door_id=ids)
    beliefs, at = fold.apply(fold.initial(), added), None
    waiting, rounds = list[DoorObserved](), 0
    for week in range(weeks):
        for start_ns, _ in starts(world.monday_ns + week * WEEK_NS):
            begins = at if looker.stays else None
            seen = looks(world, looker.doors(beliefs, start_ns, begins), begins, start_ns, budget_s)
            at = building.door_ids.index(seen[-1].door_id) if seen else at
            waiting, rounds = [*waiting, *seen], rounds + 1
            if rounds % looker.learn_every == 0:
                beliefs, waiting = fold.apply(beliefs, EventBatch.from_events(waiting)), []
    return fold.apply(beliefs, EventBatch.from_events(waiting)) if waiting else beliefs


def looks(
    world: PatrolWorld, doors: Iterable[int], at: int | None, start_ns: int, budget_s: float
) -> list[DoorObserved]:
    """Return what a round sees that begins at a door, or at home, until its time is over.

    It comes to its first door, however far: who goes on where the last round stopped would else
    stay there for ever.
    """
    building, now_s, seen = world.building, 0.0, list[DoorObserved]()
    for door in doors:
        now_s += float((building.from_start_s if at is None else building.leg_s[at])[door])
        if seen and now_s > budget_s:
            break
        seen.append(world.look(door, start_ns + round(now_s * SECOND_NS)))
        at = door
    return seen
