"""What a recording of a log shows: its doors and levels, with their names, paths and bounds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semmap_log.doors import Door, DoorId
from semmap_log.events import FloorMap
from semmap_log.views.rerun.door_rows import Edge, Life
from semmap_log.views.rerun.knowledge import Known

EntityPath = tuple[str, ...]
"""The parts of a rerun entity path."""

ROOT = "map"
EVENTS = "events"

MARGIN_M = 1.0
SMALLEST_SIDE_M = 4.0
"""So that a lone door is not blown up to the size of the screen."""

UNKNOWN_CELL = -1


@dataclass(frozen=True, slots=True)
class SceneDoor:
    """A door that turns up in the recording."""

    door_id: DoorId
    label: str
    """What people call it, as the viewer can draw it."""
    short_label: str
    """The same without the name of its level."""
    path: EntityPath
    """Of its lane and curves; and of its line, on the level where it was put last."""
    lines: Mapping[int, EntityPath]
    """Level -> path of its line there, for every level it is on at some time."""
    life: Life
    before: Door | None
    """As it was when the recording begins; None: not in the map by then."""
    known: Sequence[Known] = field(compare=False)
    """From where it goes on along `recorded`: at the beginning, if that is in midst of the log, and
    behind each retraction of one of its events."""
    state_changes: int
    has_probabilities: bool
    is_plain: bool
    """All its events came in the order in which they count, and none was taken back: along every
    timeline it is the same."""
    disturbed_ns: NDArray[np.int64] = field(compare=False)
    """When late events and ones that were taken back set its state, ascending."""


@dataclass(frozen=True, slots=True)
class SceneLevel:
    """A storey with something to draw."""

    level: int
    name: str
    path: EntityPath
    """Of all that is drawn on it."""
    floor: FloorMap | None
    bounds: Bounds
    is_empty: bool
    """Nothing on it has a place: its doors are sensors without geometry."""
    doors: int
    has_robot: bool


@dataclass(frozen=True, slots=True)
class Scene:
    """Everything that is known before the first row is written."""

    doors: Mapping[DoorId, SceneDoor]
    levels: Mapping[int, SceneLevel]
    robot_level: int | None
    """Where the robot is at the end; None: it never told."""
    events: int
    """That stand on any of its timelines."""
    commits: NDArray[np.int64]
    """Number of the first event of each commit."""
    begin: Edge
    """Before every event; its happened time is that of the first row."""
    end: Edge
    """Of the last happened time, the greatest number, and the last recorded time."""

    @property
    def span_ns(self) -> int:
        """From the first row to the last."""
        return self.end.folds_ns - self.begin.folds_ns

    def liveliest(self) -> list[SceneDoor]:
        """Return the doors, those whose state changed most often first."""
        return sorted(self.doors.values(), key=lambda door: (-door.state_changes, door.door_id))


@dataclass(frozen=True, slots=True)
class Bounds:
    """A rectangle, metres, frame `map`; the empty one holds nothing."""

    low_x: float = math.inf
    low_y: float = math.inf
    high_x: float = -math.inf
    high_y: float = -math.inf

    def around(self, x: NDArray[np.floating], y: NDArray[np.floating]) -> Bounds:
        """Return the smallest rectangle that also holds these points; NaN is not a place."""
        known = np.isfinite(x) & np.isfinite(y)
        if not known.any():
            return self
        x, y = x[known], y[known]
        return Bounds(
            min(self.low_x, float(x.min())), min(self.low_y, float(y.min())),
            max(self.high_x, float(x.max())), max(self.high_y, float(y.max())),
        )  # fmt: skip

    def including(self, other: Bounds) -> Bounds:
        """Return the smallest rectangle that holds both."""
        x = np.array([other.low_x, other.high_x])
        return self.around(x, np.array([other.low_y, other.high_y]))

    def framed(self) -> Bounds:
        """Return the rectangle with a margin, and not too small to look at."""
        if self.is_empty:
            return Bounds(0.0, 0.0, 0.0, 0.0).framed()
        grow_x = max(MARGIN_M, (SMALLEST_SIDE_M - (self.high_x - self.low_x)) / 2)
        grow_y = max(MARGIN_M, (SMALLEST_SIDE_M - (self.high_y - self.low_y)) / 2)
        return Bounds(
            self.low_x - grow_x, self.low_y - grow_y, self.high_x + grow_x, self.high_y + grow_y
        )

    def without_margin(self) -> Bounds:
        """Return what `framed` put its margin around, or somewhat more."""
        return Bounds(
            self.low_x + MARGIN_M, self.low_y + MARGIN_M,
            self.high_x - MARGIN_M, self.high_y - MARGIN_M,
        )  # fmt: skip

    def holds(self, other: Bounds) -> bool:
        """Tell whether another rectangle lies in this one; the empty one does."""
        return self.including(other) == self

    @property
    def is_empty(self) -> bool:
        """True for a rectangle around nothing."""
        return self.low_x > self.high_x

    @property
    def longest_side_m(self) -> float:
        """The longer of width and height."""
        return max(self.high_x - self.low_x, self.high_y - self.low_y)


def bounds_of_floor(floor: FloorMap) -> Bounds:
    """Return the rectangle around the known cells: a scanned map has wide unknown margins."""
    rows, columns = np.nonzero(floor.cells != UNKNOWN_CELL)
    if not len(rows):
        return Bounds()
    along_x = np.array([columns.min(), columns.max() + 1]) * floor.resolution
    along_y = np.array([rows.min(), rows.max() + 1]) * floor.resolution
    x, y = (corner.ravel() for corner in np.meshgrid(along_x, along_y))
    cos, sin = math.cos(floor.origin_theta), math.sin(floor.origin_theta)
    return Bounds().around(floor.origin_x + cos * x - sin * y, floor.origin_y + sin * x + cos * y)
