"""Visits that a log has already: by an earlier import, or recorded while the robot drove."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import hypot

from semmap_log.analysis.scans.door_watcher import ONE_PASSAGE_NS
from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.model.events import DoorObserved, DoorPassed, Event, RobotPose
from semmap_log.interop.topics.lasers.visit_events import WAY_NS, VisitCommit, is_laser
from semmap_log.log.door_log.door_log import DoorLog

SAME_PLACE_M = 1.0
"""Two robots are not so near to each other at one moment."""
_KINDS = (RobotPose, DoorObserved, DoorPassed)
_Key = tuple[str, str, int, type[Event]]


@dataclass(frozen=True, slots=True)
class PlannedVisit:
    """A commit for the log."""

    command_id: bytes
    commit: VisitCommit


@dataclass(frozen=True, slots=True)
class SeenBefore:
    """What a log has of the lasers of a bag, at the time of the bag.

    A visit that is told twice would count as two.
    """

    commands: frozenset[bytes]
    told: Mapping[_Key, Sequence[int]]
    """Actor, source, door and kind -> when, nanoseconds, ascending."""
    from_where: Mapping[tuple[int, type[Event]], Sequence[RobotPose]] = field(default_factory=dict)
    """Door and kind -> where a robot was when its laser told that."""

    @classmethod
    def of(cls, log: DoorLog, visits: Sequence[VisitCommit]) -> SeenBefore:
        """Return what a log has that may be some of these visits."""
        if not visits:
            return cls(frozenset(), {})
        poses: dict[tuple[bytes, int], RobotPose] = {}
        from_where: dict[tuple[int, type[Event]], list[RobotPose]] = {}
        told: dict[_Key, list[int]] = {}
        commands: set[bytes] = set()
        since = min(each.visit.first_ns for each in visits) - ONE_PASSAGE_NS
        until = max(each.visit.last_ns for each in visits) + ONE_PASSAGE_NS + 1
        for entry in log.history(since=since, until=until, kinds=_KINDS):
            event = entry.event
            if isinstance(event, RobotPose):  # before what was seen from there
                poses[entry.command_id, entry.happened_ns] = event
                continue
            assert isinstance(event, DoorObserved | DoorPassed)
            commands.add(entry.command_id)
            key = (entry.actor, entry.source, event.door_id, type(event))
            told.setdefault(key, []).append(entry.happened_ns)
            pose = poses.get((entry.command_id, entry.happened_ns))
            if pose is not None and is_laser(entry.source):
                from_where.setdefault((event.door_id, type(event)), []).append(pose)
        in_order = {key: sorted(times) for key, times in told.items()}
        return cls(frozenset(commands), in_order, from_where)

    def holds(self, planned: PlannedVisit) -> bool:
        """Tell whether this very visit is stored."""
        return planned.command_id in self.commands

    def overlaps(self, planned: PlannedVisit, actor: str = "") -> bool:
        """Tell whether the same laser told of the same door meanwhile, or another of its robot.

        Or whoever it was that told that the robot drove through it: it did so once. Whatever name
        it was told in: two robots are not at one place at one moment.

        Args:
            planned: The visit.
            actor: Who will be named as who saw it, and may have been before; "": the robot.
        """
        names = {planned.commit.note.actor, actor or planned.commit.note.actor}
        if any(self._overlaps(planned, name) for name in names):
            return True
        visit, way = planned.commit.visit, planned.commit.way
        told = self.from_where.get((visit.door_id, kind_of(visit)), ())
        return any(_was_there(way, pose) for pose in told)

    def _overlaps(self, planned: PlannedVisit, actor: str) -> bool:
        visit, source = planned.commit.visit, planned.commit.note.source
        kind = kind_of(visit)
        own = (actor, source, visit.door_id, kind)
        if self._is_told(own, visit.first_ns, visit.last_ns):
            return True
        if not visit.passed:
            return False
        others = [key for key in self.told if key[::2] == (actor, visit.door_id) and key != own
                  and key[3] is kind]  # fmt: skip
        around = visit.first_ns - ONE_PASSAGE_NS, visit.last_ns + ONE_PASSAGE_NS
        return any(self._is_told(key, *around) for key in others)

    def _is_told(self, key: _Key, first_ns: int, last_ns: int) -> bool:
        times = self.told.get(key, ())
        place = bisect_left(times, first_ns)
        return place < len(times) and times[place] <= last_ns


def kind_of(visit: Visit) -> type[DoorObserved | DoorPassed]:
    """Return the kind of event that a visit becomes."""
    return DoorPassed if visit.passed else DoorObserved


def _was_there(way: Sequence[RobotPose], pose: RobotPose) -> bool:
    """Tell whether a robot came by a place at that very moment."""
    at_ns = pose.happened_ns or 0
    for before, after in pairwise(way):
        first_ns, last_ns = before.happened_ns or 0, after.happened_ns or 0
        if first_ns <= at_ns <= last_ns and last_ns - first_ns <= 2 * WAY_NS:
            share = (at_ns - first_ns) / (last_ns - first_ns)
            x = before.x + share * (after.x - before.x)
            y = before.y + share * (after.y - before.y)
            return pose.level == before.level and hypot(pose.x - x, pose.y - y) <= SAME_PLACE_M
    return False
