"""A robot's way through a level, past its doors and through them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from patrol_sim.laser_doors import MOVES_S, DoorLife, standing
from patrol_sim.laser_plan import LevelPlan
from patrol_sim.laser_surfaces import Floats
from patrol_sim.routes import FloorRoutes, Point
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorAdded

TRACK_HZ = 50
SPEED_M_S = 0.7
TURN_RAD_S = 0.8
SMOOTH_S = 0.6
"""It starts, stops and turns as softly as a mean over this long is."""
BEFORE_DOOR_M = 1.1
BEYOND_DOOR_M = 0.8
PASSABLE = 0.75
"""Clear share of the width that lets the robot through."""
STARTS = 8
"""So many places are tried to start from."""
MOST_GOALS = 12
"""Of so many doors the nearest ones are visited next."""


@dataclass(frozen=True, slots=True)
class Track:
    """Where the robot was."""

    times_s: Floats
    """(n,) from 0 on, `TRACK_HZ` a second."""
    poses: Floats
    """(n, 3): x, y m, theta rad, unwrapped; frame `map`."""

    def pose(self, at_s: float) -> Floats:
        """Return x, y, theta then."""
        return self.at(np.array([at_s]))[0]

    def at(self, times_s: Floats) -> Floats:
        """Return (k, 3) the poses at times."""
        columns = [np.interp(times_s, self.times_s, column) for column in self.poses.T]
        return np.stack(columns, axis=-1)

    def crossings_s(self, life: DoorLife) -> list[float]:
        """Return when the robot's middle went through a door."""
        start, end = life.body.ends
        along, left = life.body.drawn.along, life.body.drawn.left
        aside = (self.poses[:, :2] - start) @ left
        on = (self.poses[:, :2] - start) @ along
        changed = np.flatnonzero(np.sign(aside[1:]) != np.sign(aside[:-1]))
        width = float((end - start) @ along)
        return [float(self.times_s[k]) for k in changed if 0 < on[k] < width]


def drive(
    plan: LevelPlan, lives: Sequence[DoorLife], *, length_s: float, cell_m: float,
    asks: float, rng: np.random.Generator,
    progress: Callable[[float], None] = lambda _share: None,
) -> Track:  # fmt: skip
    """Return a patrol: from door to door, in and out of rooms; doors on its way are opened for it.

    Args:
        plan: The level.
        lives: Its doors; those that are opened for the robot change.
        length_s: How long.
        cell_m: Of the grid on which ways are found.
        asks: Share of shut doors that somebody opens when the robot wants to go through.
        rng: Where all chance comes from.
        progress: Told the share that is done.
    """
    return _Driver(plan, lives, cell_m, asks, rng).patrol(length_s, progress)


