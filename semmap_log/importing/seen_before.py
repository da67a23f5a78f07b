"""Visits that a log has already: by an earlier import, or recorded while the robot drove."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from semmap_log.domain.events import DoorObserved, DoorPassed, Event
from semmap_log.door_log.door_log import DoorLog
from semmap_log.ros_mapping.lasers.visit_events import VisitCommit


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
    told: Mapping[tuple[str, str, int, type[Event]], Sequence[int]]
    """Actor, source, door and kind -> when, nanoseconds, ascending."""

    @classmethod
    def of(cls, log: DoorLog, visits: Sequence[VisitCommit]) -> SeenBefore:
        """Return what a log has that may be some of these visits."""
        if not visits:
            return cls(frozenset(), {})
        told: dict[tuple[str, str, int, type[Event]], list[int]] = {}
        commands: set[bytes] = set()
        since = min(each.visit.first_ns for each in visits)
        until = max(each.visit.last_ns for each in visits) + 1
        for entry in log.history(since=since, until=until, kinds=[DoorObserved, DoorPassed]):
            event = entry.event
            assert isinstance(event, DoorObserved | DoorPassed)
            commands.add(entry.command_id)
            key = (entry.actor, entry.source, event.door_id, type(event))
            told.setdefault(key, []).append(entry.happened_ns)
        return cls(frozenset(commands), {key: sorted(times) for key, times in told.items()})

    def holds(self, planned: PlannedVisit) -> bool:
        """Tell whether this very visit is stored."""
        return planned.command_id in self.commands

    def overlaps(self, planned: PlannedVisit) -> bool:
        """Tell whether the same laser told of the same door meanwhile."""
        visit, note = planned.commit.visit, planned.commit.note
        kind = DoorPassed if visit.passed else DoorObserved
        times = self.told.get((note.actor, note.source, visit.door_id, kind), ())
        place = bisect_left(times, visit.first_ns)
        return place < len(times) and times[place] <= visit.last_ns
