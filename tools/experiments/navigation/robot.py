"""The robot: where it is, what it senses, and what its maps say of the world."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from navigation.door_daemon import state_of
from navigation.door_sensor import DoorSensor
from navigation.door_shares import DoorShares
from navigation.floors import Cell, Floor, Point
from navigation.global_costmap import GlobalCostmap
from navigation.laser import Laser
from navigation.obstacle_layer import ObstacleLayer
from navigation.records import RunRecorder
from navigation.setups import Setup
from navigation.world import World
from semmap_log.core.model.doors import DoorId

SPEED_M_S = 0.7
POSE_EVERY_S = 1.0
LOSS_M = 21.0
"""What it costs to find a door shut, as a way: half a minute of waiting."""
SHUT_P = 0.15
"""A door that is open less likely than this counts as shut."""
WEIGHED_EVERY_S = 60.0
"""So often P(open) is asked for anew, if nothing was seen meanwhile."""


@dataclass(frozen=True)
class Senses:
    """What tells the robot of the world."""

    laser: Laser
    sensor: DoorSensor | None
    near_m: float
    obstacles: ObstacleLayer | None
    """None: the global costmap has no such layer."""


class Robot:
    """The robot of a run. What it comes to know of doors, it writes to its log."""

    def __init__(
        self, floor: Floor, world: World, setup: Setup, senses: Senses, *, recorder: RunRecorder,
        start: Point, known: Mapping[DoorId, bool] | None = None,
    ) -> None:  # fmt: skip
        """Put it on a floor.

        Args:
            floor: Which.
            world: Whose doors it meets.
            setup: What it uses to plan.
            senses: What it senses with.
            recorder: Where it writes.
            start: Where it stands.
            known: What its map, if it has one, says of the doors; default: how they stand.
        """
        self.floor, self.world, self.setup = floor, world, setup
        self.place, self.heading = start, 0.0
        self.shares = DoorShares(floor.door_ids)
        self.costmap = GlobalCostmap(floor, senses.obstacles)
        self._senses, self._recorder = senses, recorder
        self._known = dict(world.is_open if known is None else known) if setup.map else {}
        self.shut: frozenset[DoorId] = frozenset()
        """The doors that count as shut, as it thought last."""
        self._is_redrawn = False
        self._seen_from: tuple[Cell, int, int] | None = None
        self._looked_from: tuple[Cell, int] | None = None
        self._posed_s = self._weighed_s = -math.inf
        for door, is_open in self._known.items():
            self.shares.saw(0.0, door, is_open=is_open)
        if setup.smart:
            world.tell(self._hear)
        self.pose()
        self.look()

    @property
    def now_s(self) -> float:
        """What its clock shows."""
        return self.world.now_s

    @property
    def cell(self) -> Cell:
        """The cell that it is in."""
        cell = self.floor.cell(self.place)
        assert cell is not None, "a way never leaves the map"
        return cell

    def wait(self, seconds: float) -> None:
        """Stand, and look."""
        self.world.advance(seconds)
        self.look()

    def turn_round(self, seconds: float) -> None:
        """Turn once on the spot, and look in all directions."""
        self.world.advance(seconds)
        self._look_at_doors()
        looked_from = self.cell, self.world.version
        if self._senses.obstacles is not None and looked_from != self._looked_from:
            self._looked_from = looked_from
            self._senses.obstacles.take_in(self._senses.laser.look_around(self.cell))

    def move(self, place: Point, heading: float, seconds: float) -> None:
        """Be there so much later."""
        self.world.advance(seconds)
        self.place, self.heading = place, heading
        if self.now_s - self._posed_s >= POSE_EVERY_S:
            self.pose()
        self.look()

    def pose(self) -> None:
        """Write where it is."""
        self._posed_s = self.now_s
        self._recorder.pose(self.now_s, *self.place, self.heading)

    def look(self) -> None:
        """Look at near doors, and with the laser; from where it has just looked, only at doors."""
        self._look_at_doors()
        if self._senses.obstacles is None:
            return
        seen_from = self.cell, round(math.degrees(self.heading)), self.world.version
        if seen_from != self._seen_from:
            self._seen_from = seen_from
            self._senses.obstacles.take_in(self._senses.laser.scan(self.cell, self.heading))

    def sees(self, place: Point) -> bool:
        """Tell whether nothing stands between the laser and a place near it, shut doors included.

        What stands at the place itself is not between.
        """
        away = place[0] - self.place[0], place[1] - self.place[1]
        distance = math.hypot(*away) - 2.5 * self.floor.geometry.resolution
        bearing = math.atan2(away[1], away[0])
        return distance <= 0 or self._senses.laser.sees(self.cell, bearing, distance)

    def forget_obstacles(self, side_m: float) -> None:
        """Clear the obstacle layer but for a square around the robot."""
        if self._senses.obstacles is not None:
            keep = round(side_m / 2 / self.floor.geometry.resolution)
            self._senses.obstacles.forget(self.cell, keep)
            self._seen_from = self._looked_from = None

    def think(self) -> GlobalCostmap:
        """Return the global costmap with all that the robot knows."""
        if self.setup.belief:
            self._weigh_doors()
        elif self.setup.map and not self._is_redrawn:
            self._show_doors(self._known)
        self._is_redrawn = True
        self.costmap.update()
        return self.costmap

    def _show_doors(self, passable: Mapping[DoorId, bool]) -> None:
        self.shut = frozenset(door for door, is_passable in passable.items() if not is_passable)
        self.costmap.show_doors(passable)

    def _weigh_doors(self) -> None:
        if self._is_redrawn and self.now_s - self._weighed_s < WEIGHED_EVERY_S:
            return
        self._weighed_s = self.now_s
        p_open = {door: self.shares.p_open(self.now_s, door) for door in self._known}
        self._show_doors({door: p >= SHUT_P for door, p in p_open.items()})
        loss = LOSS_M / self.floor.geometry.resolution
        self.costmap.charge({door: loss * (1 - p) / p for door, p in p_open.items() if p >= SHUT_P})

    def _look_at_doors(self) -> None:
        if self._senses.sensor is None:
            return
        near = self.floor.doors_near(self.place, self._senses.near_m)
        told = self._senses.sensor.look(self.now_s, near, self.world.is_open, self._known)
        if told:
            self.pose()
        for door, is_open in told:
            self._learn(door, is_open, self._senses.sensor.notices, "door_sensor")

    def _hear(self, _at_s: float, door: DoorId, is_open: bool) -> None:  # noqa: FBT001 - a listener
        self._learn(door, is_open, 1.0, "smart_door")

    def _learn(self, door: DoorId, is_open: bool, accuracy: float, source: str) -> None:  # noqa: FBT001
        self._recorder.sighted(
            self.now_s, door, state_of(is_open), accuracy=accuracy, source=source
        )
        self.shares.saw(self.now_s, door, is_open=is_open)
        self._is_redrawn &= self._known[door] == is_open and not self.setup.belief
        self._known[door] = is_open
