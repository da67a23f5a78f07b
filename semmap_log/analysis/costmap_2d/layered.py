"""The layered costmap: layers in their order, and the master grid that they make together.

The update cycle is that of costmap_2d/src/layered_costmap.cpp: where a layer changed, the master is
reset to its default, and each layer writes into that window in turn. Windows are exact cells here,
and wide enough: the master after an update equals, byte for byte, a master drawn from scratch. The
floor plan is a layer whose costs do not change.

The inflation layer (noetic's `inflation_layer.cpp`) lowers costs with the distance from obstacles.
An update of part of a map gives the same cells as one of all of it. noetic's own incremental update
does not: which obstacle claims a cell may depend, step by step, on cells beyond the update's
window. Here this is not assumed but checked: see `InflationLayer._claimed`.

Which obstacle claims a cell is found as in noetic (updateCosts and enqueue), by a brushfire: it
starts in the obstacles and burns to the four neighbours, nearest first. A cell belongs to the
obstacle from which it was reached first, which is nearly always the nearest one, but not always:
an exact distance transform gives other costs in some cells. To be equal in every cell, this is the
same fire, laid distance by distance instead of cell by cell: all cells that burn at one distance
are one numpy step. Their order is kept, since it decides who comes first further out.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import (
    FREE_SPACE,
    INSCRIBED,
    LETHAL,
    NO_INFORMATION,
    DoorLayer,
    maximum,
    overwrite_all,
)
from semmap_log.analysis.costmap_2d.grid import CellWindow, GridGeometry, merged, read_only
from semmap_log.errors import CostmapError


class CostmapLayer(Protocol):
    """What a costmap is made of."""

    @property
    def reach(self) -> int:
        """Cells: so far around a change below it the layer's own costs may change."""

    def take_changes(self) -> list[CellWindow]:
        """Return where the layer's costs changed since the last call."""

    def update_costs(self, master: NDArray[np.uint8], window: CellWindow, /) -> CellWindow:
        """Write into the master, in that window; return it, or the wider one that is needed."""


class LayeredCostmap:
    """Some layers' master.

    Args:
        geometry: Of all layers.
        layers: In the order in which they write (the plugins of a costmap's configuration).
        track_unknown: Where no layer writes, nothing is known; else it is free.
    """

    def __init__(
        self, geometry: GridGeometry, layers: Sequence[CostmapLayer], *, track_unknown: bool = False
    ) -> None:
        self.geometry = geometry
        self._layers = tuple(layers)
        self._default = NO_INFORMATION if track_unknown else FREE_SPACE
        self._master = np.full(geometry.shape, self._default, np.uint8)
        self._reach = sum(layer.reach for layer in self._layers)

    @property
    def costs(self) -> NDArray[np.uint8]:
        """The master, (height, width), row 0 at the lowest y; read-only; as of the last update."""
        return read_only(self._master)

    def update(self) -> list[CellWindow]:
        """Bring the master up to date.

        Returns:
            Where cells may have changed.
        """
        whole = self.geometry.whole
        changed = [window for layer in self._layers for window in layer.take_changes()]
        widened = merged(window.dilated(self._reach).within(whole) for window in changed)
        return [self._update(window) for window in widened]

    def _update(self, window: CellWindow) -> CellWindow:
        """Redraw a window, or the wider one that the layers turn out to need."""
        needed = self._drawn_in(window)
        while needed != window:
            window = needed
            needed = self._drawn_in(window)
        return window

    def _drawn_in(self, window: CellWindow) -> CellWindow:
        self._master[window.slices] = self._default
        for layer in self._layers:
            needed = layer.update_costs(self._master, window)
            if needed != window:
                return needed
        return window


MOST_REACH = 1500
"""Cells: its tables, one entry for each place within reach, take 0.8 GB then."""
SURROUNDINGS = 1024
"""So many are remembered: a door that opens and closes finds the same ones again and again."""
MOST_REMEMBERED_CELLS = 2**15


