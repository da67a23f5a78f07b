"""Costs in a costmap: their values, the thesis's door layer, and how layers are merged.

Values and their conversion to map values and back follow costmap_2d/cost_values.h; the publisher's
table, costmap_2d_publisher.cpp (the same in Nav2); StaticLayer::interpretValue, static_layer.cpp.

The door layer of the thesis (4.3) draws a line of cells for every door, in a grid of its own. A
closed door is LETHAL, an open one FREE_SPACE, any other NO_INFORMATION; or a cost of its own.
Doors are drawn in ascending order of their ids, and the last one has the cell: a door of unknown
state erases what a lower id drew there. What lies on the floor, such as a spill, comes last. Only
cells with information reach the master (`costmap_2d`'s updateWithOverwrite), so an open door cuts
its opening into a wall. The grid is a function of the doors alone: drawn door by door or all at
once, it is the same byte for byte.

The update methods are those of ROS's CostmapLayer. Each takes the same window of both grids (uint8,
of one shape) and writes into the first. Sources: costmap_2d/src/costmap_layer.cpp;
nav2_costmap_2d/src/costmap_layer.cpp for the last one.

A polygon has the cells that its sides go through, and those whose middle lies within. Lines are
those of the thesis (Fig. 4.2, "compact Bresenham"), of many doors at once: over k steps of the
longer axis, `(2 k minor + major - 1) // (2 major)` steps of the shorter, which is k minor / major,
rounded to the nearest, halves down, away from the start. So the line from the other end hits other
cells, as do `costmap_2d`'s `raytraceLine` and scikit-image's `line` in a third of all directions.
The formula replaces the loop, cell for cell: `test_lines.py` checks it.
"""

from __future__ import annotations

import math
from bisect import insort
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.grid import CellWindow, GridGeometry, merged, read_only
from semmap_log.errors import CostmapError

Id = TypeVar("Id", bound=int)

FEW = 32
"""So many changed doors are drawn one by one; more, and all are drawn at once."""


@dataclass(frozen=True, slots=True)
class DoorLine:
    """What a door draws: the line from (x, y) to (x + width cos theta, y + width sin theta).

    What covers an area has an outline, and draws all within that instead.
    """

    x: float
    """Metres, frame `map`."""
    y: float
    theta: float
    """Radians."""
    width: float
    """Metres; 0 and less are drawn as they stand."""
    cost: int
    """0..255; NO_INFORMATION erases."""
    outline: Sequence[tuple[float, float]] = ()
    """Corners (x, y), metres, frame `map`; the last is joined to the first."""
    is_on_floor: bool = False
    """Whether it lies above all that stands in walls, whatever the ids."""


