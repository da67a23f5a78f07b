"""What a log's stream will hold: it has to be known before its first message."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from semmap_log.core.model.doors import DoorMap
from semmap_log.core.model.events import ADDING_KINDS, POSE_KINDS, FloorMap, RobotPose
from semmap_log.interop.exporting.in_order import Times
from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.interop.formats.ros.ros_types import (
    DOOR_MAP,
    GRID,
    MARKERS,
    POSE_STAMPED,
    RosVersion,
    log_type,
)
from semmap_log.log.door_log.door_log import DoorLog

ROBOT = BagTopic("/semmap/robot_pose", POSE_STAMPED, is_latched=False)
THESIS = BagTopic("/lta_semantic_map_door_db", DOOR_MAP, is_latched=True)

EVERY_S = (0, 1, 10, 60, 600, 3600, 86_400)
"""How far whole arrays may lie apart: of these the first with which there are not too many."""
MOST_DOORS_SENT = 10_000_000
"""Doors in all arrays of a topic together: some 5 GB to whoever unpacks them all. A week of a
clinic with 133 doors and 19,000 sightings stays below it, a year of it comes at most each 600 s."""


@dataclass(frozen=True, slots=True)
class StreamPlan:
    """The topics of a stream: bags and publishers want to know them before the first message."""

    floors: dict[int, BagTopic]
    """By the level."""
    doors: dict[int, BagTopic]
    events: BagTopic
    has_robot: bool
    every_s: float
    markers: bool
    """Doors and events are shown, too: not only said to who knows the thesis's message."""

    @property
    def levels(self) -> dict[int, None]:
        """All that are shown."""
        return dict.fromkeys(sorted({*self.floors, *self.doors}))

    @property
    def topics(self) -> list[BagTopic]:
        """All of the stream."""
        robot = [ROBOT] if self.has_robot else []
        if not self.markers:
            return [*self.floors.values(), THESIS, *robot]
        return [*self.floors.values(), *self.doors.values(), THESIS, *robot, self.events]


def plan_of(
    log: DoorLog,
    before: DoorMap,
    times: Times,
    *,
    ros_version: RosVersion,
    markers: bool,
    every_s: float | None,
) -> StreamPlan:
    """Return what a stream of a log will hold.

    Args:
        log: The log.
        before: The doors before the first event.
        times: When the events count: see `times_of`.
        ros_version: Whose types.
        markers: With the topics that show doors and events.
        every_s: How far arrays lie apart; None: see `EVERY_S`.
    """
    doors = {door.level for door in before.doors.values() if door.is_placed}
    floors = {level.level for level in before.levels.values() if level.floor_map_event is not None}
    count, has_robot = len(before), False
    changes = [np.empty(0, np.int64)]
    if len(times):
        for batch in log.batches(int(times[0]), int(times[-1]) + 1):
            has_robot |= RobotPose in batch
            count += sum(len(batch.where(kind)) for kind in ADDING_KINDS)
            changes.append(batch.folds_ns[batch.about_doors()])
            floors |= {
                each.level
                for each in batch.objects.get(FloorMap.kind, ())
                if isinstance(each, FloorMap)
            }
            for kind in POSE_KINDS:
                if kind in batch:
                    rows = batch[kind]
                    doors.update(rows["level"][np.isfinite(rows["x"])].tolist())
    several = len(doors | floors) > 1

    def topics(name: str, ros_type: str, levels: set[int]) -> dict[int, BagTopic]:
        return {
            level: BagTopic(f"{name}/level_{level}" if several and level else name, ros_type, True)
            for level in sorted(levels)
        }

    if every_s is None:
        every_s = 0 if not markers else _every_s(np.sort(np.concatenate(changes)), count)
    events = BagTopic("/semmap/events", log_type(ros_version), is_latched=False)
    return StreamPlan(topics("/map", GRID, floors), topics("/semmap/doors", MARKERS, doors or {0}),
                 events, has_robot, every_s, markers)  # fmt: skip


def _every_s(times: Times, doors: int) -> float:
    """Return how far arrays have to lie apart, if each of these moments changed a door."""
    for every_s in EVERY_S:
        arrays = 1 + np.count_nonzero(np.diff(times // max(1, every_s * 10**9)))
        if arrays * doors <= MOST_DOORS_SENT:
            return every_s
    return EVERY_S[-1]
