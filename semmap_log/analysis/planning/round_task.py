"""The tasks to plan: a round to order, and a trip through doors that may be shut.

A round has stops, the times between them, and how likely each lets the robot in. A trip has doors,
where they are, and what is known of each; its policy decides which door is next, and whether to
wait, ask or go round at one that is shut. Doors are found open or shut on arrival (the Canadian
traveller's problem; C. Papadimitriou, M. Yannakakis, Theor. Comput. Sci. 84, 1991), and stay so for
the trip. With few doors all possible findings are enumerated, so that the expected time is the
minimum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from semmap_log.errors import PlanError

Seconds = NDArray[np.float64]
Orders = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class RoundTask:
    """The stops of a round; a stop that does not let the robot in costs time, too.

    A round minimises the mean time to visit: the sum over the stops of P(it lets in) times its
    time of arrival. A stop that was not visited counts as reached at the end of the round, so that
    there is no gain in coming when a door is shut.
    """

    from_start_s: Seconds
    """(n,): from where the robot is to each stop, seconds."""
    leg_s: Seconds
    """(n, n): from each stop, row, to each other, column, seconds."""
    p_passes: NDArray[np.float64]
    """(n, k): P(it lets the robot in), at k times, `step_s` apart; from the last on it stays."""
    enter_s: Seconds
    """(n,): time at a stop that lets the robot in: it goes in, and comes out again."""
    fail_s: Seconds
    """(n,): time at a stop that does not."""
    step_s: float = 60.0
    budget_s: float | None = None
    """The end of the round: stops reached later are not visited."""
    now_s: float = 0.0
    """Since the round began, as are the times of `p_passes` and the budget."""

    def __post_init__(self) -> None:
        """Check the shapes and values.

        Raises:
            PlanError: Some do not fit together, or are invalid.
        """
        count = len(self.from_start_s)
        got = [self.leg_s.shape, self.p_passes.shape[:1], self.enter_s.shape, self.fail_s.shape]
        expected = [(count, count), (count,), (count,), (count,)]
        if got != expected or self.p_passes.ndim != 2 or not self.p_passes.shape[1]:
            raise PlanError(f"a round: expected arrays of shapes {expected}, got {got}.")
        times = (self.from_start_s, self.leg_s, self.enter_s, self.fail_s)
        if not all((np.isfinite(each) & (each >= 0)).all() for each in times):
            raise PlanError("a round: expected times of 0 s or more, got another value.")
        if not ((self.p_passes >= 0) & (self.p_passes <= 1)).all():
            raise PlanError("a round: expected probabilities of 0..1, got another value.")

    @classmethod
    def fixed(
        cls, from_start_s: Seconds, leg_s: Seconds, p_passes: NDArray[np.float64],
        enter_s: float, fail_s: float,
    ) -> RoundTask:  # fmt: skip
        """Return a round whose probabilities do not change, with equal times at all stops."""
        alike = np.ones(len(from_start_s))
        return cls(
            from_start_s, leg_s, np.asarray(p_passes)[:, None], alike * enter_s, alike * fail_s
        )

    def __len__(self) -> int:
        return len(self.from_start_s)

    def rest(self, stops: Orders, *, last: int | None, now_s: float) -> RoundTask:
        """Return the rest of the round: some stops, from the last one or the start, now."""
        return replace(
            self,
            from_start_s=self.from_start_s[stops] if last is None else self.leg_s[last, stops],
            leg_s=self.leg_s[np.ix_(stops, stops)],
            p_passes=self.p_passes[stops],
            enter_s=self.enter_s[stops],
            fail_s=self.fail_s[stops],
            now_s=now_s,
        )

    @property
    def is_fixed(self) -> bool:
        """Whether P does not change, and no budget ends the round: orders can be exact."""
        return self.p_passes.shape[1] == 1 and self.budget_s is None

    def at(self, times_s: Seconds) -> RoundTask:
        """Return the same with the fixed P of each stop at its time; no budget, from 0 s on."""
        p_passes = self.p_at(np.arange(len(self)), times_s)[:, None]
        return replace(self, p_passes=p_passes, budget_s=None, now_s=0.0)

    def p_at(self, stops: Orders, times_s: Seconds) -> NDArray[np.float64]:
        """Return P(it lets the robot in) of stops, each at its time."""
        last = self.p_passes.shape[1] - 1
        if not last:
            fixed: NDArray[np.float64] = self.p_passes[stops, 0]
            return fixed
        place = np.minimum(times_s / self.step_s, last)
        before = np.minimum(place.astype(np.intp), last - 1)
        low, high = self.p_passes[stops, before], self.p_passes[stops, before + 1]
        found: NDArray[np.float64] = low + (place - before) * (high - low)
        return found

    def arrivals(self, orders: Orders) -> tuple[Seconds, NDArray[np.float64]]:
        """Return the mean times of arrival at the stops of some orders, and P of each then.

        Args:
            orders: (m, j), stops; each row without repeats.
        """
        times, chances = np.empty(orders.shape), np.empty(orders.shape)
        now = np.full(len(orders), self.now_s)
        for place in range(orders.shape[1]):
            stop = orders[:, place]
            leg = self.leg_s[orders[:, place - 1], stop] if place else self.from_start_s[stop]
            now = now + leg
            p_passes = self.p_at(stop, now)
            times[:, place], chances[:, place] = now, p_passes
            now = now + p_passes * self.enter_s[stop] + (1 - p_passes) * self.fail_s[stop]
        return times, chances

    def cost(self, orders: Orders) -> Seconds:
        """Return the cost of each order: the less, the better; zero: all are reached at the end."""
        times, chances = self.arrivals(orders)
        ends_s = self.horizon_s
        gain = ends_s - times
        if self.budget_s is not None:
            gain = np.maximum(gain, 0.0)
        found: Seconds = -(chances * gain).sum(axis=1)
        return found

    @property
    def horizon_s(self) -> float:
        """The end of the round: its budget, or about when all stops can have been visited."""
        if self.budget_s is not None:
            return self.budget_s
        service = np.maximum(self.enter_s, self.fail_s).sum()
        between = np.sort(self.leg_s, axis=1)[:, 1:2].sum() if len(self) > 1 else 0.0
        nearest = self.from_start_s.min() if len(self) else 0.0
        return float(self.now_s + nearest + between + service)


def with_stop(order: Orders, stop: int) -> Orders:
    """Return the orders with one more stop, (n + 1, n + 1): in row i it is at place i."""
    count = len(order) + 1
    found = np.empty((count, count), np.intp)
    found[~np.eye(count, dtype=np.bool_)] = np.repeat(order[None], count, axis=0).ravel()
    np.fill_diagonal(found, stop)
    return found


MOST_DOORS = 8
"""On a trip: each one more makes three times as much to think through."""

Found = tuple[frozenset[int], frozenset[int]]
"""The doors that were found open, or opened; and those that were given up."""
NOTHING: Found = (frozenset(), frozenset())


class AtShutDoor(Enum):
    """What to do at a door that is shut."""

    WAIT = "wait"
    ASK = "ask"
    ROUND = "go round"
    GIVE_UP = "give up"
    """There is no other way, and the wait is unknown."""


@dataclass(frozen=True, slots=True)
class ShutDoorChoice:
    """The mean time to the goal of each choice at a shut door; inf: not a choice."""

    wait_s: float
    ask_s: float
    round_s: float

    @property
    def best(self) -> AtShutDoor:
        """The choice of the least time; of several the first."""
        if not math.isfinite(self.least_s):
            return AtShutDoor.GIVE_UP
        times_s = {AtShutDoor.WAIT: self.wait_s, AtShutDoor.ASK: self.ask_s,
                   AtShutDoor.ROUND: self.round_s}  # fmt: skip
        return min(times_s, key=lambda choice: times_s[choice])

    @property
    def least_s(self) -> float:
        """What that takes."""
        return min(self.wait_s, self.ask_s, self.round_s)


class TripPolicy:
    """The best choices of a trip, computed on request."""

    def __init__(self, task: TripTask) -> None:
        """Take a trip.

        Raises:
            PlanError: It has too many doors, or no way leads to the goal.
        """
        if len(task.doors) > MOST_DOORS:
            raise PlanError(f"a trip: expected at most {MOST_DOORS} doors, got {len(task.doors)}.")
        if not task.is_possible:
            raise PlanError("a trip: no way leads from the start to the goal.")
        self._task = task
        self._times: dict[frozenset[int], NDArray[np.float64]] = {}
        self._to_goal: dict[tuple[int, Found], float] = {}

    @property
    def expected_s(self) -> float:
        """The expected time from the start to the goal; inf where the wait is unknown."""
        return self.to_goal_s(START, NOTHING)

    def to_goal_s(self, place: int, found: Found) -> float:
        """Return the expected time to the goal from a place, by what was found so far."""
        key = (place, found)
        if key not in self._to_goal:
            self._to_goal[key] = self.next_place(place, found)[1]
        return self._to_goal[key]

    def next_place(self, place: int, found: Found) -> tuple[int, float]:
        """Return where to go next, the goal or before a door, and the expected time to the goal."""
        times_s = self._through(found[0])[place]
        best, least_s = GOAL, float(times_s[GOAL])
        for door in self._unseen(found):
            for side in self._task.sides(door):
                if math.isfinite(times_s[side]):
                    takes_s = float(times_s[side]) + self._at_door_s(side, found)
                    if takes_s < least_s:
                        best, least_s = side, takes_s
        return best, least_s

    def walk_s(self, place: int, target: int, found: Found) -> float:
        """Return the time to a place through doors that were found open."""
        return float(self._through(found[0])[place, target])

    def when_shut(self, side: int, found: Found) -> ShutDoorChoice:
        """Return the time of each choice at a shut door, from the side where the robot stands."""
        task, door = self._task, self._task.door_at(side)
        expected = task.doors[door]
        through_s = self._through_s(side, found)
        round_s = self.to_goal_s(side, given_up(found, door))
        ask_s = math.inf
        if expected.p_answers > 0:
            refused_s = task.refused_s + min(expected.wait_s + through_s, round_s)
            ask_s = expected.p_answers * (task.ask_s + through_s)
            if expected.p_answers < 1:
                ask_s += (1 - expected.p_answers) * refused_s
        return ShutDoorChoice(expected.wait_s + through_s, ask_s, round_s)

    def _at_door_s(self, side: int, found: Found) -> float:
        """Return the expected time to the goal from before a door that nobody has looked at."""
        p_open = self._task.doors[self._task.door_at(side)].p_open
        through_s = self._through_s(side, found)
        if p_open >= 1:
            return through_s
        when_shut_s = self.when_shut(side, found).least_s
        if p_open <= 0:
            return when_shut_s
        return p_open * through_s + (1 - p_open) * when_shut_s

    def _through_s(self, side: int, found: Found) -> float:
        """Return the expected time to the goal from before a door that is open."""
        task, door = self._task, self._task.door_at(side)
        behind = task.other_side(side)
        return float(task.cross_s[door]) + self.to_goal_s(behind, opened(found, door))

    def _unseen(self, found: Found) -> list[int]:
        return [d for d in range(len(self._task.doors)) if d not in found[0] and d not in found[1]]

    def _through(self, opened_doors: frozenset[int]) -> NDArray[np.float64]:
        if opened_doors not in self._times:
            self._times[opened_doors] = self._task.shortest_s(opened_doors)
        return self._times[opened_doors]


def opened(found: Found, door: int) -> Found:
    """Return the knowledge after a door was found open, or has opened."""
    return found[0] | {door}, found[1] - {door}


def given_up(found: Found, door: int) -> Found:
    """Return the knowledge after a door was found shut, and left."""
    return found[0], found[1] | {door}


START, GOAL = 0, 1


@dataclass(frozen=True, slots=True)
class TripDoor:
    """The expectations of a door on arrival."""

    p_open: float
    wait_s: float
    """Mean wait until it opens, once it was found shut; inf: never, or unknown."""
    p_answers: float = 0.0
    """P(it opens for who asks | it is shut); 0: the robot cannot ask."""

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            PlanError: One is invalid.
        """
        are_right = 0 <= self.p_open <= 1 and 0 <= self.p_answers <= 1 and self.wait_s >= 0
        if not are_right:
            raise PlanError(
                f"a door of a trip: expected P of 0..1 and a wait from 0 s, got {self}."
            )


