"""What a recording of a log will show, found in a first pass: doors, levels, span of time.

The viewer must know names, lifetimes and bounds before the first row is drawn; an event may name a
door long after it was drawn for the first time, or tell late that it had been removed. The pass
keeps a few numbers a door, whatever the log's length.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from semmap_log.doors import Door, DoorId, DoorMap
from semmap_log.events import (
    Changed,
    DoorAdded,
    DoorAnnotated,
    DoorRemoved,
    EventBatch,
    FloorMap,
    LevelAdded,
    RobotPose,
)
from semmap_log.views.door_rows import (
    ALWAYS,
    NEVER,
    PROBABILITIES,
    Changes,
    Life,
    Stamp,
    changes_of,
)
from semmap_log.views.drawable import drawable, has_letters, path_part, unique_parts

if TYPE_CHECKING:
    from semmap_log.door_log import DoorLog

MARGIN_M = 1.0
SMALLEST_SIDE_M = 4.0
"""So that a lone door is not blown up to the size of the screen."""


@dataclass(frozen=True, slots=True)
class SceneDoor:
    """A door that turns up in the recording."""

    door_id: DoorId
    label: str
    """What people call it, as the viewer can draw it."""
    path: tuple[str, ...]
    """Entity path of its lane, curves and line: on the level where it was last."""
    levels: tuple[int, ...]
    """Every level its line is on at some time; `path` belongs to the last."""
    life: Life
    before: Door | None
    """As it was when the recording begins; None: added later."""
    changes: int
    """How often its state became another."""
    has_probabilities: bool
    has_late_events: bool
    """An event about it was recorded after one that counts later."""


@dataclass(frozen=True, slots=True)
class SceneLevel:
    """A storey with something to draw."""

    level: int
    name: str
    path: tuple[str, ...]
    """Entity path of all that is drawn on it."""
    floor: FloorMap | None
    bounds_m: tuple[float, float, float, float]
    """Least x, least y, greatest x, greatest y of what is drawn, metres, frame `map`."""
    doors: int
    has_robot: bool


@dataclass(frozen=True, slots=True)
class Scene:
    """Everything that is decided before the first row is written."""

    name: str
    doors: Mapping[DoorId, SceneDoor]
    levels: Mapping[int, SceneLevel]
    events: int
    first_ns: int
    last_ns: int
    since_ns: int | None
    """When the recording begins, if that is after the log's start."""
    first_number: int
    first_recorded_ns: int


def survey(
    log: DoorLog,
    *,
    since_ns: int | None = None,
    until_ns: int | None = None,
    doors: Iterable[DoorId] | None = None,
) -> Scene:
    """Return what a recording of these events, by happened time, has to show."""
    chosen = None if doors is None else sorted(set(doors))
    before = DoorMap({}, {}) if since_ns is None else log.replay(at=since_ns - 1)
    found = _Found({door_id: before.doors[door_id] for door_id in before.doors
                    if chosen is None or door_id in chosen})  # fmt: skip
    for batch in log.batches(since=since_ns, until=until_ns, doors=chosen):
        found.take(batch)
    names = {number: level.name or "" for number, level in before.levels.items()}
    names.update((number, name) for number, (_, name) in sorted(found.level_names.items()))
    levels = _levels(log, found, names, until_ns)
    scene_doors = _doors(found, levels)
    first_ns = found.first_ns if since_ns is None else since_ns
    return Scene(
        name=drawable(log.path.name),
        doors=scene_doors,
        levels=levels,
        events=found.events,
        first_ns=min(first_ns, found.last_ns),
        last_ns=max(first_ns, found.last_ns) if found.events else first_ns,
        since_ns=since_ns,
        first_number=found.first_number,
        first_recorded_ns=found.first_recorded_ns,
    )


@dataclass(slots=True)
class _FoundDoor:
    before: Door | None = None
    added: Stamp = NEVER
    removed: Stamp = NEVER
    name: str = ""
    name_stamp: Stamp = ALWAYS
    levels: dict[int, Stamp] = field(default_factory=dict)
    """Level -> when the door was last put there."""
    state: int | None = None
    changes: int = 0
    has_probabilities: bool = False
    latest: Stamp = ALWAYS
    has_late_events: bool = False


