"""How long a robot takes between places of a log's building; where there is no plan, in a line."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.rooms import OUTSIDE, Place, RoomId, RoomPlan, TravelTimes
from semmap_log.analysis.rooms.walking import SPEED_M_S
from semmap_log.core.model.doors import Door, DoorId
from semmap_log.errors import PlanError

SLOWEST_M_S, QUICKEST_M_S = 0.001, 1000.0


class WaysBetween:
    """Travel times: over the floor plans, and on levels without one in a straight line."""

    def __init__(self, plan: RoomPlan, *, speed_m_s: float = SPEED_M_S) -> None:
        """Draw the floors.

        Raises:
            PlanError: The speed is none that a robot can have.
            CostmapError: A floor plan cannot be walked on.
        """
        if not SLOWEST_M_S <= speed_m_s <= QUICKEST_M_S:
            raise PlanError(
                f"speed: expected {SLOWEST_M_S:g} to {QUICKEST_M_S:g} metres a second, "
                f"got {speed_m_s:g}."
            )
        self.plan = plan
        self.speed_m_s = speed_m_s
        self._times = TravelTimes.of_plan(plan, speed_m_s=speed_m_s)

    def before(self, door: Door, room: RoomId | None = None) -> list[Place]:
        """Return where the robot may stand before a door.

        Args:
            door: It has a place.
            room: Into which it is to lead: only on its other side; None: on either.
        """
        if door.level not in self.plan.floors:
            return [middle_of(door)]
        doorway = self.plan.graph.doorways[door.door_id]
        sides = zip((doorway.left, doorway.right), self._times.before(door.door_id), strict=True)
        return [place for side, place in sides if place is not None and side != room]

    def nearest(self, places: Sequence[Place], to: Place | None) -> Place:
        """Return which of some places is reached first from another; None: the first of them."""
        if len(places) == 1 or to is None:
            return places[0]
        return places[int(self.between_s([to], places)[0].argmin())]

    def without_plan(self, levels: Iterable[int]) -> str | None:
        """Return what to say of levels where distances are straight lines; None: nothing."""
        flat = sorted(set(levels) - set(self.plan.floors))
        if not flat:
            return None
        called = ", ".join(self.plan.door_map.level_name(level) for level in flat)
        return f"level {called} {self.plan.why_no_plan(flat)}: distances are straight lines"

    def room_of(self, place: Place) -> RoomId | None:
        """Return the room that a place lies in; None: in none, or its level has no plan."""
        return self.plan.room_at(place.level, place.x, place.y)

    def check_start(self, place: Place, called: str) -> None:
        """Return if a robot can stand there.

        Raises:
            PlanError: It is in a wall, or off the map.
        """
        floor = self.plan.floors.get(place.level)
        if floor is None:
            if place.level not in self.plan.door_map.levels and self.plan.floors:
                raise PlanError(f"{called}: there is no level {place.level}.")
            return
        around = self._times.between([place], [place])
        if not math.isfinite(around[0, 0]):
            room = self.room_of(place)
            where = "outside of the floor plan" if room == OUTSIDE else "in or too near to a wall"
            raise PlanError(
                f"{called}: ({place.x:g}, {place.y:g}) on level {place.level} is {where}; "
                "expected a place where a robot of 0.25 m radius can stand."
            )

    def between_s(
        self, sources: Sequence[Place], targets: Sequence[Place], shut: Collection[DoorId] = ()
    ) -> NDArray[np.float64]:
        """Return the seconds from places to places: (n, m); inf: there is no way."""
        found = self._times.between(sources, targets, shut)
        for row, source in enumerate(sources):
            for column, target in enumerate(targets):
                if source.level == target.level and source.level not in self.plan.floors:
                    away_m = math.dist((source.x, source.y), (target.x, target.y))
                    found[row, column] = away_m / self.speed_m_s
        return found

    def way(self, source: Place, target: Place, shut: Collection[DoorId] = ()) -> list[Place]:
        """Return the corners of the way between two places, both included.

        Args:
            source: From where.
            target: To where.
            shut: Doors that it avoids if there is a way without them.
        """
        found = self._times.way(source, target, shut) or self._times.way(source, target)
        return found or [source, target]


def middle_of(door: Door) -> Place:
    """Return the middle of a door's line."""
    (x0, y0), (x1, y1) = door.start, door.end
    return Place(door.level, (x0 + x1) / 2, (y0 + y1) / 2)