@dataclass(frozen=True, slots=True, eq=False)
class TripTask:
    """From a start to a goal: places are the start (0), the goal (1), and two sides of each door.

    Door d has its sides at 2 + 2 d and 3 + 2 d.
    """

    walk_s: NDArray[np.float64]
    """(n, n): between places with all doors shut; inf: not without a door."""
    cross_s: NDArray[np.float64]
    """(d,): from one side of each door to the other."""
    doors: tuple[TripDoor, ...]
    ask_s: float = 8.0
    """Time until a requested door opens."""
    refused_s: float = 30.0
    """Time until the robot gives up a door that does not."""

    def __post_init__(self) -> None:
        """Check the shapes.

        Raises:
            PlanError: They do not fit together.
        """
        places = 2 + 2 * len(self.doors)
        if self.walk_s.shape != (places, places) or self.cross_s.shape != (len(self.doors),):
            raise PlanError(
                f"a trip of {len(self.doors)} doors: expected times of shape ({places}, {places}), "
                f"got {self.walk_s.shape} and {self.cross_s.shape}."
            )

    @staticmethod
    def sides(door: int) -> tuple[int, int]:
        """Return the places on both sides of a door."""
        return 2 + 2 * door, 3 + 2 * door

    @staticmethod
    def door_at(place: int) -> int:
        """Return the door that a place belongs to."""
        return (place - 2) // 2

    @staticmethod
    def other_side(place: int) -> int:
        """Return the place on the door's other side."""
        return place ^ 1

    def shortest_s(self, opened: frozenset[int]) -> NDArray[np.float64]:
        """Return the times between all places through the doors that are known to be open."""
        times_s: NDArray[np.float64] = self.walk_s.copy()
        np.fill_diagonal(times_s, 0.0)
        for door in opened:
            here, there = self.sides(door)
            for one, other in ((here, there), (there, here)):
                times_s[one, other] = min(times_s[one, other], float(self.cross_s[door]))
        for middle in range(len(times_s)):
            np.minimum(times_s, times_s[:, middle, None] + times_s[None, middle], out=times_s)
        return times_s

    @property
    def is_possible(self) -> bool:
        """Whether the goal can be reached with all doors open."""
        return math.isfinite(self.shortest_s(frozenset(range(len(self.doors))))[START, GOAL])
