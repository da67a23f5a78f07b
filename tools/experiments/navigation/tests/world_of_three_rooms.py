"""The corridor with three rooms of `tests/patrol_sim`, as a world for the robot."""

from __future__ import annotations

import random
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from patrol_sim.tests.corridor import building

from navigation.door_daemon import DoorDaemon
from navigation.door_sensor import DoorSensor
from navigation.floors import Floor
from navigation.laser import Laser
from navigation.move_base import MoveBase
from navigation.obstacle_layer import ObstacleLayer
from navigation.records import RunKey, RunRecorder
from navigation.robot import Robot, Senses
from navigation.setups import SETUPS
from navigation.world import World
from semmap_log.core.model.doors import DoorId

LEFT, MIDDLE, RIGHT = DoorId(1), DoorId(2), DoorId(3)
ALL_OPEN = {LEFT: True, MIDDLE: True, RIGHT: True}
CORRIDOR, IN_LEFT, IN_MIDDLE, IN_RIGHT = (7.0, 1.2), (2.5, 5.0), (7.5, 5.0), (12.5, 5.0)


@cache
def floor() -> Floor:
    with TemporaryDirectory() as folder:
        return Floor.read(building(Path(folder)), 1)


class Script(DoorDaemon):
    """Doors that do what is told: at each iteration the next of some toggles."""

    def __init__(self, is_open: Mapping[DoorId, bool], *toggles: list[DoorId]) -> None:
        super().__init__(list(is_open), random.Random(1), base=0.0)
        self.is_open = dict(is_open)
        self._toggles = list(toggles)

    def iterate(self) -> list[DoorId]:
        toggled = self._toggles.pop(0) if self._toggles else []
        for door in toggled:
            self.is_open[door] = not self.is_open[door]
        return toggled


class Scene:
    """A robot in the corridor; what its map says may be wrong."""

    def __init__(
        self, out: Path, setup: str, is_open: Mapping[DoorId, bool], *toggles: list[DoorId],
        known: Mapping[DoorId, bool] | None = None, every_s: float = 900.0, near_m: float = 3.0,
        sense_m: float = 8.0, recovery_clears: bool = False, margin_m: float = 0.0,
        start: tuple[float, float] = CORRIDOR,
    ) -> None:  # fmt: skip
        self.out = out
        daemon = Script(is_open, *toggles)
        laser = Laser(
            floor().walls, cell_m=floor().geometry.resolution, range_m=sense_m, noise_m=0.0,
            rng=np.random.default_rng(1),
        )  # fmt: skip
        key = RunKey("corridor", setup, "fixed", 1)
        self.recorder = RunRecorder(out, key, floor().events, {}, states=daemon.states())
        self.world = World(floor(), daemon, laser, every_s=every_s)
        chosen = SETUPS[setup]
        self.laser = laser
        self.obstacles = ObstacleLayer(floor().walls, laser.margin) if chosen.obstacles else None
        has_sensor = chosen.map and not chosen.smart
        sensor = DoorSensor(random.Random(1), 1.0) if has_sensor else None
        senses = Senses(laser, sensor, near_m, self.obstacles)
        self.robot = Robot(
            floor(), self.world, chosen, senses, recorder=self.recorder, start=start, known=known
        )
        self.move_base = MoveBase(self.robot, recovery_clears=recovery_clears, margin_m=margin_m)
