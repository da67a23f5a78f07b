"""A level's costmap at a moment of a log: floor, doors, and costs around both."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from semmap_log.analysis.costmap_2d.costs import static_costs
from semmap_log.analysis.costmap_2d.door_layer import DoorLayer, DoorLine
from semmap_log.analysis.costmap_2d.grid import CellWindow, GridGeometry
from semmap_log.analysis.costmap_2d.inflation import InflationLayer
from semmap_log.analysis.costmap_2d.layered import CostmapLayer, LayeredCostmap
from semmap_log.analysis.costmap_2d.static_layer import StaticLayer
from semmap_log.analysis.costmaps.door_layer_fold import By, DoorLayerProjection, door_lines
from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.folds.doors_of_class import check_class
from semmap_log.core.folds.levels import level_shown, resolve_level
from semmap_log.core.model.doors import DoorId, DoorMap
from semmap_log.core.model.events import FloorMap
from semmap_log.core.model.keywords import knows_its_keywords, knows_keywords
from semmap_log.errors import CostmapError
from semmap_log.log.door_log.door_log import DoorLog, Time

MARGIN_M = 1.0
"""Around the doors, where there is no map."""
MOST_CELLS = 100_000_000

Point: TypeAlias = tuple[float, float]
"""(x, y), metres, frame `map`."""


@knows_its_keywords
@dataclass(frozen=True, slots=True)
class CostmapOptions:
    """How a costmap is made; names and defaults of ROS's parameters in brackets."""

    level: int | str | None = None
    """Number or name; None: the only one there is, or of several the only one with doors."""
    by: By = "state"
    inflate_m: float = 0.0
    """How far costs reach around walls and closed doors (inflation_radius); 0: not at all."""
    scaling: float = 10.0
    """How fast they fall off, 1/m (cost_scaling_factor)."""
    inscribed_m: float = 0.0
    """The robot's inscribed radius: so near it surely touches."""
    door_inflate_m: float = 0.0
    """How far they reach around doors that are, or may be, closed; 0: as around walls."""
    resolution: float = 0.05
    """Metres a cell, where there is no map."""
    object_class: str | None = None
    """Only objects of that class; None: all."""


class Costmap:
    """The costmap of a level at a moment: doors over the floor, and costs around both."""

    def __init__(
        self,
        state: DoorMapState,
        geometry: GridGeometry,
        floor: FloorMap | None,
        level: int,
        options: CostmapOptions,
    ) -> None:
        self.geometry = geometry
        self.level = level
        self.floor = floor
        """The floor map below the doors; None: there is none, and nothing is known beside them."""
        self.options = options
        self._projection = DoorLayerProjection(geometry, level, options.by, options.object_class)
        self._state = self._projection.of(state)
        layers = layers_of(geometry, floor, self.layer, options)
        self.master = LayeredCostmap(geometry, layers, track_unknown=floor is None)
        self.master.update()

    @property
    def layer(self) -> DoorLayer:
        """The doors alone."""
        return self._state.layer

    @property
    def doors(self) -> DoorMap:
        """All doors at that moment, those of other levels and those without a place, too."""
        return self._state.map.door_map()

    @property
    def lines(self) -> dict[DoorId, DoorLine]:
        """What the level's doors draw, ids ascending; on the map or off it."""
        options = self.options
        return door_lines(self.doors, level=self.level, by=options.by, only=options.object_class)

    def advance(self, batches: Iterable[EventBatch]) -> list[CellWindow]:
        """Take in what happened next; return where cells of the master may have changed."""
        for batch in batches:
            self._state = self._projection.apply(self._state, batch)
        return self.master.update()

    def show(self, state: DoorMapState) -> list[CellWindow]:
        """Take another door map instead; return where cells of the master may have changed."""
        self._state.map = state
        self.layer.draw(self.lines)
        return self.master.update()


