"""The first pass over a log: what a recording of it will show.

Names, lifetimes and bounds must be known before the first row is drawn: a door may get its name
long after its first event, and a late event may tell that it had been removed. The pass keeps a few
numbers a door, whatever the log's length.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from semmap_log.doors import Door, DoorId
from semmap_log.event_batch import EventBatch
from semmap_log.events import Changed, DoorAdded, DoorAnnotated, DoorRemoved, RobotPose
from semmap_log.views.rerun.door_rows import (
    ALWAYS,
    NEVER,
    PROBABILITIES,
    Changes,
    Edge,
    Life,
    Stamp,
    by_door,
    changes_of,
    opening_changes,
    strips_of,
)
from semmap_log.views.rerun.drawable import drawable, free_part, has_letters, unique_parts
from semmap_log.views.rerun.excerpt import Excerpt
from semmap_log.views.rerun.scene import (
    ROOT,
    Bounds,
    Scene,
    SceneDoor,
    SceneLevel,
    bounds_of_floor,
)

NOWHERE = Edge(-1, -1, -1)


def survey(excerpt: Excerpt) -> Scene:
    """Return what a recording of that part of a log has to show."""
    taken = Survey(excerpt)
    for batch in excerpt.batches():
        taken.take(batch)
    return taken.scene()


class Survey:
    """What a recording has to show of the events taken so far."""

    def __init__(self, excerpt: Excerpt) -> None:
        self._excerpt = excerpt
        self._pass = _Pass(excerpt.before().doors)

    def take(self, batch: EventBatch) -> None:
        """Take the next events, in order of their numbers."""
        self._pass.take(batch)

    def is_late(self, batch: EventBatch) -> bool:
        """Tell whether an event about a door counts before one that was taken, or is before it."""
        return any(
            not self._pass.doors.get(DoorId(int(rows["door_id"][0])), NEW).goes_on(rows)
            for rows in by_door(changes_of(batch))
        )

    def scene(self) -> Scene:
        """Return it; names and floor plans are those that the log has now."""
        pass_, since_ns = self._pass, self._excerpt.since_ns
        levels = _levels(self._excerpt, pass_)
        begin, end = pass_.begin, pass_.end
        if since_ns is not None:
            begin = replace(begin, folds_ns=since_ns)
            end = replace(end, folds_ns=max(since_ns, end.folds_ns))
        return Scene(
            doors=_doors(pass_, levels),
            levels=levels,
            robot_level=pass_.robot_last[1],
            events=pass_.events,
            begin=begin,
            end=end,
        )


@dataclass(slots=True)
class _Found:
    """What the pass knows of a door."""

    before: Door | None = None
    added: Stamp = NEVER
    removed: Stamp = NEVER
    name: str = ""
    name_stamp: Stamp = ALWAYS
    levels: dict[int, Stamp] = field(default_factory=dict)
    """Level -> when the door was last put there."""
    state: int | None = None
    state_changes: int = 0
    has_probabilities: bool = False
    latest: Stamp = ALWAYS
    has_late_events: bool = False

    def take(self, changes: Changes) -> None:
        """Take this door's rows, in order of their numbers."""
        stamps = list(zip(changes["folds_ns"].tolist(), changes["number"].tolist(), strict=True))
        self.has_late_events |= not self.goes_on(changes)
        self.latest = max(self.latest, *stamps)
        for row in np.flatnonzero(changes["kind"] == DoorAdded.kind).tolist():
            self.added = stamps[row]
        for row in np.flatnonzero(changes["kind"] == DoorRemoved.kind).tolist():
            self.removed = stamps[row]
        for row in np.flatnonzero((changes["sets"] & int(Changed.POSE)) != 0).tolist():
            level = int(changes["level"][row])
            self.levels[level] = max(stamps[row], self.levels.get(level, ALWAYS))
        self._count_states(changes["state"][(changes["sets"] & int(Changed.STATE)) != 0])
        given = changes[(changes["sets"] & PROBABILITIES) != 0]
        self.has_probabilities |= bool(
            np.isfinite(given["prob_open"]).any() or np.isfinite(given["prob_closed"]).any()
        )

    def goes_on(self, changes: Changes) -> bool:
        """Tell whether all of this door's next rows count behind those taken, in their order."""
        first = int(changes["folds_ns"][0]), int(changes["number"][0])
        return first >= self.latest and bool((np.diff(changes["folds_ns"]) >= 0).all())

    def _count_states(self, states: np.ndarray) -> None:
        if len(states):
            self.state_changes += int(self.state is not None and states[0] != self.state)
            self.state_changes += int(np.count_nonzero(states[1:] != states[:-1]))
            self.state = int(states[-1])

    @property
    def last_level(self) -> int:
        """The level it was put on last."""
        return max(self.levels, key=lambda level: self.levels[level], default=0)

    @property
    def ever_on(self) -> list[int]:
        """All levels it is put on, ascending."""
        return sorted({*self.levels, self.last_level})


NEW = _Found()
"""A door that nothing was heard of yet."""


