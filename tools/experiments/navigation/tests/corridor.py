"""A small drive to record: a robot in a corridor of four rooms, with three doors that live."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from navigation.records import Outcome, RunKey, RunRecorder
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import DoorAdded, DoorAnnotated, Event, FloorMap, LevelAdded

SPEED_M_S = 0.7
ROOM_M = 5.0
DOORS = tuple(DoorId(number) for number in (1, 2, 3))
"""Door n is at n * ROOM_M."""
OPEN, CLOSED = DoorState.OPEN, DoorState.CLOSED
PLAN_S, TOGGLE_S, SLACK_S = 2.0, 60.0, 30.0


def plan() -> list[Event]:
    """Return the corridor: walls all around, doors across."""
    cells = np.zeros((20, 200), np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    doors = [
        DoorAdded(door_id=door, level=1, x=door * ROOM_M, y=0.5, theta=np.pi / 2, width=1.0)
        for door in DOORS
    ]
    names = [DoorAnnotated(door_id=door, key="name", value=f"door_{door}") for door in DOORS]
    floor = FloorMap(level=1, resolution=0.1, origin_x=0.0, origin_y=0.0, cells=cells)
    return [LevelAdded(level=1, name="L1"), floor, *doors, *names]


@dataclass
class Tally:
    """What the drive counted itself."""

    took_s: list[float] = field(default_factory=list)
    """Of the goals that were reached."""
    outcomes: list[Outcome] = field(default_factory=list)
    wrong: list[tuple[float, set[DoorId]]] = field(default_factory=list)
    """Second, and the doors that the map had wrong then, as a goal was sent."""
    wrong_s: float = 0.0
    """Seconds times doors, from the first goal's start to the last one's end."""
    begin_s: float = 0.0
    end_s: float = 0.0


class Corridor:
    """Drives, records and counts. With a map the robot plans by it, and sees doors it stands at."""

    def __init__(
        self,
        recorder: RunRecorder,
        states: dict[DoorId, DoorState],
        *,
        has_map: bool,
        rng: random.Random,
    ) -> None:
        self.recorder, self.has_map, self.rng = recorder, has_map, rng
        self.world, self.belief = dict(states), dict(states)
        self.now_s, self.x = 0.0, 1.0
        self.next_toggle_s = TOGGLE_S
        self.wrong_s = 0.0
        self.tally = Tally()

    def drive(self, goals: int) -> Tally:
        """Try so many goals."""
        for number in range(1, goals + 1):
            self._goal(number, self.rng.uniform(0.5, 4 * ROOM_M - 0.5))
            self._wait(1.0)
        return self.tally

    def _goal(self, number: int, x: float) -> None:
        sent_s = self.now_s
        if number == 1:
            self.tally.begin_s, self.wrong_s = sent_s, 0.0
        self.tally.wrong.append((sent_s, self._wrong()))
        self.recorder.goal_sent(sent_s, number, x, 1.0, kind="free")
        self._wait(PLAN_S)
        outcome = self._go(x)
        self.tally.outcomes.append(outcome)
        if outcome is Outcome.REACHED:
            self.tally.took_s.append(self.now_s - sent_s)
        self.tally.end_s, self.tally.wrong_s = self.now_s, self.wrong_s
        self.recorder.goal_ended(self.now_s, number, outcome, {"path_m": abs(x - self.x)})

    def _go(self, x: float) -> Outcome:
        if self.has_map and any(self.belief[door] is CLOSED for door in self._between(x)):
            return Outcome.REJECTED
        while abs(x - self.x) > 0.01:
            step = max(-SPEED_M_S, min(SPEED_M_S, x - self.x))
            shut = [door for door in self._between(self.x + step) if self.world[door] is CLOSED]
            if shut:
                self._see(shut[0])
                self._wait(SLACK_S)
                return Outcome.AFTER_DRIVING
            for door in self._between(self.x + step):
                self._see(door)
            self.x += step
            self._wait(1.0)
            self.recorder.pose(self.now_s, self.x, 1.0, 0.0 if step > 0 else np.pi)
        return Outcome.REACHED

    def _between(self, x: float) -> Sequence[DoorId]:
        low, high = sorted((self.x, x))
        return [door for door in DOORS if low < door * ROOM_M <= high]

    def _see(self, door: DoorId) -> None:
        if self.has_map and self.belief[door] is not self.world[door]:
            self.belief[door] = self.world[door]
            self.recorder.sighted(self.now_s, door, self.world[door])

    def _wrong(self) -> set[DoorId]:
        return {door for door in DOORS if self.world[door] is not self.belief[door]}

    def _wait(self, seconds: float) -> None:
        end_s = self.now_s + seconds
        while self.now_s < end_s:
            until_s = min(end_s, self.next_toggle_s)
            self.wrong_s += (until_s - self.now_s) * len(self._wrong())
            self.now_s = until_s
            if until_s == self.next_toggle_s:
                self._toggle()
                self.next_toggle_s += TOGGLE_S

    def _toggle(self) -> None:
        for door in DOORS:
            if self.rng.random() < 0.5:
                self.world[door] = CLOSED if self.world[door] is OPEN else OPEN
                self.recorder.door_changed(self.now_s, door, self.world[door])


def drive(
    out: Path, setup: str = "map", seed: int = 1, *, goals: int = 30, series: str = "fixed",
    building: str = "corridor", **parameters: float,
) -> Tally:  # fmt: skip
    """Record a run of the corridor; return what it counted."""
    key = RunKey(building, setup, series, seed)
    states = dict.fromkeys(DOORS, OPEN)
    with RunRecorder(out, key, plan(), parameters, states=states) as recorder:
        rng = random.Random(f"{seed} {series}")
        return Corridor(recorder, states, has_map=setup != "no_map", rng=rng).drive(goals)
