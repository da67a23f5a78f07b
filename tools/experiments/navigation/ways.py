"""Ways over the costmap: A* by a library, made straight, and timed by their true length."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from navigation.floors import Cell, Floor, Point
from navigation.global_costmap import GlobalCostmap
from semmap_log.core.model.doors import DoorId

AHEAD = 120
"""Cells of a way that are looked at for a straight piece."""
MISSING = (
    "the experiment plans with pyastar2d, which is not installed; install it with: "
    "pip install 'semmap-log[experiment]' or pip install pyastar2d"
)


class MissingPlannerError(ImportError):
    """pyastar2d is not installed."""


def planner() -> Any:
    """Return the function that finds paths.

    Raises:
        MissingPlannerError: With the line that installs it.
    """
    try:
        from pyastar2d import astar_path
    except ImportError as error:
        raise MissingPlannerError(MISSING) from error
    return astar_path


@dataclass(frozen=True)
class Crossing:
    """Where a way goes through a door."""

    along_m: float
    """From the start of the way."""
    door: DoorId
    place: Point


@dataclass(frozen=True)
class Way:
    """A way as straight pieces from corner to corner."""

    corners: NDArray[np.float64]
    """(n, 2) m."""

    @cached_property
    def _reached_m(self) -> NDArray[np.float64]:
        steps = np.hypot(*np.diff(self.corners, axis=0).T)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def length_m(self) -> float:
        """How long it is."""
        return float(self._reached_m[-1])

    def at(self, along_m: float) -> tuple[float, float, float]:
        """Return x, y and the heading, m and rad, so far along the way."""
        piece = int(np.searchsorted(self._reached_m, along_m, "right")) - 1
        piece = max(0, min(piece, len(self.corners) - 2))
        if len(self.corners) < 2:
            return *self.corners[0].tolist(), 0.0
        (x, y), (to_x, to_y) = self.corners[piece].tolist(), self.corners[piece + 1].tolist()
        length = math.hypot(to_x - x, to_y - y)
        begin_m = float(self._reached_m[piece])
        share = 0.0 if length == 0 else min(1.0, (along_m - begin_m) / length)
        heading = math.atan2(to_y - y, to_x - x)
        return x + share * (to_x - x), y + share * (to_y - y), heading

    def crossings(self, floor: Floor) -> list[Crossing]:
        """Return the doors that it goes through, in order."""
        if len(self.corners) < 2:
            return []
        begin, step = self.corners[:-1, None], np.diff(self.corners, axis=0)[:, None]
        door, leaf = floor.door_ends[None, :, :2], floor.door_ends[None, :, 2:]
        along, offset = leaf - door, door - begin
        turn = _cross(step, along)
        with np.errstate(divide="ignore", invalid="ignore"):
            on_way, on_door = _cross(offset, along) / turn, _cross(offset, step) / turn
        pieces, doors = np.nonzero((on_way >= 0) & (on_way < 1) & (on_door >= 0) & (on_door <= 1))
        shares = on_way[pieces, doors]
        lengths = np.diff(self._reached_m)[pieces]
        places = self.corners[pieces] + shares[:, None] * step[pieces, 0]
        found = [
            Crossing(float(at), floor.door_ids[number], (float(place[0]), float(place[1])))
            for at, number, place in zip(
                self._reached_m[pieces] + shares * lengths, doors.tolist(), places, strict=True
            )
        ]
        return sorted(found, key=lambda crossing: (crossing.along_m, crossing.door))


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    found: NDArray[np.float64] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return found


class WayFinder:
    """Finds ways over a costmap.

    Raises:
        MissingPlannerError: The library is not there.
    """

    def __init__(self, floor: Floor, costmap: GlobalCostmap) -> None:
        self._floor, self._costmap = floor, costmap
        self._astar = planner()

    def find(self, start: Point, goal: Point) -> Way | None:
        """Return a cheapest way; None: there is none.

        A robot that stands where it cannot be (a door has closed on it) first goes to the nearest
        cell where it can.
        """
        ends = self.leads(start, goal)
        if ends is None:
            return None
        free, there = ends
        cells = self._astar(self._costmap.weights, free, there, allow_diagonal=True)
        corners = straightened(cells, self._costmap.weights)
        points = [start, *(self._floor.point((int(r), int(c))) for r, c in corners[1:-1]), goal]
        if free != self._floor.cell(start):
            points.insert(1, self._floor.point(free))
        return Way(np.array(points, np.float64))

    def leads(self, start: Point, goal: Point) -> tuple[Cell, Cell] | None:
        """Return the cells that a way begins and ends in; None: there is none."""
        here, there = self._floor.cell(start), self._floor.cell(goal)
        if here is None or there is None:
            return None
        free = self._costmap.free_cell(here)
        if free is None or not self._costmap.is_reachable(free, there):
            return None
        return free, there


def straightened(cells: NDArray[np.int32], weights: NDArray[np.float32]) -> NDArray[np.int32]:
    """Return the corners of a path: cells joined by straight pieces no dearer than it was.

    The library charges a diagonal step like a straight one, so that its paths may zigzag.
    """
    corners, first = [0], 0
    price = weights[cells[:, 0], cells[:, 1]]
    while first < len(cells) - 1:
        last = _farthest(cells, price, weights, first)
        corners.append(last)
        first = last
    return cells[corners]


def _farthest(
    cells: NDArray[np.int32], price: NDArray[np.float32], weights: NDArray[np.float32], first: int
) -> int:
    """Return the place on the path up to which a straight piece is no dearer: by doubling."""
    reached, step = first + 1, 1
    most = min(first + AHEAD, len(cells) - 1)
    while step:
        ahead = min(reached + step, most)
        if ahead > reached and _is_no_dearer(cells, price, weights, first, ahead):
            reached, step = ahead, step * 2
        else:
            step //= 2
    return reached


def _is_no_dearer(
    cells: NDArray[np.int32], price: NDArray[np.float32], weights: NDArray[np.float32],
    first: int, last: int,
) -> bool:  # fmt: skip
    start, end = cells[first], cells[last]
    share = np.linspace(0.0, 1.0, 2 * int(np.abs(end - start).max()) + 1)
    rows = np.rint(start[0] + share * (end[0] - start[0])).astype(np.intp)
    columns = np.rint(start[1] + share * (end[1] - start[1])).astype(np.intp)
    return bool(weights[rows, columns].max() <= price[first : last + 1].max())
