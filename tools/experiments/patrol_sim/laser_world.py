"""A patrol with a laser through a level of a building: all that is true, and all that is measured.

    plan = read_plan(Path("office.building.yaml"), level=1)
    patrol = simulated(plan, World(), Laser(), seed=1, minutes=3)
    for scan in patrol.scans: ...
    where = localised(patrol.track, PoseError(0.05, 1.0), seed=1)

The world, the way and the scans do not depend on how well the robot is localised: the same scans
can be judged with many localisations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from patrol_sim.laser_casting import distances
from patrol_sim.laser_doors import (
    DOUBLE,
    DOUBLE_SLIDING,
    FOLDING,
    HINGED,
    SLIDING,
    DoorBody,
    DoorLife,
    built,
    standing,
)
from patrol_sim.laser_drive import Track, drive
from patrol_sim.laser_house import FreeFloor, Wall, furniture, lines_of, walls_of
from patrol_sim.laser_people import Person, legs_at, people_of
from patrol_sim.laser_plan import LevelPlan, PlanDoor
from patrol_sim.laser_sensor import Laser, measured
from patrol_sim.laser_surfaces import Floats, Lines, joined
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.moments import SECOND_NS

START_NS = 1_772_442_000 * SECOND_NS
"""Monday 2 March 2026, 09:00 UTC: when patrols begin."""
DOUBLE_FROM_M = 1.55
"""A door as wide as that has two leaves, in a building whose kinds are chosen by chance."""
SWINGS_AWAY = 0.85
"""Share of leaves that swing into the smaller room."""


@dataclass(frozen=True, slots=True)
class World:
    """How the building is furnished, and how its doors live."""

    mixed_kinds: bool = True
    """Kinds by chance, mostly hinged; False: as the plan says."""
    shares: tuple[float, float, float] = (0.42, 0.16, 0.42)
    """Of doors that stand CLOSED, AJAR, OPEN."""
    changes_per_hour: float = 5.0
    """Of each door."""
    glass_doors: float = 0.06
    glass_walls: float = 0.05
    furniture_per_100_m2: float = 9.0
    walkers_per_min: float = 1.0
    in_doorway: float = 0.08
    """Share of times near a door at which somebody stands in it; and as many walk through."""
    wall_m: float = 0.14
    drawing_m: float = 0.02
    """Standard deviation of where a door is drawn, along each axis."""
    asks: float = 0.5
    """Share of shut doors that somebody opens when the robot wants to go through."""
    cell_m: float = 0.2
    """Of the grid on which the robot finds its way."""


@dataclass(frozen=True, slots=True, eq=False)
class SimScan:
    """One turn of the laser."""

    at_s: float
    """Of the first beam."""
    ranges: Floats
    """(b,) m; inf: no echo."""


@dataclass(eq=False)
class Patrol:
    """A patrol that took place."""

    plan: LevelPlan
    laser: Laser
    seed: int
    walls: list[Wall]
    still: Lines
    """Walls, frames, furniture."""
    lives: dict[DoorId, DoorLife]
    track: Track
    people: list[Person]

    @property
    def length_s(self) -> float:
        """How long it took."""
        return float(self.track.times_s[-1])

    def beam_times_s(self, at_s: float) -> Floats:
        """Return when each beam of a scan was measured."""
        times: Floats = at_s + self.laser.time_increment_s * np.arange(self.laser.beams)
        return times

    def lines_at(self, at_s: float) -> Lines:
        """Return all lines as they stood then."""
        leaves = [life.body.lines(life.amounts(at_s)) for life in self.lives.values()]
        return joined([self.still, *leaves])

    def scan_times_s(self) -> Floats:
        """Return when scans begin; the last one is whole."""
        turn_s = 1 / self.laser.hz
        return np.arange(int((self.length_s - turn_s) * self.laser.hz)) * turn_s

    def scanned(self, progress: Callable[[float], None] = lambda _share: None) -> Iterator[SimScan]:
        """Measure: yield scan by scan, the same ones each time."""
        rng = np.random.default_rng([self.seed, 10])
        leaves = _Leaves(self)
        times_s = self.scan_times_s()
        for number, at_s in enumerate(times_s.tolist()):
            base = self.track.at(self.beam_times_s(at_s))
            beams = self.laser.placed(base, as_told=False)
            lines = leaves.around(base[0, :2], at_s)
            legs = legs_at(self.people, at_s, base[0, :2])
            yield SimScan(at_s, measured(self.laser, beams, lines, legs, rng=rng))
            if number % 50 == 0:
                progress(number / len(times_s))

    @cached_property
    def scans(self) -> list[SimScan]:
        """All its scans."""
        return list(self.scanned())

    @cached_property
    def passages(self) -> dict[DoorId, list[float]]:
        """When the robot went through each door, s."""
        return {door_id: life_s for door_id, life in self.lives.items()
                if (life_s := self.track.crossings_s(life))}  # fmt: skip


class _Leaves:
    """The lines around a robot; made anew only where it has moved on, or a door moves."""

    def __init__(self, patrol: Patrol) -> None:
        self._patrol = patrol
        self._reach = patrol.laser.range_max
        self._at = np.full(2, np.inf)
        self._still: Lines | None = None
        self._kept: dict[DoorId, tuple[tuple[float, float], Lines]] = {}

    def around(self, place: Floats, at_s: float) -> Lines:
        if self._still is None or np.hypot(*(place - self._at)) > 1.0:
            still = self._patrol.still
            self._still = still[distances(place, still.ends) < self._reach + 1.5]
            self._at = place
        parts = [self._still]
        for door_id, life in self._patrol.lives.items():
            if np.hypot(life.body.drawn.x - place[0], life.body.drawn.y - place[1]) > self._reach:
                continue
            amounts = life.amounts(at_s)
            kept = self._kept.get(door_id)
            if kept is None or kept[0] != amounts:
                kept = amounts, life.body.lines(amounts)
                self._kept[door_id] = kept
            parts.append(kept[1])
        return joined(parts)


def simulated(
    plan: LevelPlan, world: World, laser: Laser, *, seed: int, minutes: float,
    progress: Callable[[float], None] = lambda _share: None,
) -> Patrol:  # fmt: skip
    """Return a patrol: the same seed gives the same one.

    Args:
        plan: The level.
        world: How the building is.
        laser: What the robot carries.
        seed: Of all chance.
        minutes: How long.
        progress: Told the share of the way that is driven.
    """
    chance = {part: np.random.default_rng([seed, k]) for k, part in enumerate(
        ("kinds", "doors", "lives", "walls", "way", "furniture", "people"))}  # fmt: skip
    if world.mixed_kinds:
        plan = plan.with_kinds([_some_kind(door, chance["kinds"]) for door in plan.doors])
    floor = FreeFloor(plan.floor)
    bodies = [
        built(door, rng=chance["doors"], glass_share=world.glass_doors, wall_m=world.wall_m,
              drawing_m=world.drawing_m, side=_side(door, floor, chance["doors"]))
        for door in plan.doors
    ]  # fmt: skip
    lives = {
        body.drawn.door_id: _life(body, world, minutes * 60, chance["lives"]) for body in bodies
    }
    walls = walls_of(plan, bodies, wall_m=world.wall_m, glass_share=world.glass_walls,
                     rng=chance["walls"])  # fmt: skip
    track = drive(plan, list(lives.values()), length_s=minutes * 60, cell_m=world.cell_m,
                  asks=world.asks, rng=chance["way"], progress=progress)  # fmt: skip
    area_m2 = float((np.asarray(plan.floor.cells) == 0).sum()) * plan.floor.resolution**2
    things = furniture(plan, walls, bodies, track.poses[::10, :2], rng=chance["furniture"],
                       pieces=round(area_m2 / 100 * world.furniture_per_100_m2))  # fmt: skip
    people = people_of(track, list(lives.values()), walkers_per_min=world.walkers_per_min,
                       in_doorway=world.in_doorway, rng=chance["people"])  # fmt: skip
    still = joined([lines_of(walls, bodies, wall_m=world.wall_m), things])
    return Patrol(plan, laser, seed, walls, still, lives, track, people)


def _some_kind(door: PlanDoor, rng: np.random.Generator) -> str:
    if door.width >= DOUBLE_FROM_M:
        return str(rng.choice([DOUBLE, DOUBLE_SLIDING, FOLDING], p=[0.7, 0.25, 0.05]))
    return str(rng.choice([HINGED, SLIDING, FOLDING], p=[0.8, 0.15, 0.05]))


def _side(door: PlanDoor, floor: FreeFloor, rng: np.random.Generator) -> int:
    """Return to which side a leaf swings: mostly into the smaller room, out of people's way."""
    middle = door.ends[0] + door.width / 2 * door.along
    leans = [lean * door.along for lean in (-0.5, 0, 0.5)]
    room = [sum(floor.reach(middle, side * door.left + lean) for lean in leans) for side in (1, -1)]
    smaller = 1 if room[0] < room[1] else -1
    return smaller if rng.random() < SWINGS_AWAY else -smaller


def _life(body: DoorBody, world: World, length_s: float, rng: np.random.Generator) -> DoorLife:
    words = ("CLOSED", "AJAR", "OPEN")
    shares = np.array(world.shares) / sum(world.shares)
    life = DoorLife(body, standing(body, str(rng.choice(words, p=shares)), rng))
    mean_s = 3600 / world.changes_per_hour if world.changes_per_hour else math.inf
    at_s = 0.0
    while (at_s := at_s + rng.exponential() * mean_s) < length_s:
        life.change(at_s, standing(body, str(rng.choice(words, p=shares)), rng))
    return life