class _Found:
    """What the first pass gathers."""

    def __init__(self, before: Mapping[DoorId, Door]) -> None:
        self.doors: dict[int, _FoundDoor] = {}
        self.boxes: dict[int, _Box] = {}
        self.level_names: dict[int, tuple[Stamp, str]] = {}
        self.robot_levels: set[int] = set()
        self.floor_levels: set[int] = set()
        self.events = 0
        self.first_ns = self.last_ns = 0
        self.first_number = self.first_recorded_ns = 0
        for door_id, door in before.items():
            self._take_before(door_id, door)

    def take(self, batch: EventBatch) -> None:
        folds_ns = batch.folds_ns
        if not self.events:
            self.first_number = int(batch.number[0])
            self.first_recorded_ns = int(batch.recorded_ns[0])
            self.first_ns = self.last_ns = int(folds_ns[0])
        self.events += len(batch)
        self.first_ns = min(self.first_ns, int(folds_ns.min()))
        self.last_ns = max(self.last_ns, int(folds_ns.max()))
        for changes in by_door(changes_of(batch)):
            self._take_changes(self._door(int(changes["door_id"][0])), changes)
        self._take_poses(batch)
        self._take_objects(batch)

    def _door(self, door_id: int) -> _FoundDoor:
        return self.doors.setdefault(door_id, _FoundDoor())

    def _take_before(self, door_id: int, door: Door) -> None:
        found = self._door(door_id)
        found.before, found.added = door, ALWAYS
        found.name, found.state = door.name or "", int(door.state)
        found.levels[door.level] = ALWAYS
        found.has_probabilities = not (math.isnan(door.prob_open) and math.isnan(door.prob_closed))
        if door.is_placed:
            ends = np.array([door.start, door.end])
            self._box(door.level).take(ends[:, 0], ends[:, 1])

    def _take_changes(self, door: _FoundDoor, changes: Changes) -> None:
        stamps = list(zip(changes["folds_ns"].tolist(), changes["number"].tolist(), strict=True))
        in_order = bool((np.diff(changes["folds_ns"]) >= 0).all()) and stamps[0] > door.latest
        door.has_late_events |= not in_order
        door.latest = max(door.latest, *stamps)
        for kind, name in ((DoorAdded, "added"), (DoorRemoved, "removed")):
            for row in np.flatnonzero(changes["kind"] == kind.kind).tolist():
                setattr(door, name, stamps[row])
        states = changes["state"][(changes["sets"] & int(Changed.STATE)) != 0]
        if len(states):
            first = door.state is not None and int(states[0] != door.state)
            door.changes += int(first) + int(np.count_nonzero(states[1:] != states[:-1]))
            door.state = int(states[-1])
        given = (changes["sets"] & PROBABILITIES) != 0
        probabilities = (changes["prob_open"][given], changes["prob_closed"][given])
        door.has_probabilities |= bool(np.isfinite(probabilities).any())
        for row in np.flatnonzero((changes["sets"] & int(Changed.POSE)) != 0).tolist():
            self._take_place(door, changes[row], stamps[row])

    def _take_place(self, door: _FoundDoor, change: np.void, stamp: Stamp) -> None:
        level = int(change["level"])
        door.levels[level] = max(stamp, door.levels.get(level, ALWAYS))
        if math.isfinite(change["x"]):
            # An update that moves the door does not tell its width: some room is left anyway.
            width = change["width"] if math.isfinite(change["width"]) else 0.0
            reach = np.array([0.0, width])
            self._box(level).take(change["x"] + reach * math.cos(change["theta"]),
                                  change["y"] + reach * math.sin(change["theta"]))  # fmt: skip

    def _take_poses(self, batch: EventBatch) -> None:
        if RobotPose not in batch:
            return
        poses = batch[RobotPose]
        for level in np.unique(poses["level"]).tolist():
            here = poses[poses["level"] == level]
            self.robot_levels.add(level)
            self._box(level).take(here["x"], here["y"])

    def _take_objects(self, batch: EventBatch) -> None:
        folds_ns = batch.folds_ns
        for kind in (DoorAnnotated, LevelAdded, FloorMap):
            if kind not in batch:
                continue
            where = batch.where(kind)
            stamps = zip(folds_ns[where].tolist(), batch.number[where].tolist(), strict=True)
            for event, stamp in zip(batch.objects[kind.kind], stamps, strict=True):
                if isinstance(event, DoorAnnotated) and event.key == "name":
                    door = self._door(event.door_id)
                    if stamp > door.name_stamp:
                        door.name, door.name_stamp = event.value, stamp
                elif isinstance(event, LevelAdded):
                    self.level_names[event.level] = max(
                        self.level_names.get(event.level, (ALWAYS, "")), (stamp, event.name)
                    )
                elif isinstance(event, FloorMap):
                    self.floor_levels.add(event.level)

    def _box(self, level: int) -> _Box:
        return self.boxes.setdefault(level, _Box())


def by_door(changes: Changes) -> Iterator[Changes]:
    """Yield each door's rows, doors ascending, rows in the order they came."""
    if not len(changes):
        return
    ordered = changes[np.argsort(changes["door_id"], kind="stable")]
    yield from np.split(ordered, np.flatnonzero(np.diff(ordered["door_id"])) + 1)


@dataclass(slots=True)
class _Box:
    """The smallest rectangle around some points, metres."""

    low: tuple[float, float] = (math.inf, math.inf)
    high: tuple[float, float] = (-math.inf, -math.inf)

    def take(self, x: np.ndarray, y: np.ndarray) -> None:
        self.low = (min(self.low[0], float(x.min())), min(self.low[1], float(y.min())))
        self.high = (max(self.high[0], float(x.max())), max(self.high[1], float(y.max())))

    def bounds_m(self) -> tuple[float, float, float, float]:
        """Return the rectangle with a margin, and not too small to look at."""
        if self.low[0] > self.high[0]:
            self.low = self.high = (0.0, 0.0)
        grow = [max(MARGIN_M, (SMALLEST_SIDE_M - (high - low)) / 2)
                for low, high in zip(self.low, self.high, strict=True)]  # fmt: skip
        return (self.low[0] - grow[0], self.low[1] - grow[1],
                self.high[0] + grow[0], self.high[1] + grow[1])  # fmt: skip
