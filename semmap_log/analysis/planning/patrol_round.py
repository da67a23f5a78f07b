"""A round under way: where to go next, by what was found so far."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.planning.best_order import MOST_SWEEPS, best_from, best_order
from semmap_log.analysis.planning.round_task import Orders, RoundTask, with_stop

EXPECTED_P = 0.5
"""The least P at which a door is expected to let the robot in."""


@dataclass(frozen=True, slots=True)
class PatrolTarget:
    """A target, to be visited by one of its doors."""

    name: str
    doors: tuple[int, ...]
    """Places in the arrays of a `RoundTask`; a room's, each of which leads into it."""


@dataclass(frozen=True, slots=True)
class PlannedTry:
    """A door of the plan: its mean time of arrival, and P then."""

    door: int
    target: PatrolTarget
    arrives_s: float
    p_passes: float


class PatrolRound:
    """The order of a round, recomputed only when a door is not as expected.

    A target is visited once one of its doors let the robot in. If one does not, another of its
    doors is tried, too; each once.
    """

    def __init__(
        self,
        task: RoundTask,
        targets: Sequence[PatrolTarget],
        *,
        skipped: NDArray[np.bool_] | None = None,
        sweeps: int = MOST_SWEEPS,
    ) -> None:
        """Take a round.

        Args:
            task: Its stops are all doors; those of no target do not count.
            targets: Of different doors.
            skipped: (n,), of the doors: those that are not tried. A target without another is
                left out.
            sweeps: See `best_from`: 0 is quicker, but not quite as good.
        """
        self._task = task
        self._sweeps = sweeps
        self._at: int | None = None
        self.now_s = task.now_s
        is_skipped = np.zeros(len(task), np.bool_) if skipped is None else skipped
        self._untried = {
            target: tuple(door for door in target.doors if not is_skipped[door])
            for target in targets
        }
        self._target_of = {door: target for target in targets for door in target.doors}
        self._skipped = frozenset(door for door in self._target_of if is_skipped[door])
        self.left_out = [target for target in targets if not self._untried[target]]
        self._order = self._first_order()
        self.replans = 0
        """How often the order was recomputed."""

    def plan(self) -> list[PlannedTry]:
        """Return the order from now on, as far as the budget goes."""
        return self._planned(self._order)

    def _planned(self, order: Orders) -> list[PlannedTry]:
        if not len(order):
            return []
        rest = self._task.rest(order, last=self._at, now_s=self.now_s)
        times_s, chances = rest.arrivals(np.arange(len(order))[None])
        budget_s = np.inf if self._task.budget_s is None else self._task.budget_s
        return [
            PlannedTry(door, self._target_of[door], arrives_s, p_passes)
            for door, arrives_s, p_passes in zip(
                order.tolist(), times_s[0].tolist(), chances[0].tolist(), strict=True
            )
            if arrives_s <= budget_s
        ]

    def cut_off(self) -> list[PatrolTarget]:
        """Return the targets that the budget does not reach."""
        reached = {planned.target for planned in self.plan()}
        ordered = [self._target_of[door] for door in self._order.tolist()]
        return [target for target in ordered if target not in reached]

    def next_try(self) -> PlannedTry | None:
        """Return the door to try next; None: the round is over."""
        planned = self._planned(self._order[:1])
        return planned[0] if planned else None

    def tell(self, door: int, *, passed: bool, now_s: float) -> None:
        """Take in what was found at a door, which need not be the next one of the plan.

        Args:
            door: Where the robot is now.
            passed: Whether it let the robot in.
            now_s: Time since the round began, including all time at the door.
        """
        expected = self._expects(door, self.now_s)
        target = self._target_of[door]
        self._at, self.now_s = door, now_s
        was_next = bool(len(self._order)) and int(self._order[0]) == door
        self._skipped -= {door}
        if passed:
            self._untried = {each: doors for each, doors in self._untried.items() if each != target}
            self._skipped -= frozenset(target.doors)
            self._order = self._without(target.doors)
        else:
            self._give_up(door)
        if not was_next or passed != expected:
            self._replan()

    def learn(self, door: int, p_passes: NDArray[np.float64]) -> None:
        """Take in another P of a door that the robot has not come to yet.

        The order is recomputed only if the door is now expected to be otherwise when the robot
        reaches it. A door that was left out joins the round once it is expected to let it in.

        Args:
            door: Which.
            p_passes: (k,): at the times of the `RoundTask`.
        """
        when_s = self._eta_s(door)
        expected = self._expects(door, when_s)
        rows = self._task.p_passes.copy()
        rows[door] = p_passes
        self._task = replace(self._task, p_passes=rows)
        expects = self._expects(door, when_s)
        if expects and door in self._skipped:
            self._join(door)
        if expects != expected:
            self._replan()

    def rule_out(self, door: int) -> None:
        """Remove a door that the robot has not reached from the round: it no longer exists."""
        self._skipped -= {door}
        if door in self._untried.get(self._target_of[door], ()):
            self._give_up(door)
            self._replan()

    def is_left(self, door: int) -> bool:
        """Return whether a door is still open to try: not tried yet, and its target not visited."""
        return door in self._skipped or door in self._untried.get(self._target_of[door], ())

    def copied(self) -> PatrolRound:
        """Return an independent copy of the round."""
        return copy.copy(self)  # what it holds is replaced, never changed

    def _give_up(self, door: int) -> None:
        """Take a door out of the order; another of its target comes in, if there is one."""
        target = self._target_of[door]
        others = tuple(each for each in self._untried.get(target, ()) if each != door)
        self._untried = {**self._untried, target: others}
        self._order = self._without([door])
        if others and not np.isin(others, self._order).any():
            self._order = self._with(self._likeliest(others))

    def _join(self, door: int) -> None:
        """Add a door to the round that was left out of it."""
        target = self._target_of[door]
        self._skipped -= {door}
        self._untried = {**self._untried, target: (*self._untried[target], door)}
        if not np.isin(target.doors, self._order).any():
            self._order = self._with(door)

    def _eta_s(self, door: int) -> float:
        """Return when the robot comes to a door by the plan; now, where it is not in the order."""
        if door not in self._order:
            return self.now_s
        rest = self._task.rest(self._order, last=self._at, now_s=self.now_s)
        times_s = rest.arrivals(np.arange(len(self._order))[None])[0][0]
        return float(times_s[self._order == door][0])

    def _expects(self, door: int, when_s: float) -> bool:
        p_passes = self._task.p_at(np.array([door]), np.array([when_s]))
        return float(p_passes[0]) >= EXPECTED_P

    def _without(self, doors: Sequence[int]) -> Orders:
        return self._order[~np.isin(self._order, doors)]

    def _with(self, door: int) -> Orders:
        """Return the order with one more door, where that costs least."""
        orders = with_stop(self._order, door)
        found: Orders = orders[int(self._cost(orders).argmin())]
        return found

    def _likeliest(self, doors: tuple[int, ...]) -> int:
        stops = np.array(doors)
        now = np.full(len(doors), self.now_s)
        return doors[int(self._task.p_at(stops, now).argmax())]

    def _first_order(self) -> Orders:
        doors = [self._likeliest(doors) for doors in self._untried.values() if doors]
        chosen = np.array(doors, np.intp)
        rest = self._task.rest(chosen, last=None, now_s=self.now_s)
        order = chosen[best_order(rest, sweeps=self._sweeps)]
        exchanged = self._by_better_doors(order, anywhere=True)
        return order if exchanged is order else self._ordered(exchanged)

    def _replan(self) -> None:
        """Order the remaining stops again, starting from the present order and by value."""
        self.replans += 1
        if len(self._order) > 1:
            self._order = self._ordered(self._by_better_doors(self._order))

    def _ordered(self, doors: Orders) -> Orders:
        rest = self._task.rest(doors, last=self._at, now_s=self.now_s)
        return doors[best_from(rest, [np.arange(len(doors))], sweeps=self._sweeps)]

    def _by_better_doors(self, order: Orders, *, anywhere: bool = False) -> Orders:
        """Return the order with other doors of the same targets, where that costs less.

        Args:
            order: Of doors.
            anywhere: Another door may also come at another place of the order.
        """
        for _ in range(len(order)):
            orders = self._with_other_doors(order, anywhere=anywhere)
            if not len(orders):
                return order
            costs = self._cost(np.vstack([order, orders]))
            best = int(costs[1:].argmin())
            if costs[best + 1] >= costs[0] - 1e-9 * max(1.0, abs(float(costs[0]))):
                return order
            order = orders[best]
        return order

    def _with_other_doors(self, order: Orders, *, anywhere: bool) -> Orders:
        """Return the orders in which another door of its target stands for one."""
        exchanges = [
            (place, other)
            for place, door in enumerate(order.tolist())
            for other in self._untried[self._target_of[door]]
            if other != door
        ]
        if anywhere:
            orders = [with_stop(np.delete(order, place), other) for place, other in exchanges]
            return np.array(orders, np.intp).reshape(-1, len(order))
        places, others = np.array(exchanges, np.intp).reshape(-1, 2).T
        alike = np.repeat(order[None], len(exchanges), axis=0)
        alike[np.arange(len(exchanges)), places] = others
        return alike

    def _cost(self, orders: Orders) -> NDArray[np.float64]:
        """Return what orders of doors cost, from where the robot is now."""
        doors, where = np.unique(orders, return_inverse=True)
        rest = self._task.rest(doors, last=self._at, now_s=self.now_s)
        return rest.cost(where.reshape(orders.shape))
