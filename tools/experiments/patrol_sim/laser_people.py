"""People as a laser at shin height sees them: two legs that walk, or stand about."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from patrol_sim.laser_doors import DoorLife
from patrol_sim.laser_drive import Track
from patrol_sim.laser_surfaces import Floats

LEG_M = 0.075
"""Radius of a leg."""
HIPS_M = 0.11
STRIDE_M = 0.28
STEPS_HZ = 0.9
APART_M = 0.5
"""Nobody walks into the robot: who would come nearer than this is left out."""
NEAR_M = 7.0


@dataclass(frozen=True, slots=True)
class Person:
    """Somebody who is somewhere from a moment to another."""

    times_s: Floats
    places: Floats
    """(n, 2) m, at those times; in between on a straight line."""
    gait: float
    """Phase of the steps, rad."""

    def legs(self, at_s: float) -> Floats | None:
        """Return the middles of both legs, (2, 2) m; None: not there."""
        if not self.times_s[0] <= at_s <= self.times_s[-1]:
            return None
        x, y = (
            np.interp([at_s, at_s + 0.1], self.times_s, self.places[:, axis]) for axis in (0, 1)
        )
        dx, dy = x[1] - x[0], y[1] - y[0]
        speed = math.hypot(dx, dy) / 0.1
        heading = math.atan2(dy, dx) if speed > 0.05 else self.gait
        ahead = np.array([math.cos(heading), math.sin(heading)])
        across = np.array([-ahead[1], ahead[0]])
        step = STRIDE_M * min(1.0, speed) * math.sin(math.tau * STEPS_HZ * at_s + self.gait)
        middle = np.array([x[0], y[0]])
        return np.array([middle + HIPS_M * across + step * ahead,
                         middle - HIPS_M * across - step * ahead])  # fmt: skip


def legs_at(people: Sequence[Person], at_s: float, robot: Floats) -> Floats:
    """Return the legs of all who are there then, (n, 2) m."""
    found = [legs for person in people if (legs := person.legs(at_s)) is not None]
    far = [legs for legs in found if np.hypot(*(legs - robot).T).min() > APART_M]
    return np.concatenate(far) if far else np.empty((0, 2))


def people_of(
    track: Track, lives: Sequence[DoorLife], *, walkers_per_min: float, in_doorway: float,
    rng: np.random.Generator,
) -> list[Person]:  # fmt: skip
    """Return who comes towards the robot, stands in doorways, and walks through them."""
    people = _walkers(track, walkers_per_min, rng)
    for life in lives:
        for start_s, end_s in _near(track, life):
            chance = rng.random()
            at_s = float(rng.uniform(start_s, end_s))
            if chance < in_doorway:
                people.append(_stander(track, life, at_s, rng))
            elif chance < 2 * in_doorway and life.body.word(life.amounts(at_s)) == "OPEN":
                people.append(_passer(life, at_s, rng))
    return people


def _walkers(track: Track, per_min: float, rng: np.random.Generator) -> list[Person]:
    """Return who comes along the robot's way, from ahead or from behind, beside it."""
    length_s = float(track.times_s[-1])
    people = []
    for meets_s in rng.uniform(0, length_s, rng.poisson(per_min * length_s / 60)):
        around = np.flatnonzero(np.abs(track.times_s - meets_s) < 12)
        way, theta = track.poses[around, :2], track.poses[around, 2]
        aside = rng.uniform(0.5, 0.75) * rng.choice([-1, 1])
        way = way + aside * np.stack([-np.sin(theta), np.cos(theta)], -1)
        gone = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
        speed = rng.uniform(0.8, 1.5)
        if rng.random() < 0.7:
            way, gone = way[::-1], (gone[-1] - gone)[::-1]
        times_s = meets_s + (gone - gone[-1] / 2) / speed
        people.append(Person(times_s, way, float(rng.uniform(0, math.tau))))
    return people


def _near(track: Track, life: DoorLife) -> list[tuple[float, float]]:
    """Return from when to when the robot was near a door, again and again."""
    middle = np.mean(life.body.ends, axis=0)
    near = np.hypot(*(track.poses[:, :2] - middle).T) < NEAR_M
    borders = np.flatnonzero(np.diff(np.concatenate([[0], near.astype(np.int8), [0]])))
    last = len(track.times_s) - 1
    return [
        (float(track.times_s[a]), float(track.times_s[min(b, last)]))
        for a, b in borders.reshape(-1, 2)
    ]


def _stander(track: Track, life: DoorLife, at_s: float, rng: np.random.Generator) -> Person:
    start, end = life.body.ends
    place = start + rng.uniform(0.2, 0.8) * (end - start)
    left = life.body.drawn.left
    robot = track.pose(at_s)[:2]
    towards = left * (1 if (robot - place) @ left > 0 else -1)
    is_open = life.body.word(life.amounts(at_s)) == "OPEN"
    place = place + towards * (rng.uniform(-0.25, 0.25) if is_open else rng.uniform(0.35, 0.6))
    stays_s = rng.uniform(10, 40)
    times_s = at_s + np.array([-stays_s / 2, stays_s / 2])
    return Person(times_s, np.array([place, place]), float(rng.uniform(0, math.tau)))


def _passer(life: DoorLife, at_s: float, rng: np.random.Generator) -> Person:
    start, end = life.body.ends
    middle = start + rng.uniform(0.35, 0.65) * (end - start)
    reach = life.body.drawn.left * rng.choice([-1, 1]) * 1.6
    speed = rng.uniform(0.8, 1.3)
    times_s = at_s + np.array([-1, 1]) * 1.6 / speed
    return Person(times_s, np.array([middle - reach, middle + reach]), float(rng.uniform(0, 6)))
