"""Who goes where: a fixed round, the nearest door first, and ours, learnt or with the truth."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from patrol_eval.building import PatrolledBuilding
from patrol_eval.patrol_world import ENTER_S, PatrolWorld, RoundRules
from semmap_log.analysis.planning.door_chances import (
    STEP_S,
    DoorChances,
    PassingProjection,
    SkipRule,
    learnt_chances,
    round_times_s,
)
from semmap_log.analysis.planning.patrol_round import PatrolRound
from semmap_log.analysis.planning.round_task import RoundTask
from semmap_log.analysis.probabilities.belief_fold import BeliefProjection
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.model.events import DoorAdded, Event
from semmap_log.core.model.moments import SECOND_NS


@dataclass(frozen=True, slots=True)
class TryEnded:
    """What was found at a door."""

    door: int
    passed: bool
    now_s: float
    """Since the round began."""


class RoundPlan(Protocol):
    """A round under way."""

    def next_door(self) -> int | None:
        """Return the door to go to now; None: there is nothing left to try."""

    def tell(self, ended: TryEnded, /) -> None:
        """Take in what was found at a door."""


class RoundPlanner(Protocol):
    """Makes a plan for each round, and learns from what the rounds found."""

    def start(self, start_ns: int, /) -> RoundPlan:
        """Return the plan of a round that starts then."""

    def learn(self, events: Sequence[Event], /) -> None:
        """Take in what a round has sent to the log."""


@dataclass
class Fixed:
    """Always the same short tour; then the other doors of the rooms whose first was shut."""

    building: PatrolledBuilding
    tour: Sequence[int]
    """Places in `rooms`."""

    def start(self, _start_ns: int, /) -> RoundPlan:
        """Return the same plan as ever."""
        return _Listed(self.building, list(self.tour))

    def learn(self, _events: Sequence[Event], /) -> None:
        """Learn nothing."""


class _Listed:
    """A list of rooms, by their first doors; then by the others, always on to the nearest."""

    def __init__(self, building: PatrolledBuilding, rooms: list[int]) -> None:
        self._building = building
        self._first = [building.rooms[room].doors[0] for room in rooms]
        self._others: list[int] = []
        self._at: int | None = None
        self._others_of = {
            room.doors[0]: [*room.doors[1:2]] for room in (building.rooms[place] for place in rooms)
        }

    def next_door(self) -> int | None:
        if self._first:
            return self._first[0]
        return _nearest(self._building, self._at, self._others)

    def tell(self, ended: TryEnded, /) -> None:
        self._at = ended.door
        if self._first:
            self._first.pop(0)
            if not ended.passed:
                self._others += self._others_of[ended.door]
        else:
            self._others.remove(ended.door)


@dataclass
class NearestFirst:
    """Always on to the nearest door of a room that was not visited yet, each door once."""

    building: PatrolledBuilding

    def start(self, _start_ns: int, /) -> RoundPlan:
        """Return a plan that knows nothing."""
        return _Nearest(self.building)

    def learn(self, _events: Sequence[Event], /) -> None:
        """Learn nothing."""


class _Nearest:
    def __init__(self, building: PatrolledBuilding) -> None:
        self._building = building
        self._left = {door: room for room in building.rooms for door in room.doors}
        self._tries = {room.name: 0 for room in building.rooms}
        self._at: int | None = None

    def next_door(self) -> int | None:
        return _nearest(self._building, self._at, self._left)

    def tell(self, ended: TryEnded, /) -> None:
        room = self._left.pop(ended.door)
        self._at = ended.door
        self._tries[room.name] += 1
        if ended.passed or self._tries[room.name] == MOST_TRIES:
            for other in room.doors:
                self._left.pop(other, None)


MOST_TRIES = 2
"""At the doors of a room in a round."""


def _nearest(building: PatrolledBuilding, at: int | None, doors: Iterable[int]) -> int | None:
    legs_s = building.from_start_s if at is None else building.leg_s[at]
    return min(doors, key=lambda door: (float(legs_s[door]), door), default=None)


class _Ordered:
    """A round of ours."""

    def __init__(self, round_: PatrolRound) -> None:
        self._round = round_

    def next_door(self) -> int | None:
        planned = self._round.next_try()
        return None if planned is None else planned.door

    def tell(self, ended: TryEnded, /) -> None:
        self._round.tell(ended.door, passed=ended.passed, now_s=ended.now_s)


@dataclass
class _Ours:
    building: PatrolledBuilding
    rules: RoundRules
    skip: SkipRule

    def _plan(self, chances: DoorChances) -> RoundPlan:
        count = len(self.building)
        task = RoundTask(
            self.building.from_start_s, self.building.leg_s, chances.p_passes,
            np.full(count, ENTER_S), np.full(count, self.rules.fail_s),
            step_s=chances.step_s, budget_s=self.rules.budget_s,
        )  # fmt: skip
        skipped = self.skip.is_skipped(chances)
        return _Ordered(PatrolRound(task, self.building.rooms, skipped=skipped, sweeps=0))


class Learnt(_Ours):
    """Ours, by what it has learnt so far from its own rounds, as `patrol-plan` does."""

    def __init__(
        self, world: PatrolWorld, rules: RoundRules, skip: SkipRule,
        *, estimator: str = "filter", learn_every: int = 1,
    ) -> None:  # fmt: skip
        building = world.building
        super().__init__(building, rules, skip)
        self._end_ns = world.end_ns
        self._learn_every = learn_every
        self._waiting: list[Event] = []
        self._rounds = 0
        folds = PassingProjection if rules.asks else BeliefProjection
        self._fold = folds(estimator, building.tz)
        self._beliefs = self._fold.initial()
        ids = np.array(building.door_ids, np.uint32)
        self._beliefs = self._fold.apply(
            self._beliefs, EventBatch.of(DoorAdded, happened_ns=world.monday_ns, door_id=ids)
        )

    def start(self, start_ns: int, /) -> RoundPlan:
        """Return a plan by what is known then."""
        times_s = round_times_s(self.rules.budget_s)
        return self._plan(
            learnt_chances(
                self._beliefs, self.building.door_ids,
                known_ns=start_ns, start_ns=start_ns, times_s=times_s,
            )
        )  # fmt: skip

    def learn(self, events: Sequence[Event], /) -> None:
        """Take in a round's events, or keep them until the next time that it learns."""
        self._waiting += events
        self._rounds += 1
        if self._rounds % self._learn_every == 0:
            self._beliefs = self._fold.apply(self._beliefs, EventBatch.from_events(self._waiting))
            self._waiting = []
            self._beliefs.learnt(self._end_ns)  # once for all rounds until the next time


class Truthful(_Ours):
    """Ours, by the true schedule: what there is to gain by knowing habits."""

    def __init__(self, world: PatrolWorld, rules: RoundRules, skip_below: float) -> None:
        super().__init__(world.building, rules, SkipRule(skip_below))
        self._world = world

    def start(self, start_ns: int, /) -> RoundPlan:
        """Return a plan by how doors are at such hours."""
        times_s = round_times_s(self.rules.budget_s)
        times_ns = start_ns + (times_s * SECOND_NS).astype(np.int64)
        p_passes = np.array([self._chance(door, times_ns) for door in range(len(self.building))])
        count = len(self.building)
        return self._plan(
            DoorChances(
                p_passes, p_passes, p_passes, np.ones(count, np.bool_),
                looks=np.zeros((count, 2), np.int64), looks_high=p_passes.max(axis=1),
                unseen_s=np.zeros(count), step_s=STEP_S,
            )
        )  # fmt: skip

    def learn(self, _events: Sequence[Event], /) -> None:
        """Learn nothing: all is known."""

    def _chance(self, door: int, times_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        shares = self._world.shares(door, times_ns)
        if not self.rules.asks:
            return shares
        return np.where(self._world.unlocked(door, times_ns), 1.0, shares)
