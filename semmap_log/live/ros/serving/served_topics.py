"""Topics that a server offers while it runs: made when something is first sent on them.

They are the doors at each change, as the thesis's DoorMap and as markers for RViz, and the stops of
the robot's patrol that are left, as a geometry_msgs/PoseArray in frame `map`.

The round is the log's: `PatrolStarted` begins one, planned from that moment on; `PatrolFinished`
ends it. A log that has no rounds has one from the server's start on. Later events change the stops
as `FollowedRound` says. When the round is over, the array is empty until the log has the start of
another.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from semmap_log.analysis.planning.followed_round import FollowedRound
from semmap_log.analysis.planning.patrol_plan import PlannedStop, middle_of
from semmap_log.analysis.planning.round_planner import begun_round
from semmap_log.core.folds.history import ROUND_KINDS, rounds
from semmap_log.core.folds.levels import DoorsPresent
from semmap_log.core.model.doors import Door, DoorId, DoorMap
from semmap_log.core.model.events import DoorAdded, FloorMap, PatrolStarted, Retracted
from semmap_log.core.model.moments import Moment
from semmap_log.errors import CostmapError, PlanError, UnknownDoorError
from semmap_log.interop.exporting import stream_topics
from semmap_log.interop.formats.bags.bag_protocol import BagTopic, NewBag
from semmap_log.interop.formats.ros import ros_types
from semmap_log.interop.formats.ros.door_messages import DoorMarkers, ThesisMessages
from semmap_log.live.ros.ros_node import Publisher, RosNode
from semmap_log.log import DoorLog
from semmap_log.views.palette import DEFAULT, Palette

DOOR_DB = BagTopic("lta_semantic_map_door_db", ros_types.DOOR_MAP, is_latched=True)
"""The thesis's topic (4.2.5); relative, so that it follows the node's namespace."""
MARKERS_NAME = "semmap/doors"


class ServedDoors:
    """Sends messages that are the whole truth, each when it is another than the last one."""

    def __init__(
        self,
        topics: NewBag,
        names: LevelNames,
        *,
        palette: Palette = DEFAULT,
        default_prob: float | None = None,
    ) -> None:
        """Choose how doors look.

        Args:
            topics: Where the messages go.
            names: Of the topics of levels.
            palette: Colours of the markers.
            default_prob: Stands in the DoorMap for probabilities that were not given; None: NaN.
        """
        self._topics = topics
        self._names = names
        self._palette = palette
        self._markers = DoorMarkers(topics.ros_version)
        self._thesis = stream_topics.ThesisDoors(ThesisMessages(topics.ros_version, default_prob))
        self._levels: dict[int, stream_topics.LevelDoors] = {}
        self._heights: dict[int, float] = {}
        self._changes = ChangedDoors()
        self._has_sent = False

    def show(self, doors: DoorMap, at_ns: int) -> None:
        """Send what is another than before; the first time, all.

        Raises:
            RosError: A message's type is not installed.
        """
        others, is_raised = self._take_levels(doors)
        is_thesis_new = not self._has_sent
        changed = self._changes.take(doors)
        if is_raised:
            changed |= doors.doors
        for door_id, door in changed.items():
            is_thesis_new |= self._thesis.show(door_id, door)
            for level, shown in self._levels.items():
                if shown.show(door_id, door, self._heights.get(level, 0.0)):
                    others.add(level)
        if is_thesis_new:
            self._topics.write_encoded(DOOR_DB, at_ns, self._thesis.message())
        for level in sorted(others):
            topic = self._names.topic(MARKERS_NAME, level, ros_types.MARKERS)
            self._topics.write_encoded(topic, at_ns, self._levels[level].message())
        self._has_sent = True

    def _take_levels(self, doors: DoorMap) -> tuple[set[int], bool]:
        """Take in new levels and their heights; return the new ones, and whether any is redrawn."""
        levels = levels_of(doors) | self._levels.keys() or {0}
        elevations = {n: level.elevation for n, level in doors.levels.items()}
        heights = stream_topics.heights_of(
            stream_topics.LatestDoors(elevations=elevations), dict.fromkeys(levels)
        )
        if heights == self._heights:
            return set(), False
        new = levels - self._levels.keys()
        self._levels |= {n: stream_topics.LevelDoors(self._markers, n, self._palette) for n in new}
        self._heights = heights
        return new, True


PLAN = BagTopic("semmap/patrol_plan", ros_types.POSE_ARRAY, is_latched=True)
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
            warn: Called with the reason why a round cannot be planned.
            wish: What to visit.
        """
        self._topics = topics
        self._log = log
        self._warn = warn
        self._wish = wish
        self._messages = ros_types.Messages(topics.ros_version)
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
        heights = stream_topics.heights_of(
            stream_topics.LatestDoors(elevations=elevations), dict.fromkeys(levels_of(doors))
        )
        return [_pose(stop, heights.get(stop.place.level, 0.0)) for stop in self._round.stops()]

    def _message(self, poses: list[tuple[float, ...]], at_ns: int) -> Any:
        made = [self._messages.pose(*pose) for pose in poses]
        header = self._messages.header(at_ns, self._count)
        return self._messages.new(ros_types.POSE_ARRAY, header=header, poses=made)


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


