"""The door layer as a projection: a door map drawn into a grid, door by door as they change.

What a door draws follows from its row in the door map alone, so the layer after any events is the
layer of the door map after them, drawn at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

from semmap_log.analysis.costmap_2d import costs
from semmap_log.analysis.costmap_2d.grid import CellWindow, GridGeometry
from semmap_log.core.batches.event_batch import EventBatch, distinct
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.model import doors as door_model
from semmap_log.core.model.events import ClassDefined

By = Literal["state", "belief"]
"""What decides on a door's cost: its state (the thesis, 4.3), or how likely it is to be open."""


def door_lines(
    doors: door_model.DoorMap, *, level: int = 0, by: By = "state", only: str | None = None
) -> dict[door_model.DoorId, costs.DoorLine]:
    """Return what the doors of a level draw, ids ascending; unplaced doors draw nothing.

    Args:
        doors: The map.
        level: The level.
        by: What decides on the costs.
        only: The class of those that are drawn; None: all are.
    """
    drawn = {i: line_of(door, level=level, by=by, only=only) for i, door in doors.doors.items()}
    return {door_id: line for door_id, line in drawn.items() if line}


def line_of(
    door: door_model.Door | None, *, level: int = 0, by: By = "state", only: str | None = None
) -> costs.DoorLine | None:
    """Return what a door, or another object, draws on a level; None: nothing.

    A line stands in a wall: where it does not block, its cells are free. What is a point or an area
    stands on the floor: where it does not block, that is seen as if it were not there.
    """
    if door is None or not door.is_placed or door.level != level:
        return None
    if only is not None and door.object_class.name != only:
        return None
    geometry = door.object_class.geometry
    cost = cost_of_state(door.state, door.object_class) if by == "state" else cost_of_belief(door)
    if geometry is door_model.Geometry.SEGMENT:
        return costs.DoorLine(door.x, door.y, door.theta, door.width, cost)
    outline = door.outline
    is_seen = cost not in (costs.FREE_SPACE, costs.NO_INFORMATION)
    if not is_seen or (geometry is door_model.Geometry.POLYGON and not outline):
        return None
    return costs.DoorLine(door.x, door.y, door.theta, 0.0, cost, outline, is_on_floor=True)


def cost_of_state(state: door_model.DoorState, of: door_model.ObjectClass = door_model.DOOR) -> int:
    """Return LETHAL for a state that blocks (a closed door), else FREE_SPACE if it is known.

    What is neither open nor closed, and does not block, is NO_INFORMATION.
    """
    if state in of.blocks:
        return costs.LETHAL
    return costs.FREE_SPACE if state.is_known else costs.NO_INFORMATION


def cost_of_belief(door: door_model.Door) -> int:
    """Return a cost for how likely the door is to block, if that is known; else for its state.

    P(open) runs from FREE_SPACE at 1 to the greatest cost that a path may still cross at 0: a door
    that is probably closed costs, it does not block. P(open) is the door's `prob_open`, or
    1 - `prob_closed` where only that was given. An object of a class that is blocked by other
    states than a door costs what these are likely.
    """
    p_open = 1 - door.prob_closed if math.isnan(door.prob_open) else door.prob_open
    if math.isnan(p_open):
        return cost_of_state(door.state, door.object_class)
    blocks = door.object_class.blocks
    likely = {door_model.DoorState.OPEN: p_open, door_model.DoorState.CLOSED: 1 - p_open}
    return round((costs.INSCRIBED - 1) * sum(p for state, p in likely.items() if state in blocks))


@dataclass(slots=True)
class DoorLayerState:
    """A door map and its layer."""

    layer: costs.DoorLayer
    map: DoorMapState = field(default_factory=DoorMapState)
    changed: list[CellWindow] = field(default_factory=list)
    """Where cells of the layer may have changed with the last events."""


@dataclass(frozen=True, slots=True)
class DoorLayerProjection:
    """The fold: `log.fold_live(DoorLayerProjection(geometry))` gives the layer as it changes.

    For the layer of one moment `semmap_log.analysis.costmaps.costmap_at` is quicker: it starts
    at the nearest keyframe.
    """

    geometry: GridGeometry
    level: int = 0
    by: By = "state"
    only: str | None = None
    """The class of those that are drawn; None: all are."""

    def initial(self) -> DoorLayerState:
        """Return a layer without doors."""
        return DoorLayerState(costs.DoorLayer(self.geometry))

    def of(self, map_state: DoorMapState) -> DoorLayerState:
        """Return the state that a door map makes; the map is gone on with, not copied."""
        state = DoorLayerState(costs.DoorLayer(self.geometry), map_state)
        state.layer.draw(self._lines(map_state))
        return state

    def _lines(self, state: DoorMapState) -> dict[door_model.DoorId, costs.DoorLine]:
        return door_lines(state.door_map(), level=self.level, by=self.by, only=self.only)

    def apply(self, state: DoorLayerState, batch: EventBatch, /) -> DoorLayerState:
        """Fold a batch in; only its doors are drawn again.

        If it defines a class of objects, all doors are drawn again.
        """
        state.map.apply(batch)
        if ClassDefined in batch:
            state.changed = state.layer.draw(self._lines(state.map))
            return state
        doors = distinct(batch.door_ids()[batch.about_doors()])
        about = [door_model.DoorId(door) for door in doors.tolist()]
        how: dict[str, Any] = {"level": self.level, "by": self.by, "only": self.only}
        state.changed = state.layer.update(
            {door: line_of(state.map.door(door), **how) for door in about}
        )
        return state
