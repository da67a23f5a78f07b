"""How the doors of a building really are in some weeks, and what a robot meets at one."""

from __future__ import annotations

import random
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from patrol_sim.habits import HOUR_NS, SLOTS, DoorTruth, Habit, habit_of, live

from patrol_eval.building import PatrolledBuilding
from semmap_log.core.model.doors import DoorState
from semmap_log.core.model.events import DoorObserved, DoorPassed, DoorRequested, Event
from semmap_log.core.model.moments import SECOND_NS, parse_instant

MONDAY = "2026-03-02"
WEEK_NS = 7 * 24 * HOUR_NS
ENTER_S = 17.0
"""To go into a room, look, and come out again."""
LOOK_S = 3.0
"""At a door that is shut, before the robot waits."""
ACCURACY_OPEN, ACCURACY_CLOSED = 0.97, 0.95
"""Of its camera."""
OPENS_AFTER_S = (4.0, 12.0)
"""A door that was asked for."""
MOSTLY = 0.9
"""A room is reachable in a round if one of its doors lets the robot in for that share of it."""


@dataclass(frozen=True)
class RoundRules:
    """What a round is like."""

    budget_s: float = 3600.0
    wait_s: float = 10.0
    """So long the robot waits at a shut door."""
    asks: bool = False
    """A door that it asks for opens, unless it is locked at that hour."""

    @property
    def fail_s(self) -> float:
        """What a door costs that does not let the robot in."""
        return LOOK_S + self.wait_s


@dataclass(frozen=True)
class Try:
    """What happened at a door."""

    passed: bool
    took_s: float
    events: tuple[Event, ...]


@dataclass
class PatrolWorld:
    """The truth, which no robot sees."""

    building: PatrolledBuilding
    seed: int
    weeks: int = 2
    monday_ns: int = field(init=False)
    habits: list[Habit] = field(init=False)
    truths: list[DoorTruth] = field(init=False)

    def __post_init__(self) -> None:
        """Let the doors live."""
        rng = random.Random(f"patrolled {self.seed}")
        self.monday_ns = parse_instant(MONDAY, tz=self.building.tz)
        self.habits = [habit_of(name, rng) for name in self.building.names]
        self.truths = [live(habit, self.monday_ns, self.end_ns, rng) for habit in self.habits]

    @property
    def end_ns(self) -> int:
        """When the last of its weeks ends."""
        return self.monday_ns + self.weeks * WEEK_NS

    def try_door(self, door: int, at_ns: int, rules: RoundRules) -> Try:
        """Return what happens if the robot wants to go through a door then."""
        if self.truths[door].state(at_ns) is DoorState.OPEN:
            return self._entered(door, at_ns, 0.0)
        seen = self._seen(door, at_ns, DoorState.CLOSED)
        if rules.asks:
            asked = self._event(DoorRequested(door_id=self._id(door), state=DoorState.OPEN), at_ns)
            if not self.habits[door].is_locked((at_ns - self.monday_ns) / HOUR_NS):
                waited_s = random.Random(f"{self.seed} {door} {at_ns}").uniform(*OPENS_AFTER_S)
                entered = self._entered(door, at_ns, waited_s)
                return Try(entered.passed, entered.took_s, (seen, asked, *entered.events))
            return self._gave_up(door, at_ns, rules, (seen, asked))
        until_ns = at_ns + round(rules.fail_s * SECOND_NS)
        for opens_ns, state in self.truths[door].changes(at_ns, until_ns):
            if state is DoorState.OPEN:
                waited_s = (opens_ns - at_ns) / SECOND_NS
                entered = self._entered(door, at_ns, waited_s)
                return Try(entered.passed, entered.took_s, (seen, *entered.events))
        return self._gave_up(door, at_ns, rules, (seen,))

    def look(self, door: int, at_ns: int) -> DoorObserved:
        """Return what the robot sees of a door then."""
        return self._seen(door, at_ns, self.truths[door].state(at_ns))

    def shares(self, door: int, times_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return how much of its time a door is open at such hours: its true schedule."""
        share = np.array(self.habits[door].share)
        return share[((times_ns - self.monday_ns) // (HOUR_NS // 2)) % SLOTS]

    def unlocked(self, door: int, times_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return whether a door opens for who asks then."""
        hours = (times_ns - self.monday_ns) / HOUR_NS
        return np.array([not self.habits[door].is_locked(hour) for hour in hours.tolist()])

    def reachable(self, start_ns: int, rules: RoundRules) -> list[bool]:
        """Return which rooms are so in a round that starts then."""
        minutes = start_ns + np.arange(0, round(rules.budget_s), 60, dtype=np.int64) * SECOND_NS
        return [
            any(self._lets_in(door, minutes, rules).mean() >= MOSTLY for door in room.doors)
            for room in self.building.rooms
        ]

    def _lets_in(
        self, door: int, times_ns: NDArray[np.int64], rules: RoundRules
    ) -> NDArray[np.bool_]:
        truth = self.truths[door]
        is_open = np.array([truth.state(at) is DoorState.OPEN for at in times_ns.tolist()])
        return is_open | self.unlocked(door, times_ns) if rules.asks else is_open

    def _entered(self, door: int, at_ns: int, waited_s: float) -> Try:
        in_ns = at_ns + round(waited_s * SECOND_NS)
        passed = DoorPassed(door_id=self._id(door), passed=True, waited_s=waited_s)
        events = (self._seen(door, in_ns, DoorState.OPEN), self._event(passed, in_ns + SECOND_NS))
        return Try(True, waited_s + ENTER_S, events)

    def _gave_up(self, door: int, at_ns: int, rules: RoundRules, events: tuple[Event, ...]) -> Try:
        end_ns = at_ns + round(rules.fail_s * SECOND_NS)
        gave_up = DoorPassed(door_id=self._id(door), passed=False, waited_s=rules.wait_s)
        return Try(False, rules.fail_s, (*events, self._event(gave_up, end_ns)))

    def _seen(self, door: int, at_ns: int, state: DoorState) -> DoorObserved:
        return DoorObserved(
            happened_ns=at_ns, door_id=self._id(door), state=state,
            accuracy_open=ACCURACY_OPEN, accuracy_closed=ACCURACY_CLOSED,
        )  # fmt: skip

    def _event(self, event: DoorPassed | DoorRequested, at_ns: int) -> Event:
        return replace(event, happened_ns=at_ns)

    def _id(self, door: int) -> int:
        return self.building.door_ids[door]