class ServedTopics:
    """A node's topics, to be written to as to a bag (`NewBag`)."""

    def __init__(self, node: RosNode) -> None:
        self.ros_version: ros_types.RosVersion = node.ros_version
        self._node = node
        self._publishers: dict[BagTopic, Publisher] = {}

    def offer(self, topic: BagTopic) -> None:
        """Let subscribers find a topic before anything is sent on it.

        Raises:
            RosError: Its type is not installed.
        """
        if topic not in self._publishers:
            self._publishers[topic] = self._node.publisher(topic)

    def write(self, topic: BagTopic, at_ns: int, message: Any) -> None:
        """Publish a message."""
        self.write_encoded(
            topic, at_ns, ros_types.encoded(self.ros_version, message, topic.ros_type)
        )

    def write_encoded(self, topic: BagTopic, at_ns: int, data: bytes) -> None:
        """Publish a message that is bytes already.

        Raises:
            RosError: Its type is not installed.
        """
        del at_ns  # live, a message's time is now
        self.offer(topic)
        self._publishers[topic].publish(data)


class LevelNames:
    """How the topics of levels are called: plain, or with the level's number.

    What is alone at the server's start keeps the plain name; of several, level 0 has it.
    """

    def __init__(self, levels: Iterable[int]) -> None:
        found = list(levels)
        self._plain = found[0] if len(found) == 1 else 0

    def topic(self, name: str, level: int, ros_type: str, *, is_latched: bool = True) -> BagTopic:
        """Return a level's topic; its name is relative, so that it follows the node's namespace.

        Args:
            name: As of level 0.
            level: Its number.
            ros_type: In the long form.
            is_latched: See `BagTopic`.
        """
        own = name if level == self._plain else f"{name}/level_{level}"  # ROS 2: not /1
        return BagTopic(own, ros_type, is_latched)


class ChangedDoors:
    """Finds the doors that differ from the map before; the cost is that of the change."""

    def __init__(self) -> None:
        self._seen: DoorsPresent | None = None

    def take(self, doors: DoorMap) -> dict[DoorId, Door | None]:
        """Return the doors that are other than they were, None for those that are gone.

        Of the first map these are all.
        """
        now = doors_of(doors)
        changed, gone = (list(now), []) if self._seen is None else now.others_than(self._seen)
        self._seen = now
        return {**{door: now[door] for door in changed}, **dict.fromkeys(gone)}


def doors_of(doors: DoorMap) -> DoorsPresent:
    """Return the doors of a map that a log gave: they can be compared without making each."""
    assert isinstance(doors.doors, DoorsPresent)
    return doors.doors


def levels_of(doors: DoorMap) -> set[int]:
    """Return the levels that have a door with a place, or a floor plan."""
    drawn = {n for n, level in doors.levels.items() if level.floor_map_event is not None}
    return doors_of(doors).placed_levels() | drawn