class _Pass:
    """What is gathered over all batches."""

    def __init__(self, before: Mapping[DoorId, Door]) -> None:
        self.doors = {door_id: _Found(door, name=door.name or "")
                      for door_id, door in before.items()}  # fmt: skip
        self.bounds: dict[int, Bounds] = {}
        self.robot_levels: set[int] = set()
        self.robot_last: tuple[int, int | None] = (-1, None)
        """Happened time and level of the robot's latest pose."""
        self.events = 0
        self.begin = self.end = NOWHERE
        self._take_changes(opening_changes(before.values(), NOWHERE))

    def take(self, batch: EventBatch) -> None:
        folds_ns = batch.folds_ns
        if not self.events:
            self.begin = Edge(int(folds_ns[0]), int(batch.number[0]) - 1,
                              int(batch.recorded_ns[0]) - 1)  # fmt: skip
        self.events += len(batch)
        self.begin = replace(self.begin, folds_ns=min(self.begin.folds_ns, int(folds_ns.min())))
        self.end = Edge(max(self.end.folds_ns, int(folds_ns.max())), int(batch.number[-1]),
                        int(batch.recorded_ns[-1]))  # fmt: skip
        self._take_changes(changes_of(batch))
        self._take_poses(batch)
        self._take_names(batch)

    def _take_changes(self, changes: Changes) -> None:
        for rows in by_door(changes):
            self.doors.setdefault(DoorId(int(rows["door_id"][0])), _Found()).take(rows)
        placed = changes[(changes["sets"] & int(Changed.POSE)) != 0]
        for level in np.unique(placed["level"]).tolist():
            # Where only the pose is set, the width is not at hand: its end may lie in the margin.
            strips = strips_of(placed[placed["level"] == level]).reshape(-1, 2)
            self._stretch(level, strips[:, 0], strips[:, 1])

    def _take_poses(self, batch: EventBatch) -> None:
        if RobotPose not in batch:
            return
        poses = batch[RobotPose]
        folds_ns = batch.folds_ns[batch.where(RobotPose)]
        if folds_ns.max() >= self.robot_last[0]:
            latest = int(np.flatnonzero(folds_ns == folds_ns.max())[-1])
            self.robot_last = int(folds_ns[latest]), int(poses["level"][latest])
        for level in np.unique(poses["level"]).tolist():
            self.robot_levels.add(level)
            here = poses[poses["level"] == level]
            self._stretch(level, here["x"], here["y"])

    def _take_names(self, batch: EventBatch) -> None:
        if DoorAnnotated not in batch:
            return
        where = batch.where(DoorAnnotated)
        stamps = zip(batch.folds_ns[where].tolist(), batch.number[where].tolist(), strict=True)
        for event, stamp in zip(batch.objects[DoorAnnotated.kind], stamps, strict=True):
            assert isinstance(event, DoorAnnotated)
            door = self.doors.setdefault(event.door_id, _Found())
            if event.key == "name" and stamp > door.name_stamp:
                door.name, door.name_stamp = event.value, stamp

    def _stretch(self, level: int, x: np.ndarray, y: np.ndarray) -> None:
        self.bounds[level] = self.bounds.get(level, Bounds()).around(x, y)


def _levels(excerpt: Excerpt, pass_: _Pass) -> dict[int, SceneLevel]:
    """Return the levels with something on them; where there is one, its path is just `/map`."""
    doors = excerpt.log.replay(at=excerpt.last_ns())
    known = doors.levels
    there = [door for door in pass_.doors.values() if door.added != NEVER]
    used = {level for door in there for level in door.levels} | pass_.robot_levels
    if excerpt.doors is None:
        used |= {n for n, level in known.items() if level.floor_map_event is not None}
    numbers = sorted(used) or [0]
    names = {n: level.name or "" for n, level in known.items()}
    parts = unique_parts((n, names.get(n) or str(n)) for n in numbers)
    levels = {}
    for n in numbers:
        floor = excerpt.log.floor_of(doors, n)
        bounds = pass_.bounds.get(n, Bounds())
        if floor is not None:
            bounds = bounds.including(bounds_of_floor(floor))
        levels[n] = SceneLevel(
            level=n,
            name=drawable(names.get(n) or f"Level {n}"),
            path=(ROOT,) if len(numbers) == 1 else (ROOT, parts[n]),
            floor=floor,
            bounds=bounds.framed(),
            is_empty=bounds.is_empty,
            doors=sum(door.last_level == n for door in there),
            has_robot=n in pass_.robot_levels,
        )
    return levels


def _doors(pass_: _Pass, levels: Mapping[int, SceneLevel]) -> dict[DoorId, SceneDoor]:
    """Return the doors that are in the map at some time, ids ascending."""
    there = {i: door for i, door in sorted(pass_.doors.items()) if door.added != NEVER}
    short = {i: _short(door.name, levels[door.last_level]) for i, door in there.items()}
    parts = _parts(there, short)
    return {
        door_id: SceneDoor(
            door_id=door_id,
            label=_label(door_id, found.name),
            short_label=_label(door_id, short[door_id]),
            path=(*levels[found.last_level].path, "doors", parts[door_id]),
            lines={n: (*levels[n].path, "doors", parts[door_id]) for n in found.ever_on},
            life=Life(found.added, found.removed),
            before=found.before,
            state_changes=found.state_changes,
            has_probabilities=found.has_probabilities,
            has_late_events=found.has_late_events,
        )
        for door_id, found in there.items()
    }


def _parts(there: Mapping[DoorId, _Found], short: Mapping[DoorId, str]) -> dict[DoorId, str]:
    """Return a path part for each door, other than those of all that are ever on its levels."""
    parts: dict[DoorId, str] = {}
    taken: dict[int, set[str]] = {}
    for door_id, found in there.items():
        here = [taken.setdefault(n, set()) for n in found.ever_on]
        near = here[0] if len(here) == 1 else set().union(*here)
        parts[door_id] = free_part(door_id, short[door_id], near)
        for names in here:
            names.add(parts[door_id].casefold())
    return parts


def _label(door_id: DoorId, name: str) -> str:
    return drawable(name) if has_letters(name) else f"door {door_id}"


def _short(name: str, level: SceneLevel) -> str:
    """Return the name without the level in front, which is told by the plan it is on."""
    rest = name.removeprefix(level.name).lstrip(" ._-:/")
    return rest or name
