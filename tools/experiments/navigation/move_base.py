"""How the robot gets to a goal: planning, driving, stopping, recovering, giving up, as move_base.

The global planner plans once, and anew when the local one stops 1.5 m before what blocks the way.
Where there is no way, or none that is free, it tries for a while, turns round, turns round once
more, and gives up. The times are move_base's as it comes: a goal without a way is given up after
18 s, which is the thesis's "about 20 seconds".
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

from navigation.floors import Point
from navigation.robot import SPEED_M_S, Robot
from navigation.ways import Crossing, Way, WayFinder

STOP_M = 1.5
"""So far ahead the local planner sees that the way is blocked."""
STEP_S = 0.5
PLANNER_PATIENCE_S = 5.0
CONTROLLER_PATIENCE_S = 15.0
TRY_S = 1.0
"""While it waits, it looks and tries so often."""
TURN_S = 6.28
"""Once round, at 1 rad/s (`rotate_recovery`)."""
RESETS_M = (3.0, 1.0)
"""Before each turn: the side of the square in which `clear_costmap_recovery` keeps obstacles."""
LEAVING_M = 0.3
"""A door that closes on the robot does not keep it: so near, it goes on."""
MOST_BLOCKED = 30
"""A goal is given up when the way to it was blocked so often."""


@dataclass
class Drive:
    """How a goal was driven to."""

    reached: bool = False
    planned_s: float | None = None
    """What the first way would have taken; None: there was none."""
    drove_s: float = 0.0
    waited_s: float = 0.0
    """Standing: planning, waiting, turning."""
    path_m: float = 0.0
    plans: int = 0
    """How many ways were found, those included that were blocked where the robot stood."""
    blocked: int = 0
    """How often the local planner stopped before a shut door, or could not even begin."""

    def found(self, way: Way) -> None:
        """Count a way."""
        self.plans += 1
        if self.planned_s is None:
            self.planned_s = way.length_m / SPEED_M_S

    def figures(self) -> dict[str, float | int | None]:
        """Return all but whether it was reached, rounded to what means something."""
        told = {name: value for name, value in asdict(self).items() if name != "reached"}
        return {
            name: round(value, 3) if isinstance(value, float) else value
            for name, value in told.items()
        }


class MoveBase:
    """Sends the robot to goals, one at a time."""

    def __init__(
        self, robot: Robot, *, recovery_clears: bool = False, margin_m: float = 0.0
    ) -> None:
        """Take the robot.

        Args:
            robot: Which drives.
            recovery_clears: Before it turns round, it forgets the obstacles that it saw elsewhere.
            margin_m: The local planner wants so much room around the robot at a goal.
        """
        self._robot = robot
        self._finder = WayFinder(robot.floor, robot.costmap)
        self._recovery_clears, self._margin_m = recovery_clears, margin_m

    def plan(self, goal: Point) -> Way | None:
        """Return a way by all that the robot knows; None: there is none."""
        self._robot.think()
        return self._finder.find(self._robot.place, goal)

    def knows_way(self, goal: Point) -> bool:
        """Tell whether there is a way by all that the robot knows, which `plan` would return."""
        self._robot.think()
        return self._finder.leads(self._robot.place, goal) is not None

    def go(self, goal: Point) -> Drive:
        """Drive to a goal; return how that went."""
        drive = Drive()
        while drive.blocked <= MOST_BLOCKED:
            way = self._way(goal, drive)
            if way is None:
                break
            if self._follow(way, drive):
                drive.reached = self._has_room(drive)
                break
            drive.blocked += 1
        self._robot.pose()
        return drive

    def _has_room(self, drive: Drive) -> bool:
        """Tell whether the local planner accepts where it is; if not, it tries in vain."""
        if not self._margin_m or self._robot.think().has_room(self._robot.cell, self._margin_m):
            return True
        self._robot.wait(CONTROLLER_PATIENCE_S)
        self._robot.turn_round(TURN_S)
        self._robot.turn_round(TURN_S)
        drive.waited_s += CONTROLLER_PATIENCE_S + 2 * TURN_S
        return False

    def _way(self, goal: Point, drive: Drive) -> Way | None:
        """Return a way that is free as far as can be seen; None: given up."""
        way = self.plan(goal)
        if way is not None:
            drive.found(way)
            if self._is_free(way):
                return way
            drive.blocked = max(drive.blocked, 1)  # a stop on the way was counted as it was made
        began_s = self._robot.now_s
        found = self._recovered(goal, PLANNER_PATIENCE_S if way is None else CONTROLLER_PATIENCE_S)
        drive.waited_s += self._robot.now_s - began_s
        if found is not None:
            drive.found(found)
        return found

    def _recovered(self, goal: Point, patience_s: float) -> Way | None:
        known = self._known()
        left_s = patience_s
        while left_s > 0:
            self._robot.wait(min(TRY_S, left_s))
            left_s -= TRY_S
            if known != (known := self._known()) and (way := self._free_way(goal)) is not None:
                return way
        for side_m in RESETS_M:
            if self._recovery_clears:
                self._robot.forget_obstacles(side_m)
                if (way := self._free_way(goal)) is not None:
                    return way
            self._robot.turn_round(TURN_S)
            if known != (known := self._known()) and (way := self._free_way(goal)) is not None:
                return way
        return None

    def _known(self) -> tuple[int, int]:
        """Return what differs when another try may end otherwise."""
        return self._robot.think().version, self._robot.world.version

    def _free_way(self, goal: Point) -> Way | None:
        way = self.plan(goal)
        return way if way is not None and self._is_free(way) else None

    def _is_free(self, way: Way) -> bool:
        return not self._is_blocked(way.crossings(self._robot.floor), 0.0)

    def _follow(self, way: Way, drive: Drive) -> bool:
        """Drive along a way; return whether its end was reached."""
        crossings = way.crossings(self._robot.floor)
        along_m = 0.0
        while along_m < way.length_m:
            if self._is_blocked(crossings, along_m):
                return False
            step_m = min(SPEED_M_S * STEP_S, way.length_m - along_m)
            along_m = along_m + step_m if step_m == SPEED_M_S * STEP_S else way.length_m
            x, y, heading = way.at(along_m)
            self._robot.move((x, y), heading, step_m / SPEED_M_S)
            drive.drove_s += step_m / SPEED_M_S
            drive.path_m += step_m
        return True

    def _is_blocked(self, crossings: list[Crossing], along_m: float) -> bool:
        """Tell whether a shut door is seen on the way, so near that the local planner stops."""
        is_open = self._robot.world.is_open
        return any(
            along_m < crossing.along_m <= along_m + STOP_M
            and crossing.along_m > LEAVING_M
            and not is_open[crossing.door]
            and self._robot.sees(crossing.place)
            for crossing in crossings
        )