class DoorLayer:
    """The layer: its grid, and the doors drawn in it."""

    reach = 0
    """A change of it concerns no cells but those that changed."""

    def __init__(self, geometry: GridGeometry) -> None:
        self.geometry = geometry
        self._lines: dict[int, DoorLine] = {}
        self._grid = np.full(geometry.shape, NO_INFORMATION, np.uint8)
        self._cells: dict[int, NDArray[np.int64]] | None = {}
        """Door -> flat indices of its cells; None: not known since all were drawn at once."""
        self._doors_at: dict[int, list[int]] = {}
        """Flat index -> the doors that draw there, ascending."""
        self._changes: list[CellWindow] = []

    @property
    def costs(self) -> NDArray[np.uint8]:
        """The layer's own grid, (height, width), row 0 at the lowest y; read-only."""
        return read_only(self._grid)

    def draw(self, doors: Mapping[Id, DoorLine]) -> list[CellWindow]:
        """Make the layer that of these doors, and of no others.

        Args:
            doors: Id -> what it draws; ids are any integers.

        Returns:
            Where cells may have changed.
        """
        gone = dict.fromkeys(self._lines.keys() - doors.keys())
        return self.update({**gone, **doors})

    def update(self, changes: Mapping[Id, DoorLine | None]) -> list[CellWindow]:
        """Draw some doors as they are now; the cells that they leave show what lies below.

        Args:
            changes: Id -> what it draws from now on; None: nothing.

        Returns:
            Where cells may have changed.
        """
        new = {door: line for door, line in changes.items() if self._lines.get(door) != line}
        windows = self._redraw(new) if len(new) > FEW else self._draw_some(new)
        self._changes += windows
        return windows

    def take_changes(self) -> list[CellWindow]:
        """Return where cells may have changed since the last call."""
        changes, self._changes = self._changes, []
        return merged(changes)

    def update_costs(self, master: NDArray[np.uint8], window: CellWindow) -> CellWindow:
        """Write the layer's information into the master, in that window."""
        overwrite(master[window.slices], self._grid[window.slices])
        return window

    def _redraw(self, changes: Mapping[Id, DoorLine | None]) -> list[CellWindow]:
        lines: dict[int, DoorLine | None] = {**self._lines}
        lines.update(changes.items())
        self._lines = {door: line for door, line in lines.items() if line}
        before, self._grid = self._grid, drawn(self.geometry, self._lines)
        self._cells = None
        return bounds_of(before != self._grid)

    def _draw_some(self, changes: Mapping[Id, DoorLine | None]) -> list[CellWindow]:
        cells = self._known_cells()
        windows: list[CellWindow] = []
        for door, line in changes.items():
            before = cells.pop(door, _NO_CELLS)
            self._lines.pop(door, None)
            after = _NO_CELLS
            if line:
                self._lines[door] = line
                after = cells[door] = cells_of(self.geometry, {door: line})[1]
            self._move(door, before, after)
            windows += [*self._bounds(before), *self._bounds(after)]
        return merged(windows)

    def _move(self, door: int, before: NDArray[np.int64], after: NDArray[np.int64]) -> None:
        """Take a door from its cells and put it on others; show who is the last in each."""
        for cell in before.tolist():
            self._doors_at[cell].remove(door)
        for cell in after.tolist():
            insort(self._doors_at.setdefault(cell, []), door, key=self._height)
        flat = self._grid.reshape(-1)
        for cell in {*before.tolist(), *after.tolist()}:
            doors = self._doors_at[cell]
            flat[cell] = self._lines[doors[-1]].cost if doors else NO_INFORMATION
            if not doors:
                del self._doors_at[cell]

    def _height(self, door: int) -> tuple[bool, int]:
        """Return what decides which of several has a cell: the greatest."""
        return _height(door, self._lines[door])

    def _known_cells(self) -> dict[int, NDArray[np.int64]]:
        """Return the cells of each door, and note who draws where."""
        if self._cells is None:
            owner, cells = cells_of(self.geometry, self._lines)
            starts = np.searchsorted(owner, np.arange(len(self._lines) + 1))
            self._cells = {
                door: cells[starts[i] : starts[i + 1]] for i, door in enumerate(self._lines)
            }  # fmt: skip
            self._doors_at = {}
            for door in sorted(self._cells, key=self._height):
                for cell in self._cells[door].tolist():
                    self._doors_at.setdefault(cell, []).append(door)
        return self._cells

    def _bounds(self, cells: NDArray[np.int64]) -> list[CellWindow]:
        if not len(cells):
            return []
        y, x = np.divmod(cells, self.geometry.width)
        return [CellWindow(int(x.min()), int(y.min()), int(x.max()) + 1, int(y.max()) + 1)]


_NO_CELLS = np.empty(0, np.int64)


def _height(door: int, line: DoorLine) -> tuple[bool, int]:
    return line.is_on_floor, door


def drawn(geometry: GridGeometry, doors: Mapping[Id, DoorLine]) -> NDArray[np.uint8]:
    """Return the layer of these doors, (height, width), all lines drawn at once."""
    ascending = dict(sorted(doors.items(), key=lambda each: _height(*each)))
    grid = np.full(geometry.shape, NO_INFORMATION, np.uint8)
    owner, cells = cells_of(geometry, ascending)
    costs = np.array([line.cost for line in ascending.values()], np.uint8)
    grid.reshape(-1)[cells] = costs[owner]  # of several values for a cell the last stays
    return grid


