"""A level of a building as the robot's planner and its laser meet it: cells of 0.1 m.

Cells are (row, column), row 0 lowest; flat indices count row by row.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from patrol_sim.laser_plan import LevelPlan, PlanDoor, read_plan

from semmap_log.analysis.costmap_2d.costs import (
    FREE_SPACE,
    LETHAL,
    DoorLine,
    cells_of,
    static_costs,
)
from semmap_log.analysis.costmap_2d.grid import GridGeometry
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import Event, LevelAdded

Point = tuple[float, float]
"""(x, y), m, frame `map`."""
Cell = tuple[int, int]
Cells = NDArray[np.int64]

FACTOR = 2
"""So many cells of the plan, along each axis, are one of the experiment."""
UNKNOWN, OCCUPIED = -1, 100


@dataclass(frozen=True)
class Floor:
    """One level; what does not change in a run."""

    name: str
    """The building's."""
    plan: LevelPlan
    geometry: GridGeometry
    static: NDArray[np.uint8]
    """The static map's costs: LETHAL where a wall is, NO_INFORMATION outside the building."""

    @classmethod
    def read(cls, building: Path, level: int) -> Floor:
        """Return a level of an Open-RMF building.

        Raises:
            FormatError: It cannot be read, or has no such level with walls and doors.
        """
        plan = read_plan(building, level)
        cells = coarser(plan.floor.cells)
        height, width = cells.shape
        floor = plan.floor
        geometry = GridGeometry(
            width, height, floor.resolution * FACTOR, floor.origin_x, floor.origin_y
        )
        name = building.name.removesuffix(".building.yaml")
        return cls(name, plan, geometry, static_costs(cells))

    @property
    def events(self) -> list[Event]:
        """What the import of the level gives a log."""
        wanted = self.plan.level
        return [e for e in self.plan.events if not isinstance(e, LevelAdded) or e.level == wanted]

    @property
    def doors(self) -> tuple[PlanDoor, ...]:
        """The doors, by id."""
        return self.plan.doors

    @cached_property
    def door_ids(self) -> list[DoorId]:
        """Their ids, ascending."""
        return [door.door_id for door in self.doors]

    def lines(self, cost: int = FREE_SPACE) -> dict[DoorId, DoorLine]:
        """Return what each door draws in a door layer."""
        return {d.door_id: DoorLine(d.x, d.y, d.theta, d.width, cost) for d in self.doors}

    @cached_property
    def door_cells(self) -> dict[DoorId, Cells]:
        """The flat indices of each door's line."""
        owner, cells = cells_of(self.geometry, self.lines())
        return {door: cells[owner == place] for place, door in enumerate(self.door_ids)}

    @cached_property
    def leaf_cells(self) -> dict[DoorId, Cells]:
        """What a shut door fills: its line, made so thick that no beam slips through."""
        return {door: self._thick(cells) for door, cells in self.door_cells.items()}

    def _thick(self, cells: Cells) -> Cells:
        """Add to each cell the one to its right, so that a diagonal line has no gaps."""
        at_edge = cells % self.geometry.width == self.geometry.width - 1
        return np.unique(np.concatenate([cells, cells[~at_edge] + 1]))

    @cached_property
    def walls(self) -> NDArray[np.bool_]:
        """What is solid, whatever the doors do; a doorway is not."""
        walls: NDArray[np.bool_] = self.static == LETHAL
        for cells in self.door_cells.values():
            walls.reshape(-1)[cells] = False
        return walls

    @cached_property
    def door_ends(self) -> NDArray[np.float64]:
        """(n, 4) m: x, y of each door's start, then of its end."""
        return np.array([np.concatenate(door.ends) for door in self.doors])

    def doors_near(self, point: Point, near_m: float) -> list[DoorId]:
        """Return the doors whose line comes so near to a point, ascending."""
        start, along = self.door_ends[:, :2], self.door_ends[:, 2:] - self.door_ends[:, :2]
        to_point = np.array(point) - start
        share = np.clip((to_point * along).sum(axis=1) / (along**2).sum(axis=1), 0, 1)
        far = np.hypot(*(to_point - share[:, None] * along).T)
        return [self.door_ids[place] for place in np.flatnonzero(far <= near_m).tolist()]

    def cell(self, point: Point) -> Cell | None:
        """Return the cell of a point; None: it lies off the map."""
        found = self.geometry.world_to_map(*point)
        return None if found is None else (found[1], found[0])

    def point(self, cell: Cell) -> Point:
        """Return the middle of a cell."""
        return self.geometry.map_to_world(cell[1], cell[0])


def coarser(cells: NDArray[np.int8]) -> NDArray[np.int8]:
    """Return a map of larger cells: occupied if any of a cell's is, else free if any is."""
    height, width = (math.ceil(size / FACTOR) for size in cells.shape)
    whole = np.full((height * FACTOR, width * FACTOR), UNKNOWN, np.int8)
    whole[: cells.shape[0], : cells.shape[1]] = cells
    blocks = whole.reshape(height, FACTOR, width, FACTOR)
    found: NDArray[np.int8] = blocks.max(axis=(1, 3))  # -1 unknown < 0 free < 100 occupied
    return found