class _Driver:
    def __init__(
        self, plan: LevelPlan, lives: Sequence[DoorLife], cell_m: float, asks: float,
        rng: np.random.Generator,
    ) -> None:  # fmt: skip
        self._lives = {life.body.drawn.door_id: life for life in lives}
        added = [
            DoorAdded(
                door_id=d.door_id, level=plan.level, x=d.x, y=d.y, theta=d.theta, width=d.width
            )
            for d in plan.doors
        ]
        self._routes = FloorRoutes(plan.floor, added, self._lives, cell_m)
        self._asks, self._rng = asks, rng
        self._views = self._viewpoints()
        self._now_s = 0.0
        self._theta = 0.0
        self._rows: list[Floats] = []
        self._stubborn: set[DoorId] = set()

    def patrol(self, length_s: float, progress: Callable[[float], None]) -> Track:
        self._point, reached = self._start()
        if not self._asks:  # it stays where it can go by itself
            self._views = reached
        left = list(self._views)
        while self._now_s < length_s:
            progress(min(1.0, self._now_s / length_s))
            if not left:
                left = list(self._views)
            near = sorted(left, key=lambda goal: math.dist(goal, self._point))[:MOST_GOALS]
            goal = near[self._rng.integers(len(near))]
            left.remove(goal)
            self._go(goal)
            if self._rng.random() < 0.3:
                self._stand(self._rng.uniform(1, 6))
        return self._smoothed(length_s)

    def _viewpoints(self) -> list[Point]:
        """Return a place before and one behind each door that can be stood on."""
        views = []
        for life in self._lives.values():
            start, end = life.body.drawn.ends
            for side in (-1, 1):
                x, y = (start + end) / 2 + side * self._rng.uniform(1.0, 1.8) * life.body.drawn.left
                if self._routes.is_free((float(x), float(y))):
                    views.append((float(x), float(y)))
        return views

    def _start(self) -> tuple[Point, list[Point]]:
        """Return the place from which most others can be reached as doors stand, and those."""
        some = [self._views[i] for i in self._rng.permutation(len(self._views))[:STARTS]]
        shut = self._shut(self._lives)
        reached = [
            [view for view in self._views if math.isfinite(self._routes.length_m(view, one, shut))]
            for one in some
        ]
        most = int(np.argmax([len(views) for views in reached]))
        return some[most], reached[most]

    def _shut(self, doors: Iterable[DoorId]) -> frozenset[DoorId]:
        """Return which of these doors do not let the robot through now."""
        return frozenset(
            door_id for door_id in doors if not self._lets_through(self._lives[door_id])
        )

    def _go(self, goal: Point) -> None:
        """Drive there, as far as doors are opened."""
        for _ in range(6):
            way = self._routes.way(self._point, goal, self._shut(self._stubborn))
            if way is None:
                self._stubborn.clear()
                self._stand(1.0)
                return
            crossings = self._routes.crossings(way)
            for crossing in crossings:
                self._follow(way, crossing.along_m - BEFORE_DOOR_M)
                life = self._lives[crossing.door_id]
                if not self._opened(life):
                    self._stubborn.add(crossing.door_id)
                    break
                through_s = (BEFORE_DOOR_M + BEYOND_DOOR_M) / SPEED_M_S + 6
                life.hold(self._now_s, through_s)
                self._follow(way, crossing.along_m + BEYOND_DOOR_M)
            else:
                self._follow(way, math.inf)
                return

    def _lets_through(self, life: DoorLife) -> bool:
        return life.body.opening(life.amounts(self._now_s)) >= PASSABLE

    def _opened(self, life: DoorLife) -> bool:
        """Wait until the door is open, if somebody opens it at all."""
        if not self._lets_through(life):
            self._stand(self._rng.uniform(1, 4))
            if self._rng.random() >= self._asks:
                return False
            life.change(self._now_s, _wide(life, self._rng), holds_s=MOVES_S + 12)
            self._stand(MOVES_S + 0.5)
        return True

    def _follow(self, way: Sequence[Point], until_m: float) -> None:
        """Drive on along a way, from where the robot is on it to a distance from its start."""
        along_m = 0.0
        for a, b in pairwise(way):
            length_m = math.dist(a, b)
            gone_m = _gone(a, b, self._point)
            to_m = min(length_m, until_m - along_m)
            if length_m > 0 and gone_m is not None and to_m > gone_m:
                theta = math.atan2(b[1] - a[1], b[0] - a[0])
                self._turn(theta)
                self._straight(to_m - gone_m)
                if to_m == length_m:
                    self._point = b
            along_m += length_m
            if along_m > until_m:
                return

    def _straight(self, metres: float) -> None:
        steps = max(1, round(metres / SPEED_M_S * TRACK_HZ))
        share = np.arange(1, steps + 1)[:, None] / steps
        heading = np.array([math.cos(self._theta), math.sin(self._theta)])
        places = np.array(self._point) + share * metres * heading
        self._write(np.column_stack([places, np.full(steps, self._theta)]))

    def _turn(self, theta: float) -> None:
        turned = math.remainder(theta - self._theta, math.tau)
        steps = round(abs(turned) / TURN_RAD_S * TRACK_HZ)
        if steps:
            thetas = self._theta + turned * np.arange(1, steps + 1) / steps
            self._write(np.column_stack([np.tile(self._point, (steps, 1)), thetas]))
        self._theta += turned

    def _stand(self, seconds: float) -> None:
        steps = round(seconds * TRACK_HZ)
        self._write(np.tile([*self._point, self._theta], (steps, 1)))

    def _write(self, rows: Floats) -> None:
        if len(rows):
            self._rows.append(rows)
            self._now_s += len(rows) / TRACK_HZ
            self._point = (float(rows[-1, 0]), float(rows[-1, 1]))

    def _smoothed(self, length_s: float) -> Track:
        poses = np.concatenate(self._rows)[: round(length_s * TRACK_HZ)]
        window = round(SMOOTH_S * TRACK_HZ)
        padded = np.pad(poses, ((window // 2, window - 1 - window // 2), (0, 0)), mode="edge")
        kernel = np.full(window, 1 / window)
        smooth = [np.convolve(column, kernel, mode="valid") for column in padded.T]
        return Track(np.arange(len(poses)) / TRACK_HZ, np.stack(smooth, axis=-1))


def _wide(life: DoorLife, rng: np.random.Generator) -> tuple[float, float]:
    """Return some way to stand wide open."""
    while True:
        amounts = standing(life.body, "OPEN", rng)
        if life.body.opening(amounts) >= PASSABLE:
            return amounts


def _gone(a: Point, b: Point, point: Point) -> float | None:
    """Return how far from a on the way to b a point on it is; None: it is not on it."""
    length = math.dist(a, b)
    if length == 0:
        return None
    ux, uy = (b[0] - a[0]) / length, (b[1] - a[1]) / length
    along = (point[0] - a[0]) * ux + (point[1] - a[1]) * uy
    aside = -(point[0] - a[0]) * uy + (point[1] - a[1]) * ux
    return max(0.0, along) if abs(aside) < 1e-3 and -1e-3 <= along <= length + 1e-3 else None
