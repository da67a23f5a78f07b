"""What a recording of a log shows: its doors and levels, with their names, paths and bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.model.doors import Door, DoorId
from semmap_log.core.model.events import FloorMap
from semmap_log.views.bounds import Bounds
from semmap_log.views.excerpt.door_rows import DoorLifetime, RecordingEdge
from semmap_log.views.excerpt.floor_plans import NO_PLANS, LevelPlans
from semmap_log.views.excerpt.object_shapes import ObjectShape
from semmap_log.views.rerun.knowledge import KnownDoor

EntityPath = tuple[str, ...]
"""The parts of a rerun entity path."""

ROOT = "map"
EVENTS = "events"


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
    life: DoorLifetime
    before: Door | None
    """As it was when the recording begins; None: not in the map by then."""
    known: Sequence[KnownDoor] = field(compare=False)
    """From where it goes on along `recorded`: at the beginning, if that is in midst of the log, and
    behind each retraction of one of its events."""
    state_changes: int
    has_probabilities: bool
    shape: ObjectShape
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
    """At the end."""
    bounds: Bounds
    is_empty: bool
    """Nothing on it has a place: its doors are sensors without geometry."""
    doors: int
    has_robot: bool
    plans: LevelPlans = NO_PLANS
    """All plans that it is drawn on, from when on each; `floor` is the last of them."""


@dataclass(frozen=True, slots=True)
class Scene:
    """Everything that is known before the first row is written."""

    doors: Mapping[DoorId, SceneDoor]
    levels: Mapping[int, SceneLevel]
    home_of_0: int | None
    """Where poses of level 0 are drawn: see `excerpt.levels`."""
    robot_level: int | None
    """Where the robot is at the end; None: it never told, or nobody knows on which level."""
    robots: tuple[str, ...]
    """Those that the log tells of."""
    events: int
    """That stand on any of its timelines."""
    commits: NDArray[np.int64]
    """Number of the first event of each commit."""
    begin: RecordingEdge
    """Before every event; its happened time is that of the first row."""
    end: RecordingEdge
    """Of the last happened time, the greatest number, and the last recorded time."""

    @property
    def span_ns(self) -> int:
        """From the first row to the last."""
        return self.end.folds_ns - self.begin.folds_ns

    def liveliest(self) -> list[SceneDoor]:
        """Return the doors, those whose state changed most often first."""
        return sorted(self.doors.values(), key=lambda door: (-door.state_changes, door.door_id))
