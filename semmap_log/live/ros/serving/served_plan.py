"""The stops of the robot's patrol that are left, as a geometry_msgs/PoseArray in frame `map`.

The round is the log's: `PatrolStarted` begins one, planned from that moment on; `PatrolFinished`
ends it. A log that has no rounds has one from the server's start on. What the log tells after that
changes the stops as `FollowedRound` says. When the round is over, the array is empty until the log
has the start of another.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from semmap_log.analysis.planning.asked_round import begun_round
from semmap_log.analysis.planning.followed_round import FollowedRound
from semmap_log.analysis.planning.patrol_plan import PlannedStop
from semmap_log.analysis.planning.ways_between import middle_of
from semmap_log.core.folds.patrol_rounds import ROUND_KINDS, rounds
from semmap_log.core.model.doors import DoorMap
from semmap_log.core.model.events import DoorAdded, FloorMap, PatrolStarted, Retracted
from semmap_log.core.model.moments import Moment
from semmap_log.errors import CostmapError, PlanError, UnknownDoorError
from semmap_log.interop.exporting.latest_doors import LatestDoors
from semmap_log.interop.exporting.stream_topics import heights_of
from semmap_log.interop.formats.bags.bag_protocol import BagTopic
from semmap_log.interop.formats.ros.ros_messages import Messages
from semmap_log.interop.formats.ros.ros_types import POSE_ARRAY
from semmap_log.live.ros.serving.served_topics import ServedTopics, levels_of
from semmap_log.log.door_log.door_log import DoorLog

PLAN = BagTopic("semmap/patrol_plan", POSE_ARRAY, is_latched=True)
"""Relative, so that it follows the node's namespace."""

_MAY_HELP = (DoorAdded, FloorMap)
"""Where a round could not be planned, it is tried again after these."""


@dataclass(frozen=True, slots=True)
class PatrolWish:
    """What a patrol is to visit; without either: all rooms."""

    rooms: tuple[str, ...] = ()
    doors: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Begin:
    """Of the round that is the robot's now."""

    start: Moment | None
    """None: the log's end, as it is then."""
    is_finished: bool = False


class ServedPlan:
    """Follows the patrol of a log, and sends what is left of it when that has changed."""

    def __init__(
        self,
        topics: ServedTopics,
        log: Callable[[], DoorLog],
        warn: Callable[[str], None],
        wish: PatrolWish,
    ) -> None:
        """Choose.

        Args:
            topics: Where the messages go.
            log: Gives the log with all that is written.
            warn: Told why a round cannot be planned.
            wish: What to visit.
        """
        self._topics = topics
        self._log = log
        self._warn = warn
        self._wish = wish
        self._messages = Messages(topics.ros_version)
        self._begin: _Begin | None = None
        self._round: FollowedRound | None = None
        self._event = -1
        """The last one that was taken in."""
        self._sent: list[tuple[float, ...]] | None = None
        self._count = 0

    def show(self, doors: DoorMap, at_ns: int) -> None:
        """Send the stops that are left, if they are others than before; the first time, anyway.

        Raises:
            LogError: The log cannot be read any more.
            RosError: The message's type is not installed.
        """
        log = self._log()
        if self._begin is None:
            self._begin_round(log, _begin_of(log))
        self._take_in(log)
        poses = self._poses(doors)
        if poses != self._sent:
            self._sent = poses
            self._topics.write(PLAN, at_ns, self._message(poses, at_ns))
            self._count += 1

    def _take_in(self, log: DoorLog) -> None:
        for followed in log.commits_after(self._event):
            batch = followed.batch
            if followed.commit.last_event <= self._event:  # of a round that was begun meanwhile
                continue
            self._event = followed.commit.last_event
            may_be_another = PatrolStarted in batch or Retracted in batch
            if may_be_another and self._begin != _begin_of(log):
                self._begin_round(log, _begin_of(log))
            elif self._round is not None:
                self._round.take(batch)
            elif any(kind in batch for kind in _MAY_HELP) and self._begin is not None:
                self._begin_round(log, self._begin)

    def _begin_round(self, log: DoorLog, begin: _Begin) -> None:
        """Plan a round, and take in what the log has of it."""
        self._begin, self._round = begin, None
        self._event = log.last_event()
        if begin.is_finished:
            return
        try:
            begun = begun_round(
                log, rooms=self._wish.rooms, doors=self._wish.doors, start=begin.start
            )
        except (PlanError, UnknownDoorError, CostmapError) as error:
            self._warn(f"no patrol: {error}")
            return
        self._round = FollowedRound(begun, self._log)
        for batch in log.batches(since=Moment(ns=begun.plan.start_ns + 1)):
            self._round.take(batch)

    def _poses(self, doors: DoorMap) -> list[tuple[float, ...]]:
        """Return x, y, z and the way that the robot looks, of each stop."""
        if self._round is None:
            return []
        elevations = {number: level.elevation for number, level in doors.levels.items()}
        heights = heights_of(LatestDoors(elevations=elevations), dict.fromkeys(levels_of(doors)))
        return [_pose(stop, heights.get(stop.place.level, 0.0)) for stop in self._round.stops()]

    def _message(self, poses: list[tuple[float, ...]], at_ns: int) -> Any:
        made = [self._messages.pose(*pose) for pose in poses]
        header = self._messages.header(at_ns, self._count)
        return self._messages.new(POSE_ARRAY, header=header, poses=made)


def _begin_of(log: DoorLog) -> _Begin:
    """Return the begin of the robot's round by what the log has: the last that was started."""
    known = [one for one in rounds(log.history(kinds=ROUND_KINDS)) if one.start_ns is not None]
    if not known:
        return _Begin(None)
    last = max(known, key=lambda one: one.start_ns or 0)
    return _Begin(Moment(ns=last.start_ns), is_finished=last.end_ns is not None)


def _pose(stop: PlannedStop, z: float) -> tuple[float, ...]:
    """Return where to stand before a stop's door, looking at it."""
    place, middle = stop.place, middle_of(stop.door)
    away = (middle.x - place.x, middle.y - place.y)
    theta = math.atan2(away[1], away[0]) if any(away) else stop.door.theta + math.pi / 2
    return place.x, place.y, z, theta