def are_on_map(geometry: GridGeometry, lines: Sequence[DoorLine]) -> NDArray[np.bool_]:
    """Return for each line whether at least one of its cells lies on the map."""
    owner, _ = cells_of(geometry, dict(enumerate(lines)))
    return np.isin(np.arange(len(lines)), owner)


def cells_of(
    geometry: GridGeometry, doors: Mapping[Id, DoorLine]
) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Return the cells of all doors, door after door: which door (its place), and flat indices.

    Policy `clip`: a point's cell is floor((w - origin) / resolution), on the map or off it, and
    cells off the map are left out. A door that is not finite, or farther away than
    `FARTHEST_CELL`, is not drawn. Of an outline, the cells are those of its sides and those whose
    middle lies within.
    """
    areas = {place: line.outline for place, line in enumerate(doors.values()) if line.outline}
    if areas:
        return _with_areas(geometry, list(doors.values()), areas)
    ends = np.array([_ends(line) for line in doors.values()], np.float64).reshape(-1, 4)
    origin = np.array([geometry.origin_x, geometry.origin_y] * 2)
    with np.errstate(over="ignore", invalid="ignore"):
        cells = np.floor((ends - origin) / geometry.resolution)
    is_drawn = (np.abs(cells) <= FARTHEST_CELL).all(axis=1)  # False for NaN
    corners = np.where(is_drawn[:, None], cells, 0).astype(np.int64)
    lines = draw_lines(corners[:, :2], corners[:, 2:], geometry.shape)
    keep = is_drawn[lines.line]
    return lines.line[keep], (lines.y * geometry.width + lines.x)[keep]


def _with_areas(
    geometry: GridGeometry,
    lines: Sequence[DoorLine],
    outlines: Mapping[int, Sequence[tuple[float, float]]],
) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Return the cells of lines, and of the areas that some of them have instead."""
    of_lines = {place: line for place, line in enumerate(lines) if place not in outlines}
    places = np.array(list(of_lines), np.intp)
    owner, cells = cells_of(geometry, of_lines)
    owners, found = [places[owner]], [cells]
    for place, outline in outlines.items():
        flat = area_cells(geometry, outline)
        owners.append(np.full(len(flat), place, np.intp))
        found.append(flat)
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return owner[order], np.concatenate(found)[order]


def _ends(line: DoorLine) -> tuple[float, float, float, float]:
    """Return start and end, metres; NaN where there are none.

    The C library's sine and cosine, as ROS has them: numpy's may differ in the last bit.
    """
    if not math.isfinite(line.theta):
        return math.nan, math.nan, math.nan, math.nan
    return (
        line.x,
        line.y,
        line.x + line.width * math.cos(line.theta),
        line.y + line.width * math.sin(line.theta),
    )


def bounds_of(changed: NDArray[np.bool_]) -> list[CellWindow]:
    """Return the least window that holds all cells that are True; none if there are none."""
    rows = np.flatnonzero(changed.any(axis=1))
    if not len(rows):
        return []
    columns = np.flatnonzero(changed.any(axis=0))
    return [CellWindow(int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)]


Costs = NDArray[np.uint8]


def overwrite_all(master: Costs, layer: Costs) -> None:
    """Copy every cell, those without information too (`updateWithTrueOverwrite`)."""
    master[:] = layer


def overwrite(master: Costs, layer: Costs) -> None:
    """Copy the cells with information (`updateWithOverwrite`)."""
    np.copyto(master, layer, where=layer != NO_INFORMATION)


def maximum(master: Costs, layer: Costs) -> None:
    """Keep the greater cost; information beats none (`updateWithMax`)."""
    _raise_to(master, layer, (master == NO_INFORMATION) | (master < layer))


