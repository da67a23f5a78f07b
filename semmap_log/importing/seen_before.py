"""Visits that a log has already: by an earlier import, or recorded while the robot drove."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from semmap_log.domain.events import DoorObserved, DoorPassed, Event
from semmap_log.door_log.door_log import DoorLog
from semmap_log.ros_mapping.lasers.visit_events import VisitCommit
from semmap_log.scans.door_watcher import ONE_PASSAGE_NS

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

    @classmethod
    def of(cls, log: DoorLog, visits: Sequence[VisitCommit]) -> SeenBefore:
        """Return what a log has that may be some of these visits."""
        if not visits:
            return cls(frozenset(), {})
        told: dict[_Key, list[int]] = {}
        commands: set[bytes] = set()
        since = min(each.visit.first_ns for each in visits) - ONE_PASSAGE_NS
        until = max(each.visit.last_ns for each in visits) + ONE_PASSAGE_NS + 1
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

    def overlaps(self, planned: PlannedVisit, actor: str = "") -> bool:
        """Tell whether the same laser told of the same door meanwhile.

        Or whoever it was that told that the robot drove through it: it did so once.

        Args:
            planned: The visit.
            actor: Who will be named as who saw it, and may have been before; "": the robot.
        """
        names = {planned.commit.note.actor, actor or planned.commit.note.actor}
        return any(self._overlaps(planned, name) for name in names)

    def _overlaps(self, planned: PlannedVisit, actor: str) -> bool:
        visit, source = planned.commit.visit, planned.commit.note.source
        kind = DoorPassed if visit.passed else DoorObserved
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
