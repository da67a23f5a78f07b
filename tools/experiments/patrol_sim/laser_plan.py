"""A level of an Open-RMF building, as its plan has it: walls, doors, floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from patrol_sim.laser_surfaces import Floats
from semmap_log.core.model.doors import DoorId, DoorMap
from semmap_log.core.model.events import DoorAdded, DoorAnnotated, Event, FloorMap
from semmap_log.errors import FormatError
from semmap_log.interop.formats.files.building import read_building, read_outlines
from semmap_log.interop.importing.import_plan import Present, plan_doors


@dataclass(frozen=True, slots=True)
class PlanDoor:
    """A door as it is drawn."""

    door_id: DoorId
    name: str
    kind: str
    """As Open-RMF calls them: hinged, double_hinged, sliding …; empty: not told."""
    x: float
    y: float
    theta: float
    width: float

    @property
    def ends(self) -> tuple[Floats, Floats]:
        """Start and end, m, frame `map`."""
        start = np.array([self.x, self.y])
        return start, start + self.width * self.along

    @property
    def along(self) -> Floats:
        """The direction from start to end."""
        return np.array([np.cos(self.theta), np.sin(self.theta)])

    @property
    def left(self) -> Floats:
        """The direction to the left of it."""
        return np.array([-np.sin(self.theta), np.cos(self.theta)])


@dataclass(frozen=True, slots=True)
class LevelPlan:
    """One level."""

    level: int
    walls: Floats
    """(n, 4) m: their middle lines, doors not yet cut out."""
    doors: tuple[PlanDoor, ...]
    floor: FloorMap
    events: tuple[Event, ...]
    """What the import of the building gives a log, of this level."""

    def with_kinds(self, kinds: Sequence[str]) -> LevelPlan:
        """Return the plan with other kinds of doors."""
        doors = tuple(
            replace(door, kind=kind) for door, kind in zip(self.doors, kinds, strict=True)
        )
        new = {door.door_id: door.kind for door in doors}
        events = tuple(
            event for event in self.events
            if not (isinstance(event, DoorAnnotated) and event.key == "kind")
        )  # fmt: skip
        told = tuple(
            DoorAnnotated(door_id=door_id, key="kind", value=kind)
            for door_id, kind in new.items()
            if kind
        )
        return replace(self, doors=doors, events=(*events, *told))


def plan_events(path: Path) -> list[Event]:
    """Return the events that import a building: its levels, floor plans, doors and their names.

    Without the doors of lifts: those open where the cabin is, which the robots here do not play.
    """
    nothing = Present(DoorMap({}, {}), used_ids=frozenset())
    return list(plan_doors(read_building(path, lifts=False), nothing).events)


def read_plan(path: Path, level: int) -> LevelPlan:
    """Return a level of a building.

    Raises:
        FormatError: It cannot be read, or has no such level with walls and doors.
    """
    events = plan_events(path)
    walls = read_outlines(path)
    floors = {event.level: event for event in events if isinstance(event, FloorMap)}
    added = [event for event in events if isinstance(event, DoorAdded) and event.level == level]
    if level not in floors or not added:
        known = sorted({e.level for e in events if isinstance(e, DoorAdded)} & floors.keys())
        raise FormatError(path, f"expected one of the levels {known} with --level, got {level}.")
    ids = {event.door_id for event in added}
    notes = {
        (event.door_id, event.key): event.value
        for event in events
        if isinstance(event, DoorAnnotated)
    }
    doors = tuple(
        PlanDoor(
            e.door_id, notes.get((e.door_id, "name"), ""), notes.get((e.door_id, "kind"), ""),
            e.x, e.y, e.theta, e.width,
        )
        for e in added
    )  # fmt: skip
    here = tuple(
        event for event in events
        if getattr(event, "level", level) == level
        and getattr(event, "door_id", None) in {None, *ids}
    )  # fmt: skip
    lines = np.array([(*a, *b) for a, b in walls[level].walls], float).reshape(-1, 4)
    return LevelPlan(level, lines, doors, floors[level], here)