def addition(master: Costs, layer: Costs) -> None:
    """Add the costs, at most to just below INSCRIBED (`updateWithAddition`)."""
    total = np.minimum(master.astype(np.uint16) + layer, INSCRIBED - 1).astype(np.uint8)
    total = np.where(master == NO_INFORMATION, layer, total)
    np.copyto(master, total, where=layer != NO_INFORMATION)


def _raise_to(master: Costs, layer: Costs, where: NDArray[np.bool_]) -> None:
    np.copyto(master, layer, where=where & (layer != NO_INFORMATION))


FARTHEST_CELL = 1e8
"""What starts or ends further from the origin, in cells, is not drawn."""


def area_cells(geometry: GridGeometry, corners: Sequence[tuple[float, float]]) -> NDArray[np.int64]:
    """Return the flat indices of a polygon's cells on the map, ascending.

    A point lies within if a ray from it crosses an odd number of sides (the even-odd rule): a
    figure that crosses itself has holes. Its sides are drawn as doors' lines are, so that even the
    thinnest polygon shows.

    Args:
        geometry: The grid.
        corners: (x, y), metres, frame `map`; the last is joined to the first. If one is not
            finite, or too far away, nothing is drawn.
    """
    origin = np.array([geometry.origin_x, geometry.origin_y])
    with np.errstate(over="ignore", invalid="ignore"):
        points = (np.asarray(corners, np.float64) - origin) / geometry.resolution
    if not (np.abs(points) <= FARTHEST_CELL).all():  # or NaN
        return np.empty(0, np.int64)
    starts = np.floor(points).astype(np.int64)
    sides = draw_lines(starts, np.roll(starts, -1, axis=0), geometry.shape)
    inside = np.zeros(geometry.shape, np.bool_)
    inside[sides.y, sides.x] = True
    low = np.maximum(starts.min(axis=0), 0)
    high = np.minimum(starts.max(axis=0) + 1, (geometry.width, geometry.height))
    if (low < high).all():
        columns, rows = (np.arange(*span) + 0.5 for span in zip(low, high, strict=True))
        inside[low[1] : high[1], low[0] : high[0]] |= _within(points, columns, rows)
    flat: NDArray[np.int64] = np.flatnonzero(inside)
    return flat


