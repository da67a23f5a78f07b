"""A trip through doors that may be shut: where they are, and what is known of each."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.errors import PlanError

START, GOAL = 0, 1


@dataclass(frozen=True, slots=True)
class TripDoor:
    """What is expected of a door when one comes to it."""

    p_open: float
    wait_s: float
    """Until it opens, on average, once it was found shut; inf: it never does, or nobody knows."""
    p_answers: float = 0.0
    """P(it opens for who asks | it is shut); 0: one cannot ask."""

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            PlanError: One cannot be.
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
    """Until a door opens that was asked for."""
    refused_s: float = 30.0
    """Until one gives up a door that does not."""

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
        """Return the places before and behind a door."""
        return 2 + 2 * door, 3 + 2 * door

    @staticmethod
    def door_at(place: int) -> int:
        """Return the door that a place is beside."""
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
