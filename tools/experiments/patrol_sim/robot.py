"""A patrol robot: it drives to door after door, looks, waits before shut ones, writes it down."""

from __future__ import annotations

import math
import random
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from patrol_sim.journal import Journal
from patrol_sim.routes import Crossing, FloorRoutes, Point
from patrol_sim.sensor import Sensor
from patrol_sim.world import World
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.events import (
    DoorPassed,
    DoorRequested,
    Event,
    PatrolFinished,
    PatrolStarted,
    RobotPose,
)

SPEED_M_S = 0.7
TURN_RAD_S = 1.0
POSE_EVERY_M = 2.0
POSE_EVERY_RAD = math.pi / 6
"""Poses are thinned to these: a week at 0.25 m would be half a million of them."""

SD_XY_M, SD_THETA_RAD = 1 / 32, 1 / 64
BEFORE_DOOR_M = 1.2
PATIENCE_S = 30.0
NO_ANSWER = 0.03
"""Share of requests to which a door does not open."""
HOME_TRIES = 10
LIFT_S = (25.0, 60.0)
NETWORK_NS = 40_000_000
"""From a sighting until the log has it."""


@dataclass(frozen=True, slots=True)
class Stop:
    """Where to go on a round, and what for."""

    level: int
    point: Point
    door_id: DoorId | None = None
    """The door to look at; None: an errand."""
    stay_s: float = 0.0


