"""How far it is to walk, and how long it takes: between places of a level, or of a building."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.rooms.door_ways import LEFT, RIGHT, DoorWays, Place
from semmap_log.analysis.rooms.level_rooms import Point, RoomPlan, placed_on
from semmap_log.analysis.rooms.room_graph import Lift
from semmap_log.analysis.rooms.walking_floor import WalkingFloor
from semmap_log.core.model.doors import Door, DoorId
from semmap_log.core.model.events import FloorMap
from semmap_log.errors import CostmapError

RADIUS_M = 0.25
CELL_M = 0.15
SPEED_M_S = 0.7
RIDE_S = 40.0


class WalkingDistances:
    """Walking distances on one level, metres; see `TravelTimes` for those over several.

    A robot walks on known free floor, its middle no nearer to walls than its radius, and through
    the middle of doors that are not shut, however narrow they are. Lengths are octile: straight
    and diagonal steps, at most 8 % longer than the straight line.
    """

    def __init__(
        self,
        floor: FloorMap,
        doors: Iterable[Door],
        *,
        radius_m: float = RADIUS_M,
        cell_m: float = CELL_M,
    ) -> None:
        """Draw the floor; measured distances are kept.

        Args:
            floor: The level's plan.
            doors: Doors, in whatever state; those of other levels, or without a place, are left
                out.
            radius_m: The robot's radius.
            cell_m: Metres a cell; at least the plan's.

        Raises:
            CostmapError: The plan is rotated against its grid, or has too many cells of that size;
                or a number is invalid.
        """
        _check_in_range({"radius_m": radius_m, "cell_m": cell_m})
        on_level = placed_on(doors).get(floor.level, [])
        self._level = floor.level
        walking = WalkingFloor(floor, on_level, radius_m=radius_m, cell_m=cell_m)
        self._ways = DoorWays({floor.level: walking})

    def between(
        self,
        from_points: Sequence[Point],
        to_points: Sequence[Point],
        shut: Collection[DoorId] = (),
    ) -> NDArray[np.float64]:
        """Return the metres from points to points: (n, m); inf: there is no way.

        A point nearer to a wall than the robot's radius counts as the nearest place where it can
        stand; from one in a wall, or too far from such a place, there is no way.

        Args:
            from_points: (x, y), metres, frame `map`.
            to_points: (x, y), metres, frame `map`.
            shut: Doors that let nobody through.
        """
        return self._ways.costs(self._places(from_points), self._places(to_points), shut=shut)

    def way(self, start: Point, end: Point, shut: Collection[DoorId] = ()) -> list[Point] | None:
        """Return the corners of a shortest way, both ends included; None: there is none."""
        places = self._places([start, end])
        found = self._ways.way(*places, shut=shut)
        return None if found is None else [(place.x, place.y) for place in found]

    def before(self, door_id: DoorId) -> tuple[Point | None, Point | None]:
        """Return where the robot stands to the left and to the right of a door; None: nowhere."""
        left, right = (self._ways.before(door_id, side) for side in (LEFT, RIGHT))
        return (left.x, left.y) if left else None, (right.x, right.y) if right else None

    def _places(self, points: Sequence[Point]) -> list[Place]:
        return [Place(self._level, x, y) for x, y in points]


class TravelTimes:
    """Travel times between places of a building, seconds, over all of its levels.

    Walking as in `WalkingDistances`, at one speed; doors with the same annotation `lift` join
    their levels by a ride that takes the same time between any two.
    """

    def __init__(
        self,
        floors: Mapping[int, FloorMap],
        doors: Iterable[Door],
        lifts: Iterable[Lift] = (),
        *,
        speed_m_s: float = SPEED_M_S,
        ride_s: float = RIDE_S,
        radius_m: float = RADIUS_M,
        cell_m: float = CELL_M,
    ) -> None:
        """Draw the floors; measured distances are kept.

        Args:
            floors: The levels' plans, by their numbers.
            doors: All doors, in whatever state.
            lifts: The lifts, of `RoomGraph.lifts`.
            speed_m_s: The robot's speed.
            ride_s: The time of a lift ride, including the wait for it.
            radius_m: The robot's radius.
            cell_m: Metres a cell; at least the plans'.

        Raises:
            CostmapError: A plan is rotated against its grid, or has too many cells of that size;
                or a number is invalid.
        """
        _check_in_range(
            {"radius_m": radius_m, "cell_m": cell_m, "ride_s": ride_s, "speed_m_s": speed_m_s}
        )
        placed = placed_on(doors)
        walking = {
            level: WalkingFloor(floor, placed.get(level, []), radius_m=radius_m, cell_m=cell_m)
            for level, floor in sorted(floors.items())
        }
        self._ways = DoorWays(walking, lifts)
        self._metre_s = 1.0 / speed_m_s
        self._ride_s = ride_s

    @classmethod
    def of_plan(
        cls,
        plan: RoomPlan,
        *,
        speed_m_s: float = SPEED_M_S,
        ride_s: float = RIDE_S,
        radius_m: float = RADIUS_M,
        cell_m: float = CELL_M,
    ) -> TravelTimes:
        """Return the travel times in a log's building; options as for the class itself."""
        return cls(
            plan.floors, plan.door_map.doors.values(), plan.graph.lifts,
            speed_m_s=speed_m_s, ride_s=ride_s, radius_m=radius_m, cell_m=cell_m,
        )  # fmt: skip

    def between(
        self,
        from_places: Sequence[Place],
        to_places: Sequence[Place],
        shut: Collection[DoorId] = (),
    ) -> NDArray[np.float64]:
        """Return the seconds from places to places: (n, m); inf: there is no way.

        Args:
            from_places: On any levels.
            to_places: On any levels.
            shut: Doors that let nobody through.
        """
        return self._ways.costs(
            from_places, to_places, shut=shut, metre=self._metre_s, ride=self._ride_s
        )

    def way(self, start: Place, end: Place, shut: Collection[DoorId] = ()) -> list[Place] | None:
        """Return the corners of a quickest way, both ends included; None: there is none.

        Two corners on different levels are the ends of a lift ride.
        """
        return self._ways.way(start, end, shut=shut, metre=self._metre_s, ride=self._ride_s)

    def before(self, door_id: DoorId) -> tuple[Place | None, Place | None]:
        """Return where the robot stands to the left and to the right of a door; None: nowhere."""
        return self._ways.before(door_id, LEFT), self._ways.before(door_id, RIGHT)


def _check_in_range(numbers: Mapping[str, float]) -> None:
    """Check that the robot's radius and speed are possible.

    Raises:
        CostmapError: A number is not finite, or too small.
    """
    for name, number in numbers.items():
        may_be_0 = name in {"radius_m", "ride_s"}
        if not math.isfinite(number) or number < 0 or (number == 0 and not may_be_0):
            least = "from 0 on" if may_be_0 else "above 0"
            raise CostmapError(f"{name}: expected a finite number {least}, got {number!r}")
