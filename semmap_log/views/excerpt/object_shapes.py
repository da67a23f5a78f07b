"""What objects look like on a floor plan: a door is a line, others may be areas or points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import FREE_SPACE, NO_INFORMATION
from semmap_log.analysis.costmap_2d.door_layer import DoorLine
from semmap_log.analysis.costmaps.door_layer_fold import cost_of_state
from semmap_log.core.folds.door_changes import Changes
from semmap_log.core.folds.door_map import DoorMapState
from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.object_classes import (
    DOOR,
    OUTLINE,
    Corners,
    Geometry,
    ObjectClass,
    outline_told,
)
from semmap_log.views.excerpt.door_rows import strips_of

POINT_M = 0.15
"""How far the corners of a point's diamond are from where it is."""
_DIAMOND = ((POINT_M, 0.0), (0.0, POINT_M), (-POINT_M, 0.0), (0.0, -POINT_M))


@dataclass(frozen=True, slots=True)
class ObjectShape:
    """What an object looks like, wherever it is put."""

    object_class: ObjectClass = DOOR
    outline: Corners = ()
    """Of a polygon, in its own frame, metres; empty: nobody has said."""

    @property
    def is_line(self) -> bool:
        """Whether it is a line, such as a door, that stands in a wall."""
        return self.object_class.geometry is Geometry.SEGMENT

    def strips(self, placements: Changes) -> NDArray[np.float32]:
        """Return its lines, float32 (rows, points, x and y), metres, frame `map`."""
        corners = self.outline if self.object_class.geometry is Geometry.POLYGON else _DIAMOND
        if self.is_line or not corners:
            return strips_of(placements)
        with np.errstate(over="ignore"):  # as in `strips_of`
            return _seen_from(placements, np.array([*corners, corners[0]])).astype(np.float32)

    def points(self, placements: Changes) -> NDArray[np.float64]:
        """Return the points between which it lies, (points, x and y), metres, frame `map`."""
        if self.outline:
            return _seen_from(placements, np.array(self.outline)).reshape(-1, 2)
        start = np.stack([placements["x"], placements["y"]], -1)
        along = np.stack([np.cos(placements["theta"]), np.sin(placements["theta"])], -1)
        width = placements["width"] if self.is_line else np.zeros(len(placements))
        return np.concatenate([start, start + width[:, None] * along])

    def drawn(self, placement: Any) -> DoorLine:
        """Return what it draws into a costmap, where it draws something; at no cost."""
        x, y, theta, width = (float(placement[name]) for name in ("x", "y", "theta", "width"))
        width = width if self.is_line else 0.0
        corners: Corners = ()
        if self.outline:
            seen = _seen_from(placement[None], np.array(self.outline))[0]
            corners = tuple((float(corner[0]), float(corner[1])) for corner in seen)
        return DoorLine(x, y, theta, width, NO_INFORMATION, corners)

    def costs(self) -> NDArray[np.uint8]:
        """Return what each state of it costs where it is: uint8 (256,)."""
        costs = np.full(256, NO_INFORMATION, np.uint8)
        costs[: len(DoorState)] = [cost_of_state(state, self.object_class) for state in DoorState]
        if not self.is_line:
            costs[costs == FREE_SPACE] = NO_INFORMATION
        return costs


AS_A_DOOR = ObjectShape()


def shapes_of(state: DoorMapState) -> Mapping[DoorId, ObjectShape]:
    """Return the shapes of all objects that are no doors, removed ones too."""
    objects = state.objects()
    said = state.since_added(OUTLINE) if objects else {}
    return {i: ObjectShape(one, _outline(said.get(i, ""))) for i, one in objects.items()}


def _outline(text: str) -> Corners:
    try:
        return outline_told(text)
    except ValueError:
        return ()


def _seen_from(placements: Changes, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return corners of objects, (rows, corners, x and y), in the frame `map`."""
    starts = np.stack([placements["x"], placements["y"]], -1)
    cos, sin = np.cos(placements["theta"])[:, None], np.sin(placements["theta"])[:, None]
    x, y = corners[None, :, 0], corners[None, :, 1]
    turned = np.stack([cos * x - sin * y, sin * x + cos * y], -1)
    seen: NDArray[np.float64] = turned + starts[:, None]
    return seen