class InflationLayer:
    """Costs around the lethal cells of the layers below, or around doors.

    Args:
        geometry: Of the costmap.
        radius: How far it reaches, metres (`inflation_radius`); rounded up to cells.
        scaling: How fast costs fall off, 1/m (`cost_scaling_factor`).
        inscribed: Within this distance, metres, the robot surely touches: INSCRIBED.
        inflate_unknown: Also write costs where nothing is known.
        around: Inflate that layer's doors that are, or may be, closed, instead of all lethal cells:
            with a wider radius than that of walls, a robot keeps away from a door that may open
            (the thesis's wish, 2.2.2). The doors' own cells stay as they are.

    Raises:
        CostmapError: A number is negative or not finite, or the radius is beyond `MOST_REACH`.
    """

    def __init__(
        self,
        geometry: GridGeometry,
        radius: float,
        *,
        scaling: float = 10.0,
        inscribed: float = 0.0,
        inflate_unknown: bool = False,
        around: DoorLayer | None = None,
    ) -> None:
        for name, value in (("radius", radius), ("scaling", scaling), ("inscribed", inscribed)):
            if not (math.isfinite(value) and value >= 0):
                raise CostmapError(f"inflation's {name}: expected 0 or more, got {value!r}")
        cells = math.ceil(radius / geometry.resolution)
        self.reach = min(cells, math.ceil(math.hypot(*geometry.shape)))
        """Cells: a change concerns those so far away from it, at most its diagonal."""
        if self.reach > MOST_REACH:
            raise CostmapError(
                f"inflation's radius: expected at most {MOST_REACH:,} cells "
                f"({MOST_REACH * geometry.resolution:g} m), got {radius:g} m"
            )
        self._geometry = geometry
        self._around = around
        self._inflate_unknown = inflate_unknown
        self._obstacles = np.zeros(geometry.shape, np.bool_)
        self._fire = Brushfire(self.reach)
        self._claims = np.zeros(geometry.shape, self._fire.dtype)
        costs = [self._cost(cells, scaling, inscribed) for cells in self._fire.distances]
        self._cost_of_claim = np.array([*costs, FREE_SPACE], np.uint8)[self._fire.distance_of_claim]
        self._remembered = lru_cache(SURROUNDINGS)(self._burnt_packed)

    def take_changes(self) -> list[CellWindow]:
        """Return nothing: what it adds changes with the layers below."""
        return []

    def update_costs(self, master: NDArray[np.uint8], window: CellWindow) -> CellWindow:
        """Add costs to the master in a window, or return the window that is needed.

        Args:
            master: (height, width); in the window, the layers below.
            window: Where the master is to be brought up to date; all changes lie `reach` inside.

        Returns:
            The window, if all is done; a wider one, if the layers below must be drawn in that.
        """
        if not self.reach:
            return window
        part = window.slices
        if self._around is None:
            self._obstacles[part] = master[part] == LETHAL
        else:
            costs = self._around.costs[part]
            self._obstacles[part] = (costs != FREE_SPACE) & (costs != NO_INFORMATION)
        claims = self._claimed(window)
        if claims is None:
            return window.dilated(self.reach + 8).within(self._geometry.whole)
        self._claims[part] = claims
        self._add(master[part], self._cost_of_claim[claims])
        return window

    def _claimed(self, window: CellWindow) -> NDArray[np.unsignedinteger] | None:
        """Return which obstacle claims each cell of a window; None: more than the window changed.

        The fire is laid in a wider window. Near that one's edge it may burn otherwise than in the
        whole map, for what lies beyond is missing. But if in a band around `window` every cell has
        the claim that the whole map gave it before, source and way, then the new claims inside and
        the old ones outside fit together at every cell: who claims a cell follows from its four
        neighbours, and in which order those were reached from the ways to their sources, none
        longer than `reach` along either axis. Claims that follow from each other, from the
        sources up, are those of a fire in the whole map.
        """
        whole = self._geometry.whole
        band = window.dilated(self.reach + 2).within(whole)
        wide = window.dilated(3 * self.reach + 8).within(whole)
        burnt = self._burnt(wide)
        inner, outer = window.seen_from(wide).slices, band.seen_from(wide).slices
        if window != whole:
            differs = burnt[outer] != self._claims[band.slices]
            differs[window.seen_from(band).slices] = False
            if differs.any():
                return None
        return burnt[inner]

    def _burnt(self, window: CellWindow) -> NDArray[np.unsignedinteger]:
        obstacles = self._obstacles[window.slices]
        if window.area > MOST_REMEMBERED_CELLS:
            return self._fire.burnt(obstacles)
        return self._remembered(np.packbits(obstacles).tobytes(), window.shape)

    def _burnt_packed(
        self, obstacles: bytes, shape: tuple[int, int]
    ) -> NDArray[np.unsignedinteger]:
        bits = np.unpackbits(np.frombuffer(obstacles, np.uint8), count=shape[0] * shape[1])
        return self._fire.burnt(bits.reshape(shape).view(np.bool_))

    def _cost(self, cells: float, scaling: float, inscribed: float) -> int:
        """Return the cost so many cells away from an obstacle (`computeCost`)."""
        if cells == 0:
            return LETHAL if self._around is None else FREE_SPACE
        metres = cells * self._geometry.resolution
        if metres <= inscribed:
            return INSCRIBED
        return int((INSCRIBED - 1) * math.exp(-1.0 * scaling * (metres - inscribed)))

    def _add(self, master: NDArray[np.uint8], costs: NDArray[np.uint8]) -> None:
        """Keep the greater cost; where nothing is known, write what is sure, or all."""
        shows = costs > FREE_SPACE if self._inflate_unknown else costs >= INSCRIBED
        np.copyto(master, costs, where=np.where(master == NO_INFORMATION, shows, costs > master))


