"""Which goal to go to next: as they come, the nearest, or the one most worth its time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

from navigation.goals import Goal
from navigation.move_base import CONTROLLER_PATIENCE_S, TURN_S, MoveBase
from navigation.robot import SPEED_M_S, Robot
from navigation.ways import Way

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


class ByValue:
    """The goal of the greatest value, by the ways that the robot would take now.

    Goals to which it knows no way come last, the first of them first.
    """

    def __init__(self, robot: Robot, move_base: MoveBase, window: int) -> None:
        """Choose for a robot."""
        self.window = window
        self._robot, self._move_base = robot, move_base

    def choose(self, goals: Sequence[Goal]) -> Goal:
        """Return the best goal; those are not looked at that are too far away to be it."""
        best, best_value = goals[0], 0.0
        for goal in sorted(goals, key=lambda goal: (self._air_m(goal), goal.number)):
            if goal.kind != "free":
                continue
            if self.most(self._air_m(goal)) <= best_value:
                break
            way = self._move_base.plan(goal.place)
            if way is not None and (value := self.value(way)) > best_value:
                best, best_value = goal, value
        return best

    def _air_m(self, goal: Goal) -> float:
        return math.dist(goal.place, self._robot.place)

    def most(self, air_m: float) -> float:
        """Return the greatest value that a goal can have, so far away as the crow flies."""
        return 1 / (1 + air_m / SPEED_M_S)

    def value(self, way: Way) -> float:
        """Return what a way is worth: the shorter, the more."""
        return 1 / (1 + way.length_m / SPEED_M_S)


class ByChance(ByValue):
    """The goal most likely reached for its time: p / (travel + what failing costs)."""

    def value(self, way: Way) -> float:
        """Return it, with P(open) of each door on the way at the time of getting there."""
        p = 1.0
        for crossing in way.crossings(self._robot.floor):
            at_s = self._robot.now_s + crossing.along_m / SPEED_M_S
            p *= self._robot.shares.p_open(at_s, crossing.door)
        return p / (1 + way.length_m / SPEED_M_S + (1 - p) * FAIL_S)


def order_of(name: str, robot: Robot, move_base: MoveBase, window: int) -> GoalOrder:
    """Return the order of that name: `given`, `nearest` or `patrol`."""
    if name == "given":
        return AsGiven()
    return {"nearest": ByValue, "patrol": ByChance}[name](robot, move_base, window)
