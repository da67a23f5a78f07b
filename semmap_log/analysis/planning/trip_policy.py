"""What to do on a trip: which door next, and at one that is shut to wait, to ask, or to go round.

Doors are found open or shut when one comes to them (the Canadian traveller's problem; C.
Papadimitriou, M. Yannakakis, Theor. Comput. Sci. 84, 1991). What was found stays so for the trip;
of few doors all that can be found is gone through, so that the expected time is the least there
is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.planning.trip_task import GOAL, START, TripTask
from semmap_log.errors import PlanError

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
    """There is no other way, and nobody knows how long to wait."""


@dataclass(frozen=True, slots=True)
class ShutDoorChoice:
    """What each choice takes at a door that is shut, on average, to the goal; inf: it is none."""

    wait_s: float
    ask_s: float
    round_s: float

    @property
    def best(self) -> AtShutDoor:
        """The one that takes least; of several the first."""
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
    """The best choices of a trip, worked out where they are asked for."""

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
        """The expected time from the start to the goal; inf where nobody knows how long to wait."""
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
        """Return how long it takes to a place through doors that were found open."""
        return float(self._through(found[0])[place, target])

    def when_shut(self, side: int, found: Found) -> ShutDoorChoice:
        """Return what each choice takes at a door that is shut, from the side where one stands."""
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
    """Return what is known after a door was found open, or has opened."""
    return found[0] | {door}, found[1] - {door}


def given_up(found: Found, door: int) -> Found:
    """Return what is known after a door was found shut, and left."""
    return found[0], found[1] | {door}