class Robot:
    """One robot on its rounds. It knows where the doors are; how they stand it has to look."""

    def __init__(
        self, name: str, *, world: World, routes: Mapping[int, FloorRoutes], home: Point,
        home_level: int, lift: Mapping[int, Point], sensor: Sensor, journal: Journal,
        rng: random.Random,
    ) -> None:  # fmt: skip
        self.name = name
        self._world, self._routes, self._lift = world, routes, lift
        self._home, self._home_level = home, home_level
        self._sensor, self._journal, self._rng = sensor, journal, rng
        self.now_ns = world.monday_ns
        self._level, self._point, self._theta = home_level, home, 0.0
        self._posed: Point = home
        self._posed_theta = 0.0
        self._pending: list[Event] = []
        self._believed: dict[DoorId, DoorState] = {}
        self._shut: frozenset[DoorId] = frozenset()
        self._round = ""

    def patrol(self, number: int, name: str, stops: Iterable[Stop]) -> None:
        """Go a round from home to home: look at the doors in that order, as far as one gets."""
        self._shut, self._round = frozenset(), f"patrol {number}"
        self._write_pose()
        self._commit(PatrolStarted(patrol=number), reason=name)
        for stop in stops:
            if self._is_there(stop) and self._go(stop.level, stop.point):
                self._visit(stop)
        self._go_home()
        self._write_pose()
        self._commit(PatrolFinished(patrol=number), reason=name)

    def _visit(self, stop: Stop) -> None:
        """Do what there is to do at a stop, and send it to the log."""
        if stop.door_id is not None and self._is_there(stop):
            self._look(stop.door_id)
        self._wait(stop.stay_s)
        self._commit()

    def _is_there(self, stop: Stop) -> bool:
        return stop.door_id is None or self._world.exists(stop.door_id, self.now_ns)

    def _go_home(self) -> None:
        """Drive home; where a door does not let it, it asks again and again."""
        for _ in range(HOME_TRIES):
            if self._go(self._home_level, self._home):
                return
            self._shut = frozenset()
        raise RuntimeError(f"{self.name} is locked out at {self._point}, {self._round}")

    def _go(self, level: int, target: Point) -> bool:
        """Drive there, through doors and by lift; False: no way there, it stays where it is."""
        if level != self._level:
            if not self._go(self._level, self._lift[self._level]):
                return False
            self._ride(level)
        routes = self._routes[level]
        while (way := routes.way(self._point, target, self._shut)) is not None:
            crossings = [
                crossing
                for crossing in routes.crossings(way)
                if self._world.exists(crossing.door_id, self.now_ns)
            ]
            if not crossings:
                self._drive(way)
                return True
            self._pass(way, crossings[0])
        return False

    def _ride(self, level: int) -> None:
        """Take the lift: the track has a gap there."""
        self._write_pose()
        self._wait(self._rng.uniform(*LIFT_S))
        self._level, self._point = level, self._lift[level]
        self._write_pose()

    def _pass(self, way: Sequence[Point], crossing: Crossing) -> None:
        """Go up to the next door on the way and through it, or give it up for this round."""
        door_id = crossing.door_id
        self._drive(_piece(way, 0, crossing.along_m - BEFORE_DOOR_M))
        self._look(door_id)
        waited_s = self._wait_open(door_id)
        if waited_s is None:
            self._shut |= {door_id}
            self._note(DoorPassed(door_id=door_id, passed=False, waited_s=PATIENCE_S))
        else:
            start_m = max(0.0, crossing.along_m - BEFORE_DOOR_M)
            self._drive(_piece(way, start_m, crossing.along_m + BEFORE_DOOR_M))
            self._note(DoorPassed(door_id=door_id, passed=True, waited_s=waited_s))
            self._believed[door_id] = DoorState.OPEN
        self._commit()

    def _wait_open(self, door_id: DoorId) -> float | None:
        """Ask for the door if it is shut; return the seconds waited, None: in vain."""
        truth = self._world.truths[door_id]
        if truth.state(self.now_ns) is DoorState.OPEN:
            truth.hold(self.now_ns, self.now_ns + 15 * 10**9, DoorState.OPEN)
            return 0.0
        self._note(DoorRequested(door_id=door_id, state=DoorState.OPEN))
        if self._world.is_locked(door_id, self.now_ns) or self._rng.random() < NO_ANSWER:
            self._wait(PATIENCE_S)
            return None
        waited_s = round(self._rng.uniform(4, 12) * 4) / 4
        opens_ns = self.now_ns + round((waited_s - 3) * 1000) * 1_000_000
        truth.hold(opens_ns, opens_ns + 30 * 10**9, DoorState.OPEN)
        self._wait(waited_s)
        return waited_s

    def _look(self, door_id: DoorId) -> None:
        """Turn to the door and write down how it stands; look twice at what is news."""
        door = self._world.doors[door_id]
        middle_x = door.x + math.cos(door.theta) * door.width / 2
        middle_y = door.y + math.sin(door.theta) * door.width / 2
        self._turn(math.atan2(middle_y - self._point[1], middle_x - self._point[0]))
        self._wait(1.0)
        self._write_pose()
        for _ in range(2):
            sighting = self._sensor.look(door_id, self._world, self.now_ns, self._rng)
            self._note(sighting)
            if sighting.state == self._believed.get(door_id):
                break
            self._believed[door_id] = sighting.state
            self._wait(1.5)

    def _drive(self, way: Sequence[Point]) -> None:
        """Follow a line of points, writing thinned poses."""
        for start, end in pairwise(way):
            length_m = math.dist(start, end)
            if length_m == 0:
                continue
            self._turn(math.atan2(end[1] - start[1], end[0] - start[0]))
            if abs(_turned(self._posed_theta, self._theta)) >= POSE_EVERY_RAD:
                self._write_pose()
            gone_m = 0.0
            while gone_m + (step_m := self._until_pose_m()) < length_m:
                gone_m += step_m
                self._advance(step_m)
                self._write_pose()
            self._advance(length_m - gone_m)
            self._point = end

    def _until_pose_m(self) -> float:
        return max(0.0, POSE_EVERY_M - math.dist(self._posed, self._point))

    def _advance(self, metres: float) -> None:
        self._point = (
            self._point[0] + math.cos(self._theta) * metres,
            self._point[1] + math.sin(self._theta) * metres,
        )
        self._wait(metres / SPEED_M_S)

    def _turn(self, theta: float) -> None:
        self._wait(abs(_turned(self._theta, theta)) / TURN_RAD_S)
        self._theta = theta

    def _wait(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1000) * 1_000_000

    def _write_pose(self) -> None:
        """Write down where it thinks it is: rounded, so that every machine writes the same."""
        x, y = (round((value + self._rng.gauss(0, 0.02)) * 1024) / 1024 for value in self._point)
        theta = round(self._theta * 1024) / 1024
        self._posed, self._posed_theta = self._point, self._theta
        pose = RobotPose(
            level=self._level, x=x, y=y, theta=theta, sd_xy=SD_XY_M, sd_theta=SD_THETA_RAD
        )
        self._note(pose)

    def _note(self, event: Event) -> None:
        """Keep what happens now for the next commit."""
        self._pending.append(replace(event, happened_ns=self.now_ns))

    def _commit(self, *events: Event, reason: str = "") -> None:
        """Send all that is kept, and these, to the log."""
        for event in events:
            self._note(event)
        self._journal.add(
            self.now_ns + NETWORK_NS, *self._pending,
            actor=self.name, source=self._sensor.source, reason=reason, correlation=self._round,
        )  # fmt: skip
        self._pending.clear()


def _turned(source: float, target: float) -> float:
    """Return the turn from one heading to another, -pi..pi radians."""
    return math.remainder(target - source, math.tau)


def _piece(way: Sequence[Point], start_m: float, end_m: float) -> list[Point]:
    """Return the piece of a way between two distances from its start, metres."""
    piece: list[Point] = []
    along_m = 0.0
    for a, b in pairwise(way):
        length_m = math.dist(a, b)
        low, high = max(start_m - along_m, 0.0), min(end_m - along_m, length_m)
        if low <= high and length_m > 0:
            for gone in (low, high):
                point = (
                    a[0] + (b[0] - a[0]) * gone / length_m,
                    a[1] + (b[1] - a[1]) * gone / length_m,
                )
                if not piece or piece[-1] != point:
                    piece.append(point)
        along_m += length_m
    return piece
