"""Scans in, visits out: the front of this room."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence

from semmap_log.analysis.scans.placed_scan import DoorPlaces, PlacedScan
from semmap_log.analysis.scans.robot_visits import RobotVisits
from semmap_log.analysis.scans.scan_model import DEFAULT, ScanModel
from semmap_log.analysis.scans.visit import Visit
from semmap_log.analysis.scans.watched_doors import WatchedDoors
from semmap_log.core.model.doors import DoorId

ONE_PASSAGE_NS = 5 * 10**9
"""Two lasers of a robot that cross a line so soon after each other were driven through once."""


class DoorWatcher:
    """Looks at doors through the scans of any number of robots and lasers.

        watcher = DoorWatcher()
        for scans, doors in what_comes:
            visits = watcher.take(scans, doors)     # those that ended
        visits = watcher.close()                    # those that were still going on

    A visit is of one door by one robot, through all of its lasers: it ends when the door was out of
    sight for a while, or has been looked at for long; when the door moved, changed otherwise or was
    removed; at `end` and at `close`. A robot that drove through is a visit of its own, with
    `passed`: one, however many lasers it has. How scans are cut into calls makes no difference;
    many at once are faster. A visit that only says again what was told from the same stand has
    `told_ns`.
    """

    def __init__(self, model: ScanModel = DEFAULT) -> None:
        self.model = model
        self.dropped: Counter[str] = Counter()
        """Why scans were not used, and how many."""
        self._robots: dict[str, RobotVisits] = {}
        self._doors: WatchedDoors | None = None
        self._passed: dict[tuple[str, DoorId], Visit] = {}
        """Robot and door -> when it drove through last."""

    def take(self, scans: Sequence[PlacedScan], doors: DoorPlaces) -> list[Visit]:
        """Look at `scans`, through all of which the doors are these; return the visits that ended.

        The scans of a laser are given in the order of their stamps, those of a robot's lasers
        nearly so; others are dropped and counted. The same object `doors` as in the last call costs
        nothing.
        """
        done = self._know(doors)
        known = self._doors
        assert known is not None
        by_robot: dict[str, list[PlacedScan]] = defaultdict(list)
        for scan in scans:
            by_robot[scan.robot].append(scan)
        for robot, its in by_robot.items():
            done += self._robot(robot).take(its, known)
        return [visit for visit in _sorted(done) if not self._is_told(visit)]

    def close(self) -> list[Visit]:
        """Return the visits that have not ended, as far as they went."""
        if self._doors is None:
            return []
        return _sorted([v for robot in self._robots.values() for v in robot.end(self._doors)])

    def end(self, robot: str) -> list[Visit]:
        """Return the visits of one robot that have not ended, as far as they went: it is silent."""
        found = self._robots.get(robot)
        return [] if found is None or self._doors is None else _sorted(found.end(self._doors))

    def _know(self, doors: DoorPlaces) -> list[Visit]:
        """Take these doors for those that are there; return the visits to others."""
        before = self._doors
        if before is not None and before.places is doors:
            return []
        self._doors = WatchedDoors(doors, self.model)
        if before is None:
            return []
        gone = self._doors.changed_since(before)
        return [v for robot in self._robots.values() for v in robot.leave(before, gone)]

    def _is_told(self, visit: Visit) -> bool:
        """Tell whether another laser of the robot told already that it drove through then."""
        if not visit.passed:
            return False
        key = (visit.robot, visit.door_id)
        last = self._passed.get(key)
        if last is not None and last.laser != visit.laser:
            apart_ns = max(visit.first_ns - last.last_ns, last.first_ns - visit.last_ns)
            if apart_ns <= ONE_PASSAGE_NS:
                return True
        self._passed[key] = visit
        return False

    def _robot(self, robot: str) -> RobotVisits:
        if robot not in self._robots:
            self._robots[robot] = RobotVisits(robot, self.model, self.dropped)
        return self._robots[robot]


def _sorted(visits: list[Visit]) -> list[Visit]:
    return sorted(visits, key=lambda visit: (visit.last_ns, visit.door_id, visit.passed))