def _within(
    points: NDArray[np.float64], columns: NDArray[np.float64], rows: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return which points of a grid, (rows, columns), lie within a polygon."""
    within = np.zeros((len(rows), len(columns)), np.bool_)
    for (x0, y0), (x1, y1) in zip(points, np.roll(points, -1, axis=0), strict=True):
        crosses = (y0 <= rows) != (y1 <= rows)
        if crosses.any():
            at = x0 + (rows[crosses] - y0) * (x1 - x0) / (y1 - y0)
            within[crosses] ^= columns[None, :] < at[:, None]
    return within


FREE_SPACE = 0
INSCRIBED = 253
"""A robot whose centre is here touches something, whichever way it is turned."""
LETHAL = 254
NO_INFORMATION = 255


def to_occupancy(costs: NDArray[np.uint8]) -> NDArray[np.int8]:
    """Return what costmap_2d publishes of costs: a nav_msgs/OccupancyGrid's data.

    Free is 0, 1..252 spread over 1..98, inscribed is 99, lethal 100, no information -1.

    Args:
        costs: uint8, of any shape.

    Returns:
        int8, of the same shape.

    Raises:
        CostmapError: The costs are not uint8.
    """
    _expect(costs, np.uint8, "costs")
    return _OCCUPANCY_OF_COST[costs]


def static_costs(
    occupancy: NDArray[np.int8],
    *,
    track_unknown: bool = True,
    trinary: bool = True,
    lethal_threshold: int = 100,
    unknown_value: int = -1,
) -> NDArray[np.uint8]:
    """Return the costs that costmap_2d's static layer makes of a map.

    A map's value is read as an unsigned byte (so -2 is 254, above every threshold).

    Args:
        occupancy: int8, of any shape: -1 unknown, 0 free .. 100 occupied.
        track_unknown: Unknown is NO_INFORMATION; else FREE_SPACE.
        trinary: What lies below the threshold is FREE_SPACE; else its share of LETHAL.
        lethal_threshold: From here on LETHAL; taken into 0..100, as the layer does.
        unknown_value: The value that means unknown; its lowest byte counts.

    Returns:
        uint8, of the same shape.

    Raises:
        CostmapError: The occupancy is not int8.
    """
    _expect(occupancy, np.int8, "occupancy")
    lethal = max(0, min(100, lethal_threshold))

    def cost_of(value: int) -> int:
        if value == unknown_value & 0xFF:
            return NO_INFORMATION if track_unknown else FREE_SPACE
        if value >= lethal:
            return LETHAL
        return FREE_SPACE if trinary else int(value / lethal * LETHAL)

    return _table(cost_of, np.uint8)[occupancy.view(np.uint8)]


def _table(entry_of: Callable[[int], int], dtype: type[Any]) -> NDArray[Any]:
    return np.array([entry_of(byte) for byte in range(256)], dtype)


def _published(cost: int) -> int:
    ends = {FREE_SPACE: 0, INSCRIBED: 99, LETHAL: 100, NO_INFORMATION: -1}
    return ends.get(cost, 1 + 97 * (cost - 1) // 251)


_OCCUPANCY_OF_COST: NDArray[np.int8] = _table(_published, np.int8)


def _expect(array: NDArray[Any], dtype: type[Any], what: str) -> None:
    if array.dtype != dtype:
        raise CostmapError(f"{what}: expected {np.dtype(dtype)}, got {array.dtype}")


Cells = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Lines:
    """The cells of some lines that lie on a map, line after line, each from its start."""

    line: NDArray[np.intp]
    """Which line a cell is of: its row in what was drawn."""
    x: Cells
    y: Cells


def draw_lines(starts: Cells, ends: Cells, shape: tuple[int, int]) -> Lines:
    """Return the cells of lines, both ends included; those off the map are left out.

    Args:
        starts: (lines, 2): the cells (x, y) where they start, on the map or not, below 2^30.
        ends: (lines, 2): where they end.
        shape: (height, width) of the map.
    """
    steps = np.abs(ends - starts)
    major = steps.max(axis=1, initial=0)
    first, last = _steps_on_map(starts, ends, shape)
    count = np.maximum(last - first + 1, 0)
    line = np.repeat(np.arange(len(starts)), count)
    before = np.cumsum(count) - count
    step = np.arange(len(line)) - (before - first)[line]
    # Along the longer axis this is the step itself; a line of one cell takes none.
    taken = (2 * step[:, None] * steps[line] + (major - 1)[line][:, None]) // np.maximum(
        2 * major, 1
    )[line][:, None]
    cells = starts[line] + np.sign(ends - starts)[line] * taken
    height, width = shape
    x, y = cells[:, 0], cells[:, 1]
    on_map = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return Lines(line[on_map], x[on_map], y[on_map])


def _steps_on_map(starts: Cells, ends: Cells, shape: tuple[int, int]) -> tuple[Cells, Cells]:
    """Return the first and the last step at which the longer axis is on the map.

    A line may be millions of cells long; of those the map never has more than fit along an edge.
    """
    steps = np.abs(ends - starts)
    longer = (steps[:, 1] > steps[:, 0]).astype(np.intp)
    lines = np.arange(len(starts))
    start, end, major = starts[lines, longer], ends[lines, longer], steps[lines, longer]
    cells = np.array([shape[1], shape[0]])[longer]
    rises = end >= start
    first = np.where(rises, -start, start - (cells - 1))
    last = np.where(rises, cells - 1 - start, start)
    return np.maximum(first, 0), np.minimum(last, major)