class StaticLayer:
    """A map's costs, as `costs.static_costs` makes them of its occupancy.

    Args:
        geometry: Of the costmap.
        costs: uint8, (height, width), row 0 at the lowest y.
        use_maximum: Keep greater costs of the layers below; else overwrite them, also where the
            map knows nothing (StaticLayer::updateCosts).

    Raises:
        CostmapError: The costs have another shape than the costmap.
    """

    reach = 0

    def __init__(
        self, geometry: GridGeometry, costs: NDArray[np.uint8], *, use_maximum: bool = False
    ) -> None:
        if costs.shape != geometry.shape:
            raise CostmapError(f"a map: expected {geometry.shape} cells, got {costs.shape}")
        self._costs = costs
        self._combine = maximum if use_maximum else overwrite_all
        self._changes = [geometry.whole]

    def take_changes(self) -> list[CellWindow]:
        """Return the whole map, once."""
        changes, self._changes = self._changes, []
        return merged(changes)

    def update_costs(self, master: NDArray[np.uint8], window: CellWindow) -> CellWindow:
        """Write the map into the master, in that window."""
        self._combine(master[window.slices], self._costs[window.slices])
        return window


Claims = NDArray[np.unsignedinteger]

STEPS = ((-1, 0), (0, -1), (1, 0), (0, 1))
"""(dx, dy): the order in which a cell's neighbours are set on fire."""


