"""Where the robot is sent: random points of the map, whatever is there (appendix E.1)."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass

from navigation.floors import Cell, Floor, Point
from navigation.global_costmap import NOWHERE, GlobalCostmap
from semmap_log.analysis.costmap_2d.costs import NO_INFORMATION


@dataclass(frozen=True)
class Goal:
    """A place to go to."""

    number: int
    """From 1 on; a seed gives each number the same place in all setups."""
    place: Point
    kind: str
    """`free`, `occupied` (the robot does not fit there) or `outside` of the building."""


class Goals:
    """Points, evenly over the map's rectangle."""

    def __init__(self, floor: Floor, rng: random.Random) -> None:
        """Draw them on a floor.

        Args:
            floor: Its static map says what is where.
            rng: Where they come from; nobody else draws from it.
        """
        self._floor, self._rng = floor, rng
        costmap = GlobalCostmap(floor, None)
        costmap.update()
        self._regions = costmap.regions

    def __iter__(self) -> Iterator[Goal]:
        """Yield goals without end."""
        number = 0
        while True:
            number += 1
            place = self._point()
            yield Goal(number, place, self._kind(place))

    def start(self, rng: random.Random) -> Point:
        """Return where the robot stands at first: any place where it can be."""
        geometry = self._floor.geometry
        while True:
            cell = rng.randrange(geometry.height), rng.randrange(geometry.width)
            if self._regions[cell] != NOWHERE:
                return self._floor.point(cell)

    def _point(self) -> Point:
        geometry = self._floor.geometry
        width, height = (cells * geometry.resolution for cells in (geometry.width, geometry.height))
        x, y = self._rng.random() * width, self._rng.random() * height
        return geometry.origin_x + x, geometry.origin_y + y

    def _kind(self, place: Point) -> str:
        cell: Cell | None = self._floor.cell(place)
        if cell is None or self._floor.static[cell] == NO_INFORMATION:
            return "outside"
        return "free" if self._regions[cell] != NOWHERE else "occupied"
