"""How the next one is drawn: at random, or by priorities that change at a few places.

The second finds what needs few switches at the right places soonest. (Burckhardt et al., "A
Randomized Scheduler with Probabilistic Guarantees of Finding Bugs", ASPLOS 2010: PCT.)
"""

from __future__ import annotations

import random
from collections.abc import Mapping

from fault_injection.interleaving.scheduler import Task

LINE = "line"
"""The point before a line of the program: there are far more of these than of all others."""


class RandomWalk:
    """Anybody may go on, at any point."""

    def __init__(self, dice: random.Random) -> None:
        self._dice = dice
        self._stay = dice.choice((0.0, 0.3, 0.7))
        self._stay_at_line = dice.choice((0.9, 0.97, 0.995))

    def begun(self, task: Task) -> None:
        """Nothing is remembered of tasks."""

    def choose(self, able: list[Task], now: Task, point: str) -> Task:
        """Return one of those that can go on."""
        stay = self._stay_at_line if point == LINE else self._stay
        if now in able and not now.may_time_out and self._dice.random() < stay:
            return now
        sure = [task for task in able if not task.may_time_out]
        if sure and self._dice.random() < 0.8:
            return self._dice.choice(sure)
        return self._dice.choice(able)


class Priorities:
    """The one with the greatest priority goes on; at a few points it becomes the least."""

    def __init__(self, dice: random.Random, *, steps: int) -> None:
        """Draw.

        Args:
            dice: Draws.
            steps: How long the run may be.
        """
        self._dice = dice
        changes = dice.randint(1, 5)
        self._changes = {dice.randrange(steps) for _ in range(changes)}
        self._priority: dict[int, float] = {}
        self._least = 0.0
        self._step = 0

    def begun(self, task: Task) -> None:
        """Draw its priority."""
        self._priority[task.number] = self._dice.random()

    def choose(self, able: list[Task], now: Task, point: str) -> Task:
        """Return the first by priority; who only waits for a timeout comes last."""
        del point
        self._step += 1
        if self._step in self._changes:
            self._put_last(now)
        chosen = max(able, key=lambda t: (not t.may_time_out, self._priority[t.number]))
        if chosen.may_time_out:
            self._put_last(chosen)
        return chosen

    def _put_last(self, task: Task) -> None:
        self._least -= 1
        self._priority[task.number] = self._least


class Parking:
    """One thread is left standing at a drawn point, and all others go as far as they can.

    The points are drawn by what is done there, so that a write is met as often as a lock, though
    there are far more locks.
    """

    def __init__(self, dice: random.Random, points: Mapping[str, int]) -> None:
        """Draw.

        Args:
            dice: Draws.
            points: What may be done there, and how often at most it was done before.
        """
        self._dice = dice
        self._parks: dict[str, set[int]] = {}
        for point in dice.choices(list(points), k=dice.randint(2, 8)):
            self._parks.setdefault(point, set()).add(dice.randrange(points[point]))
        self._seen: dict[str, int] = {}
        self._parked: dict[int, int] = {}
        """Task -> for how many steps yet."""
        self._restless = dice.choice((0.0, 0.01, 0.1))

    def begun(self, task: Task) -> None:
        """Nothing is remembered of a new task."""

    def choose(self, able: list[Task], now: Task, point: str) -> Task:
        """Return the one that ran, unless it is left standing."""
        seen = self._seen.get(point, 0)
        self._seen[point] = seen + 1
        if seen in self._parks.get(point, ()):
            self._parked[now.number] = self._dice.choice((5, 50, 500, 5000))
        self._parked = {task: left - 1 for task, left in self._parked.items() if left}
        moving = [task for task in able if task.number not in self._parked]
        sure = [task for task in moving if not task.may_time_out]
        if now in sure and self._dice.random() >= self._restless:
            return now
        return self._dice.choice(sure or moving or able)