Front = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Cells that catch fire, in order, and their claims."""


class Brushfire:
    """The fire, within some number of cells of its sources.

    A claim is a number: 0 for a cell that nothing claims, else one for each place of the cell as
    seen from its source, times each step that led to it.

    Args:
        reach: Cells; at least 0.
    """

    def __init__(self, reach: int) -> None:
        self._reach = reach
        side = 2 * reach + 3  # one more on each side, that steps may leave the reach
        away = np.arange(side) - (reach + 1)
        squares = away[:, None] ** 2 + away[None, :] ** 2
        self._square_at = squares.ravel()
        self._places = np.array([dx + dy * side for dx, dy in STEPS])
        self._source = side * (reach + 1) + reach + 1
        self.dtype = np.dtype(np.uint16 if side * side * 4 + 4 < 2**16 else np.uint32)
        """Of claims."""
        distinct = np.unique(squares[squares <= reach**2])
        self.distances = [math.sqrt(square) for square in distinct.tolist()]
        """Cells, ascending: all distances that there are."""
        index = np.searchsorted(distinct, self._square_at)
        self.distance_of_claim = np.concatenate([[len(distinct)], np.repeat(index, len(STEPS))])
        """Claim -> index of its distance; one more than there are for no claim."""

    def burnt(self, obstacles: NDArray[np.bool_]) -> Claims:
        """Return the claim on each cell.

        Args:
            obstacles: (rows, columns): where the fire starts, in ascending order of flat index.
        """
        ground = _Ground(obstacles, self.dtype)
        sources = np.flatnonzero(ground.is_obstacle)
        ground.fronts[0].append((sources, np.full(len(sources), self._source * len(STEPS) + 1)))
        for square in np.unique(self._square_at).tolist():
            if square in ground.fronts:
                front = ground.reached_first(_joined(ground.fronts.pop(square)))
                ground.claims[front[0]] = front[1]
                self._spread(front, square, ground)
        return ground.inside

    def _spread(self, front: Front, square: int, ground: _Ground) -> None:
        """Set the neighbours of burning cells on fire, each at its own distance.

        One nearer to the source than the burning cell is left out, as in noetic, whose list of that
        distance has been gone through by then.
        """
        cells, marks = front
        onto = (cells[:, None] + ground.neighbours).ravel()
        into = (((marks - 1) // len(STEPS))[:, None] + self._places).ravel()
        squares = self._square_at[into]
        catches = (squares > square) & (squares <= self._reach**2) & (ground.claims[onto] == 0)
        chosen = np.flatnonzero(catches)
        onto, squares = onto[chosen], squares[chosen]
        marks = into[chosen] * len(STEPS) + 1 + chosen % len(STEPS)
        for further in np.unique(squares).tolist():
            here = squares == further
            ground.fronts[further].append((onto[here], marks[here]))


class _Ground:
    """What burns: the cells in a rim that does not, numbered row by row."""

    def __init__(self, obstacles: NDArray[np.bool_], dtype: np.dtype[Any]) -> None:
        self.is_obstacle = np.pad(obstacles, 1)
        _, width = self.is_obstacle.shape
        self.neighbours = np.array([dx + dy * width for dx, dy in STEPS])
        grid = np.zeros(self.is_obstacle.shape, dtype)
        self.inside: Claims = grid[1:-1, 1:-1]
        grid[[0, -1]] = grid[:, [0, -1]] = 1
        self.claims: Claims = grid.reshape(-1)
        self.fronts: dict[int, list[Front]] = defaultdict(list)
        """Squared distance -> what catches fire there, in order."""
        self._numbers = np.empty(grid.size, np.int32)

    def reached_first(self, front: Front) -> Front:
        """Return the cells of a front that have not burnt, each as it was first reached."""
        cells, marks = front
        fresh = self.claims[cells] == 0
        cells, marks = cells[fresh], marks[fresh]
        order = np.arange(len(cells), dtype=np.int32)
        self._numbers[cells[::-1]] = order[::-1]  # of several numbers for a cell the last one stays
        first = self._numbers[cells] == order
        return cells[first], marks[first]


def _joined(fronts: list[Front]) -> Front:
    if len(fronts) == 1:
        return fronts[0]
    return np.concatenate([cells for cells, _ in fronts]), np.concatenate([m for _, m in fronts])
