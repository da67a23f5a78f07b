"""One pass over a log's events: what the page needs of them, in a few columns.

Of each report of a state 22 bytes are kept, of each pose 20; the rest is rare.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.batches.event_batch import EventBatch
from semmap_log.core.folds.door_changes import CHANGE, EVERYTHING, STATE, STATE_CHANGE, parts_of
from semmap_log.core.model.events import KINDS, DoorPassed, PatrolFinished, PatrolStarted, RobotPose
from semmap_log.log.door_log.robot_names import robots_of, robots_of_poses
from semmap_log.views.excerpt.door_rows import sorted_by_stamp
from semmap_log.views.excerpt.span import Excerpt

POSE = np.dtype([("folds_ns", "i8"), ("level", "u2"), ("x", "f4"), ("y", "f4"), ("robot", "u2")])
STAMP = np.dtype([("folds_ns", "i8"), ("number", "i8")])

MOST_CHANGES = 200
"""So many of the last changes are told in words."""
TOLD = tuple(
    kind
    for kind in KINDS
    if not (kind.effect.is_sighting or kind in (PatrolStarted, PatrolFinished, RobotPose))
)
"""Kinds that are told whatever they say; sightings are where they tell of another state."""

Rows = NDArray[Any]


@dataclass(slots=True)
class PageEvents:
    """What was found, in the order in which it counts: by (folds_ns, number)."""

    states: Rows
    """Rows of `STATE_CHANGE`, by door first."""
    rest: Rows
    """Rows of `CHANGE` that add, place or remove a door, or set its probabilities."""
    poses: Rows
    """Rows of `POSE`."""
    told: Rows
    """Rows of `STAMP`: the latest events of the kinds `TOLD`, and passages that failed."""
    events: int
    first_ns: int | None
    """When the first of the events happened; None: there are none."""
    last_ns: int | None


def gather(excerpt: Excerpt, progress: Callable[[int, int], None] | None = None) -> PageEvents:
    """Read the events of an excerpt."""
    reading = _Reading(robots_of(excerpt.log.info))
    for batch in excerpt.happened(progress):
        reading.take(batch)
    return reading.page_events()


@dataclass(slots=True)
class _Reading:
    robots: tuple[str, ...]
    states: list[Rows] = field(default_factory=lambda: [np.empty(0, STATE_CHANGE)])
    rest: list[Rows] = field(default_factory=lambda: [np.empty(0, CHANGE)])
    poses: list[Rows] = field(default_factory=lambda: [np.empty(0, POSE)])
    told: Rows = field(default_factory=lambda: np.empty(0, STAMP))
    events: int = 0
    first_ns: int | None = None
    last_ns: int | None = None

    def take(self, batch: EventBatch) -> None:
        folds_ns = batch.folds_ns
        first_ns, last_ns = int(folds_ns.min()), int(folds_ns.max())
        self.first_ns = first_ns if self.first_ns is None else min(self.first_ns, first_ns)
        self.last_ns = last_ns if self.last_ns is None else max(self.last_ns, last_ns)
        self.events += len(batch)
        self.states += parts_of(batch, STATE_CHANGE, setting=STATE)
        self.rest += parts_of(batch, CHANGE, setting=EVERYTHING & ~STATE)
        if RobotPose in batch:
            self.poses.append(_poses(batch, self.robots))
        self._tell(batch)

    def page_events(self) -> PageEvents:
        states, rest = np.concatenate(self.states), np.concatenate(self.rest)
        poses = np.concatenate(self.poses)
        return PageEvents(
            states=states[np.lexsort((states["number"], states["folds_ns"], states["door_id"]))],
            rest=sorted_by_stamp(rest),
            poses=poses[np.argsort(poses["folds_ns"], kind="stable")],
            told=self.told,
            events=self.events,
            first_ns=self.first_ns,
            last_ns=self.last_ns,
        )

    def _tell(self, batch: EventBatch) -> None:
        told = np.isin(batch.kind, [kind.kind for kind in TOLD])
        if DoorPassed in batch:
            told[batch.where(DoorPassed)[~batch[DoorPassed]["passed"].astype(bool)]] = True
        stamps = np.empty(int(np.count_nonzero(told)), STAMP)
        stamps["folds_ns"], stamps["number"] = batch.folds_ns[told], batch.number[told]
        self.told = sorted_by_stamp(np.concatenate([self.told, stamps]))[-MOST_CHANGES:]


def _poses(batch: EventBatch, robots: tuple[str, ...]) -> Rows:
    poses = np.empty(len(batch.where(RobotPose)), POSE)
    poses["folds_ns"] = batch.folds_ns[batch.where(RobotPose)]
    poses["robot"] = robots_of_poses(batch, robots)
    with np.errstate(over="ignore"):  # what float32 cannot hold is nowhere near a building
        for name in ("level", "x", "y"):
            poses[name] = batch[RobotPose][name]
    finite: Rows = poses[np.isfinite(poses["x"]) & np.isfinite(poses["y"])]
    return finite
