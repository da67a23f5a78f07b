"""Which goal to go to next: as they come, the nearest, or the first of the best order of all."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from navigation.floors import Floor, Point
from navigation.goals import Goal
from navigation.move_base import CONTROLLER_PATIENCE_S, TURN_S, MoveBase
from navigation.robot import SPEED_M_S, Robot
from navigation.ways import Way
from semmap_log.analysis.planning.best_order import best_order
from semmap_log.analysis.planning.round_task import RoundTask
from semmap_log.analysis.rooms.walking import WalkingDistances
from semmap_log.core.model.doors import Door, DoorState

FAIL_S = CONTROLLER_PATIENCE_S + 2 * TURN_S
"""What it costs to be given up before a shut door."""


class GoalOrder(Protocol):
    """Chooses out of a window of goals."""

    window: int
    """So many goals it wants to know at a time."""

    def choose(self, goals: Sequence[Goal]) -> Goal:
        """Return the goal to go to now."""


class AsGiven:
    """The thesis's: one goal at a time."""

    window = 1

    def choose(self, goals: Sequence[Goal]) -> Goal:
        """Return the first."""
        return goals[0]


class _Choosing:
    """Chooses among goals to which the robot knows a way.

    One to which it knows none is sent at once, the first of them first, and is given up where the
    robot stands: else such goals would fill the window, and leave nothing to choose from.
    """

    def __init__(self, robot: Robot, move_base: MoveBase, window: int) -> None:
        """Choose for a robot."""
        self.window = window
        self._robot, self._move_base = robot, move_base

    def choose(self, goals: Sequence[Goal]) -> Goal:
        """Return the goal to go to now."""
        for goal in goals:
            if not self._move_base.knows_way(goal.place):
                return goal
        return self.best(goals)

    @abstractmethod
    def best(self, goals: Sequence[Goal]) -> Goal:
        """Return one of some goals to which ways lead."""


class NearestFirst(_Choosing):
    """The goal with the shortest way, by all that the robot knows."""

    def best(self, goals: Sequence[Goal]) -> Goal:
        """Return the nearest; those are not looked at that are too far away to be it."""
        best, best_m = goals[0], math.inf
        for goal in sorted(goals, key=lambda goal: (self._air_m(goal), goal.number)):
            if self._air_m(goal) >= best_m:
                break
            way = self._move_base.plan(goal.place)
            if way is not None and way.length_m < best_m:
                best, best_m = goal, way.length_m
        return best

    def _air_m(self, goal: Goal) -> float:
        return math.dist(goal.place, self._robot.place)


class PatrolOrder(_Choosing):
    """The first goal of the order in which the mean time to reach a goal is least.

    It is `patrol-plan`'s order (`semmap_log.analysis.planning`) of all goals that are known. P of a
    goal is that of all doors on the way to it from here, when one comes to them.
    """

    def __init__(self, robot: Robot, move_base: MoveBase, window: int) -> None:
        """Choose for a robot."""
        super().__init__(robot, move_base, window)
        self._walking = walking_on(robot.floor)

    def best(self, goals: Sequence[Goal]) -> Goal:
        """Return the goal to begin with."""
        ways = [way for goal in goals if (way := self._move_base.plan(goal.place)) is not None]
        assert len(ways) == len(goals), "to each of these a way is known"
        order = best_order(self.task([goal.place for goal in goals], ways))
        return goals[int(order[0])]

    def task(self, places: Sequence[Point], ways: Sequence[Way]) -> RoundTask:
        """Return the round of some places, and the ways to them from here."""
        leg_m = self._walking.between(places, places, self._robot.shut)
        lengths_m = np.array([way.length_m for way in ways])
        # A goal in too narrow a place for the coarser cells of the walk is reached by way of here.
        leg_m = np.where(np.isfinite(leg_m), leg_m, lengths_m[:, None] + lengths_m)
        p_passes = np.array([self._p_passes(way) for way in ways])
        return RoundTask.fixed(
            lengths_m / SPEED_M_S, leg_m / SPEED_M_S, p_passes, enter_s=0.0, fail_s=FAIL_S
        )

    def _p_passes(self, way: Way) -> float:
        floor, now_s, p_open = self._robot.floor, self._robot.now_s, self._robot.shares.p_open
        return math.prod(
            p_open(now_s + crossing.along_m / SPEED_M_S, crossing.door)
            for crossing in way.crossings(floor)
        )


def walking_on(floor: Floor) -> WalkingDistances:
    """Return what the way between two places of a floor is, on foot."""
    doors = [
        Door(door.door_id, floor.plan.level, door.x, door.y, door.theta, door.width,
             DoorState.UNKNOWN, math.nan, math.nan)
        for door in floor.doors
    ]  # fmt: skip
    return WalkingDistances(floor.plan.floor, doors)


def order_of(name: str, robot: Robot, move_base: MoveBase, window: int) -> GoalOrder:
    """Return the order of that name: `given`, `nearest` or `patrol`."""
    if name == "given":
        return AsGiven()
    return {"nearest": NearestFirst, "patrol": PatrolOrder}[name](robot, move_base, window)
