"""The thesis's costmap layer (4.3): a line of cells for every door, in a grid of its own.

A closed door is LETHAL, an open one FREE_SPACE, any other NO_INFORMATION; or a cost of its own.
Doors are drawn in ascending order of their ids, and the last one has the cell: a door of unknown
state erases what a lower id drew there. What lies on the floor, such as a spill, comes last. Only
cells with information reach the master (`costmap_2d`'s updateWithOverwrite), so an open door cuts
its opening into a wall.

The grid is a function of the doors alone: however it came about, door by door or all at once, it
is the same byte for byte.
"""

from __future__ import annotations

import math
from bisect import insort
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.areas import FARTHEST_CELL, area_cells
from semmap_log.analysis.costmap_2d.combining import overwrite
from semmap_log.analysis.costmap_2d.costs import NO_INFORMATION
from semmap_log.analysis.costmap_2d.grid import CellWindow, GridGeometry, merged, read_only
from semmap_log.analysis.costmap_2d.lines import draw_lines

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
    """Tell of each line whether at least one of its cells lies on the map."""
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
