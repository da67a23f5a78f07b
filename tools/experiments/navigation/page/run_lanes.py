"""What a run's logs say over time: doors in the world and in the map, the robot, its goals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from navigation.runs import Run
from semmap_log.core.folds.timeline import Timeline
from semmap_log.core.model.doors import Door, DoorId, DoorState
from semmap_log.core.model.events import FloorMap, RobotPose


@dataclass(frozen=True)
class DoorLanes:
    """A door over the run."""

    door: Door
    world: Timeline
    belief: Timeline

    @property
    def name(self) -> str:
        """What people call it."""
        return self.door.annotations.get("name") or f"door {self.door.door_id}"

    @property
    def line(self) -> np.ndarray:
        """From where to where: m (2, 2)."""
        along = self.door.width * np.array([np.cos(self.door.theta), np.sin(self.door.theta)])
        start = np.array([self.door.x, self.door.y])
        return np.array([start, start + along])

    def wrong(self) -> list[tuple[int, str]]:
        """Return from when on the map had it wrong, and how; "": it had it right."""
        cuts = np.unique(np.concatenate([self.world.start_ns, self.belief.start_ns]))
        said: list[tuple[int, str]] = []
        for at_ns in cuts.tolist():
            is_state, believed = _state_at(self.world, at_ns), _state_at(self.belief, at_ns)
            words = "" if is_state == believed else f"{is_state.name}, not {believed.name}"
            if not said or said[-1][1] != words:
                said.append((at_ns, words))
        return said


def _state_at(lane: Timeline, at_ns: int) -> DoorState:
    return DoorState(lane.state[max(0, np.searchsorted(lane.start_ns, at_ns, "right") - 1)])


def door_lanes(run: Run) -> Mapping[DoorId, DoorLanes]:
    """Return the doors of a run that have a place."""
    world, belief = run.world.timelines(), run.belief.timelines()
    doors = run.belief.replay().doors
    return {
        door_id: DoorLanes(door, world[door_id], belief[door_id])
        for door_id, door in doors.items()
        if np.isfinite(door.x)
    }


def floor_of(run: Run) -> FloorMap | None:
    """Return the run's floor plan; None: its logs hold none."""
    for entry in run.belief.history(kinds=[FloorMap]):
        assert isinstance(entry.event, FloorMap)
        return entry.event
    return None


def track_of(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return when and where the robot was: int64 ns (n,), x, y in m and theta (n, 3)."""
    times, poses = [np.empty(0, np.int64)], [np.empty((0, 3))]
    for batch in run.belief.batches(kinds=[RobotPose]):
        rows = batch[RobotPose]
        times.append(batch.happened_ns)
        poses.append(np.column_stack([rows["x"], rows["y"], rows["theta"]]))
    return np.concatenate(times), np.concatenate(poses)


def places_at(times_ns: np.ndarray, poses: np.ndarray, at_ns: np.ndarray) -> np.ndarray:
    """Return where the robot was at some times, at its last pose: m (n, 2)."""
    if not len(poses) or not len(at_ns):
        return np.empty((0, 2))
    return poses[np.maximum(np.searchsorted(times_ns, at_ns, "right") - 1, 0), :2]
