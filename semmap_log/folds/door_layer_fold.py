"""The door layer as a projection: a door map drawn into a grid, door by door as they change.

What a door draws follows from its row in the door map alone, so the layer after any events is the
layer of the door map after them, drawn at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from semmap_log.batches.event_batch import EventBatch
from semmap_log.common.distinct import distinct
from semmap_log.costmap_2d.costs import FREE_SPACE, INSCRIBED, LETHAL, NO_INFORMATION
from semmap_log.costmap_2d.door_layer import DoorLayer, DoorLine
from semmap_log.costmap_2d.grid import CellWindow, GridGeometry
from semmap_log.domain.doors import Door, DoorId, DoorMap, DoorState
from semmap_log.folds.door_map import DoorMapState

By = Literal["state", "belief"]
"""What decides on a door's cost: its state (the thesis, 4.3), or how likely it is to be open."""

_COST_OF_STATE = {DoorState.CLOSED: LETHAL, DoorState.OPEN: FREE_SPACE}


def door_lines(doors: DoorMap, *, level: int = 0, by: By = "state") -> dict[DoorId, DoorLine]:
    """Return what the doors of a level draw, ids ascending; unplaced doors draw nothing."""
    drawn = {door_id: line_of(door, level=level, by=by) for door_id, door in doors.doors.items()}
    return {door_id: line for door_id, line in drawn.items() if line}


def line_of(door: Door | None, *, level: int = 0, by: By = "state") -> DoorLine | None:
    """Return what a door draws on a level; None: nothing."""
    if door is None or not door.is_placed or door.level != level:
        return None
    cost = cost_of_state(door.state) if by == "state" else cost_of_belief(door)
    return DoorLine(door.x, door.y, door.theta, door.width, cost)


def cost_of_state(state: DoorState) -> int:
    """Return LETHAL for a closed door, FREE_SPACE for an open one, else NO_INFORMATION."""
    return _COST_OF_STATE.get(state, NO_INFORMATION)


def cost_of_belief(door: Door) -> int:
    """Return a cost for how likely the door is to be closed, if that is known; else for its state.

    P(open) runs from FREE_SPACE at 1 to the greatest cost that a path may still cross at 0: a door
    that is probably closed costs, it does not block. P(open) is the door's `prob_open`, or
    1 - `prob_closed` where only that was given.
    """
    p_open = 1 - door.prob_closed if math.isnan(door.prob_open) else door.prob_open
    if math.isnan(p_open):
        return cost_of_state(door.state)
    return round((INSCRIBED - 1) * (1 - p_open))


@dataclass(slots=True)
class DoorLayerState:
    """A door map and its layer."""

    layer: DoorLayer
    map: DoorMapState = field(default_factory=DoorMapState)
    changed: list[CellWindow] = field(default_factory=list)
    """Where cells of the layer may have changed with the last events."""


@dataclass(frozen=True, slots=True)
class DoorLayerProjection:
    """The fold: `log.fold_live(DoorLayerProjection(geometry))` gives the layer as it changes.

    For the layer of one moment `semmap_log.costmaps.costmap_at` is quicker: it starts at the
    nearest keyframe.
    """

    geometry: GridGeometry
    level: int = 0
    by: By = "state"

    def initial(self) -> DoorLayerState:
        """Return a layer without doors."""
        return DoorLayerState(DoorLayer(self.geometry))

    def of(self, map_state: DoorMapState) -> DoorLayerState:
        """Return the state that a door map makes; the map is gone on with, not copied."""
        state = DoorLayerState(DoorLayer(self.geometry), map_state)
        state.layer.draw(door_lines(map_state.door_map(), level=self.level, by=self.by))
        return state

    def apply(self, state: DoorLayerState, batch: EventBatch, /) -> DoorLayerState:
        """Fold a batch in; only the doors that it is about are drawn anew."""
        state.map.apply(batch)
        doors = distinct(batch.door_ids()[batch.about_doors()])
        about = [DoorId(door) for door in doors.tolist()]
        state.changed = state.layer.update(
            {door: line_of(state.map.door(door), level=self.level, by=self.by) for door in about}
        )
        return state
