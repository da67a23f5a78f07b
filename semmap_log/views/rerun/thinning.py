"""What a long recording leaves out, since no eye would see it: pure numpy.

Up to `FULL_UP_TO` events it holds everything. Beyond, sightings that only repeat what a door is
have no line in the event log, and poses that hardly differ from the one before are left out of
the robot's track. A change of a state is never left out, nor anything of lanes, plans and curves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.folds.door_changes import Changes
from semmap_log.core.model.doors import DoorId
from semmap_log.core.model.events import DoorObserved, DoorPassed
from semmap_log.core.model.meaning import Changed
from semmap_log.core.texts import counted
from semmap_log.views.excerpt.door_rows import NO_STATE, by_door
from semmap_log.views.rerun.scene import Scene, SceneDoor

FULL_UP_TO = 50_000
"""Events."""

NEAR_M, NEAR_RAD, NEAR_NS = 0.05, np.radians(5.0), 30 * 10**9
"""A pose is drawn when the robot has come so far, turned so much, or so much time has passed."""


@dataclass(frozen=True, slots=True)
class LeftOut:
    """How much a recording left out."""

    repeats: int = 0
    """Sightings without a line in the event log: they repeat what the door was."""
    poses: int = 0
    """Poses that hardly differ from the one before."""

    def __str__(self) -> str:
        """Return it in words; empty: everything is there."""
        parts = []
        if self.repeats:
            parts.append(f"{counted(self.repeats, 'line')} of sightings that repeat a state")
        if self.poses:
            parts.append(f"{counted(self.poses, 'pose')} close to others")
        return f"without {' and '.join(parts)}" if parts else ""


def is_long(scene: Scene) -> bool:
    """Tell whether a recording leaves out what no eye would see."""
    return scene.events > FULL_UP_TO


class RepeatFinder:
    """Finds the sightings that see what was known already."""

    def __init__(self, doors: Mapping[DoorId, SceneDoor]) -> None:
        self._disturbed = {int(i): door.disturbed_ns for i, door in doors.items()
                           if len(door.disturbed_ns)}  # fmt: skip
        self._ids = np.array(sorted(doors), np.int64)
        self._states = np.full(len(self._ids) + 1, NO_STATE, np.uint8)
        self._last: dict[int, tuple[int, int]] = {}
        """Of disturbed doors: time and state of the last sighting in order."""

    def numbers(self, changes: Changes) -> NDArray[np.int64]:
        """Return the numbers of the next sightings that repeat a state.

        Args:
            changes: Events about doors, numbers ascending.
        """
        setting = changes[(changes["sets"] & int(Changed.STATE)) != 0]
        disturbed = np.isin(setting["door_id"], list(self._disturbed))
        found = [self._quiet(setting[~disturbed])]
        found += [self._restless(rows) for rows in by_door(setting[disturbed])]
        repeats: Changes = np.concatenate(found)
        is_sighting = np.isin(repeats["kind"], [DoorObserved.kind, DoorPassed.kind])
        return np.asarray(repeats["number"][is_sighting])

    def _quiet(self, changes: Changes) -> Changes:
        """Return the repeats of doors whose events all came in order."""
        ordered = changes[np.argsort(changes["door_id"], kind="stable")]
        place = np.searchsorted(self._ids, ordered["door_id"])
        goes_on = np.append(False, place[1:] == place[:-1])[: len(place)]
        before = np.where(goes_on, np.roll(ordered["state"], 1), self._states[place])
        self._states[place] = ordered["state"]  # of assignments to one place the last stays
        repeats: Changes = ordered[before == ordered["state"]]
        return repeats

    def _restless(self, changes: Changes) -> Changes:
        """Return those of a door with late events, or ones that were taken back.

        Between two sightings that are alike nothing else may have been told of.
        """
        door_id = int(changes["door_id"][0])
        disturbed_ns = self._disturbed[door_id]
        in_order = changes[~np.isin(changes["folds_ns"], disturbed_ns)]
        if not len(in_order):
            return in_order
        last_ns, state = self._last.get(door_id, (-1, NO_STATE))
        times = np.append(last_ns, in_order["folds_ns"])
        states = np.append(np.uint8(state), in_order["state"])
        told_between = np.diff(np.searchsorted(disturbed_ns, times)) != 0
        self._last[door_id] = int(times[-1]), int(states[-1])
        repeats: Changes = in_order[(states[1:] == states[:-1]) & ~told_between]
        return repeats


def telling_poses(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    theta: NDArray[np.float64],
    level: NDArray[np.uint16],
    times_ns: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """Tell which poses are drawn: each (n,), in the order in which they were recorded.

    The way is counted along the poses, so that a slow robot is not lost sight of.
    """
    way_m = np.cumsum(np.hypot(np.diff(x, prepend=x[:1]), np.diff(y, prepend=y[:1])))
    turns = np.abs((np.diff(theta, prepend=theta[:1]) + np.pi) % (2 * np.pi) - np.pi)
    steps = np.stack([way_m // NEAR_M, np.cumsum(turns) // NEAR_RAD, times_ns // NEAR_NS, level])
    telling = np.ones(len(x), np.bool_)
    telling[1:] = (steps[:, 1:] != steps[:, :-1]).any(axis=0)
    return telling
