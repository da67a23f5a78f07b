"""What a recorder does with scans as they come: it looks through those that came together."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence

from semmap_log.core.model.events import Event
from semmap_log.core.model.moments import format_local
from semmap_log.interop.topics.known import Known
from semmap_log.interop.topics.lasers.door_places import DoorsNow
from semmap_log.interop.topics.lasers.lasers import Lasers, RobotScan
from semmap_log.interop.topics.lasers.scan_keeper import ScanKeeper
from semmap_log.interop.topics.lasers.scan_words import counts_of, door_oddities_of, oddities_of
from semmap_log.interop.topics.lasers.visit_events import LaserSightings, VisitCommit

QUIET_S = 30.0
"""Of the clock on the wall: the visits of a robot end whose lasers are silent for so long."""


class ScanWatch:
    """Looks at the doors that are known, as they are."""

    def __init__(
        self,
        known: Known,
        robot: str,
        keeper: ScanKeeper | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._known = known
        self._doors = DoorsNow(known)
        self._sightings = LaserSightings(self._doors, robot, keeper=keeper)
        self._waiting: list[RobotScan] = []
        self._clock = clock
        self._heard_s: dict[str, float] = {}
        """Robot whose visits may be going on -> when its last scan came."""

    def add(self, scans: Sequence[RobotScan]) -> None:
        """Have scans wait for `take`."""
        self._waiting += scans
        for each in scans:
            self._heard_s[each.scan.robot] = self._clock()

    def take(self) -> Iterator[VisitCommit]:
        """Look through the scans that wait; yield the visits that ended.

        Those of a robot that is silent end, too: a sighting does not wait for the next scan, which
        may come in an hour, or never.
        """
        if self._waiting:
            scans, self._waiting = self._waiting, []
            yield from self._sightings.take(scans)
        since_s = self._clock() - QUIET_S
        for robot in [robot for robot, heard_s in self._heard_s.items() if heard_s <= since_s]:
            del self._heard_s[robot]
            yield from self._sightings.end(robot)

    def close(self) -> Iterator[VisitCommit]:
        """The same, and all visits end."""
        yield from self.take()
        yield from self._sightings.close()

    def saw(self, events: Iterable[Event]) -> None:
        """Take note of events that are known by now."""
        self._doors.saw(events)

    def start_anew(self, known: Known) -> None:
        """Take other knowledge for what is known."""
        self._known = known
        self._doors = self._sightings.doors = DoorsNow(known)

    @property
    def visits(self) -> int:
        """How many visits there were."""
        tally = self._sightings.tally
        return tally.visits.total() + tally.passages + tally.again

    def lines(self, lasers: Lasers) -> Iterator[str]:
        """Yield what there was of scans and visits, and what is odd about it."""
        yield from counts_of(lasers, self._sightings)
        yield from oddities_of(lasers, self._sightings, lambda ns: format_local(ns, "UTC"))
        yield from door_oddities_of(self._sightings, self._known)