def layers_of(
    geometry: GridGeometry, floor: FloorMap | None, doors: DoorLayer, options: CostmapOptions
) -> list[CostmapLayer]:
    """Return the layers of a costmap, lowest first: floor, doors, and costs around them.

    Raises:
        CostmapError: A radius cannot be drawn on that grid.
    """
    layers = list[CostmapLayer]()
    if floor is not None:
        layers.append(StaticLayer(geometry, static_costs(floor.cells)))
    layers.append(doors)
    for radius, around in ((options.inflate_m, None), (options.door_inflate_m, doors)):
        if radius:
            layers.append(
                InflationLayer(
                    geometry,
                    radius,
                    scaling=options.scaling,
                    inscribed=options.inscribed_m,
                    around=around,
                )
            )
    return layers


@knows_keywords
def costmap_at(
    log: DoorLog,
    options: CostmapOptions = CostmapOptions(),
    *,
    at: Time = None,
    known_at: Time = None,
    event: int | None = None,
    floor: FloorMap | None = None,
) -> Costmap:
    """Return the costmap of a level at a moment; without arguments: now.

    Args:
        log: Where the doors are from.
        options: Which level, and what is drawn how.
        at: What was true then, with all that is known today.
        known_at: Only what had been recorded by then.
        event: Only what has a number up to that.
        floor: The floor to draw on; default: the log's own of that level and moment. If there is
            none, the grid lies around the level's doors.

    Raises:
        CostmapError: There is neither floor nor door, or the floor is turned against its grid.
        CommandError: There is no such class.
        UnknownLevelError: No such level, or several and none was named.
    """
    state = log.state_in(log.scope(at, known_at, event))
    doors = state.door_map()
    if options.object_class is not None:
        check_class(doors, options.object_class)
    level = level_drawn(options, doors)
    floor = floor or log.floor_of(doors, level)
    geometry = geometry_of(floor, ends_of(doors, level), level, options)
    return Costmap(state, geometry, floor, level, options)


def level_drawn(options: CostmapOptions, doors: DoorMap) -> int:
    """Return the level of which a costmap is asked.

    Raises:
        UnknownLevelError: No such level, or several have doors and none was named.
    """
    return level_shown(doors) if options.level is None else resolve_level(options.level, doors)


def geometry_of(
    floor: FloorMap | None, points: Sequence[Point], level: int, options: CostmapOptions
) -> GridGeometry:
    """Return the floor's grid, or one around these points.

    Raises:
        CostmapError: There is neither, or the floor is turned.
    """
    if floor is None:
        return _around(points, level, options.resolution)
    return GridGeometry.of_floor(floor)


def ends_of(doors: DoorMap, level: int) -> list[Point]:
    """Return both ends of all doors on a level, and the corners of what has an outline."""
    on_level = (door for door in doors.doors.values() if door.is_placed and door.level == level)
    return [point for door in on_level for point in door.extent]


def _around(ends: Sequence[Point], level: int, cell_m: float) -> GridGeometry:
    """Return a grid with a margin around these points."""
    points = np.array(ends)
    if not len(points):
        raise CostmapError(
            f"level {level} has no floor map, and no door with a place: there is nothing "
            "to draw. Give a map, or another level or moment."
        )
    if not (math.isfinite(cell_m) and cell_m > 0):
        raise CostmapError(f"the resolution: expected metres a cell, above 0, got {cell_m!r}")
    with np.errstate(over="ignore", invalid="ignore"):  # infinite: too many, or NaN, told below
        low = np.floor((points.min(axis=0) - MARGIN_M) / cell_m)
        width, height = np.ceil((points.max(axis=0) + MARGIN_M) / cell_m) - low
        fits = bool(width * height <= MOST_CELLS)
    if not fits:
        raise CostmapError(
            f"a grid around the doors: expected at most {MOST_CELLS:,} cells of {cell_m:g} m, "
            f"got {width:,.15g} x {height:,.15g}; give a map, or a greater resolution, or remove "
            "the door that is far away"
        )
    return GridGeometry(int(width), int(height), cell_m, *(low * cell_m).tolist())
