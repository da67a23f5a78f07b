"""Scans in, visits out: the entry point of this package.

It follows the visits of each robot, through all of its lasers, and counts how much of what a laser
sees the robot has not seen before.

A visit reports on a door with the errors of its place: of the pose, of the map, of what hides the
leaf, of glass. From the same stand all of these repeat in the next visit, and in a hundred more.
So the same state of a door is reported once from one stand; another state at once; and the same
again after `same_again_s`, since a door may have been opened and shut meanwhile.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from math import dist, inf, nan

import numpy as np

from semmap_log.analysis.scans.door_beams import sights_of
from semmap_log.analysis.scans.sight_sums import Passage, SightSums, Track, WatchedDoors
from semmap_log.analysis.scans.verdict import Verdict, behind_m
from semmap_log.analysis.scans.visit import (
    DEFAULT,
    DoorPlaces,
    PlacedScan,
    ScanModel,
    ScanStack,
    Visit,
    misfit,
)
from semmap_log.analysis.scans.visit_sums import SeenBy, VisitSums
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.moments import SECOND_NS

ONE_PASSAGE_NS = 5 * 10**9
"""Two lasers of a robot that cross a line within this time make one passage."""


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
    many at once are faster. A visit that only repeats what was reported from the same stand has
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
        return [visit for visit in _sorted(done) if not self._is_reported(visit)]

    def close(self) -> list[Visit]:
        """Return the unfinished visits, and end them."""
        if self._doors is None:
            return []
        return _sorted([v for robot in self._robots.values() for v in robot.end(self._doors)])

    def end(self, robot: str) -> list[Visit]:
        """Return the unfinished visits of one robot that is silent, and end them."""
        found = self._robots.get(robot)
        return [] if found is None or self._doors is None else _sorted(found.end(self._doors))

    def _know(self, doors: DoorPlaces) -> list[Visit]:
        """Replace the doors; return the visits to doors that changed."""
        before = self._doors
        if before is not None and before.places is doors:
            return []
        self._doors = WatchedDoors(doors, self.model)
        if before is None:
            return []
        gone = self._doors.changed_since(before)
        return [v for robot in self._robots.values() for v in robot.leave(before, gone)]

    def _is_reported(self, visit: Visit) -> bool:
        """Return whether another laser of the robot already reported this passage."""
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


AT_ONCE = 64
"""Scans that are processed together."""


class RobotVisits:
    """Takes the scans of a robot's lasers; those of each in the order of their stamps.

    A visit is one of the robot: what all its lasers see of a door goes into the same sums, with the
    same error of the pose, and what two of them see from one place counts once.
    """

    def __init__(self, robot: str, model: ScanModel, dropped: Counter[str]) -> None:
        self._robot, self._model, self._dropped = robot, model, dropped
        self._going: dict[int, VisitSums] = {}
        self._seen_ns: dict[int, int] = {}
        """When each door was last seen."""
        self._looked: dict[int, LookedAt] = {}
        """When each door was last looked at, by any laser."""
        self._motion = Motion()
        self._last_ns: int | None = None
        self._lasers: dict[str, _Laser] = {}
        self._stands = Stands(model)

    def take(self, scans: Iterable[PlacedScan], doors: WatchedDoors) -> list[Visit]:
        """Look at scans; return the visits that ended, and passages."""
        done: list[Visit] = []
        wait: list[PlacedScan] = []
        for scan in scans:
            laser = self._laser(scan.laser)
            why = misfit(scan) or self._misplaced(laser, scan.stamp_ns)
            if why:
                self._dropped[why] += 1
                continue
            if laser.last_ns is not None and scan.stamp_ns < laser.last_ns:
                done += [*self._look(wait, doors), *self.restart(doors)]
                wait, self._last_ns, laser = [], scan.stamp_ns, self._laser(scan.laser)
            laser.last_ns = scan.stamp_ns
            self._last_ns = max(scan.stamp_ns, self._last_ns or 0)
            wait.append(scan)
            if len(wait) == AT_ONCE:
                done += self._look(wait, doors)
                wait = []
        return done + self._look(wait, doors)

    def end(self, doors: WatchedDoors, ids: Iterable[int] | None = None) -> list[Visit]:
        """End the visits to these doors, or to all; return those that there were."""
        chosen = [i for i in (list(self._going) if ids is None else ids) if i in self._going]
        return [self._ended(door_id, doors) for door_id in chosen]

    def leave(self, doors: WatchedDoors, ids: Iterable[int]) -> list[Visit]:
        """End the visits to doors that have changed, and forget what was reported of them."""
        done = self.end(doors, ids)
        for door_id in ids:
            self._stands.forget(door_id)
        return done

    def restart(self, doors: WatchedDoors) -> list[Visit]:
        """End all visits, since a laser's clock went back far; return them."""
        done = self.end(doors)
        self._motion, self._stands = Motion(), Stands(self._model)
        self._lasers = {name: _Laser(self._model, self._motion, each.last_ns)
                        for name, each in self._lasers.items()}  # fmt: skip
        self._seen_ns.clear()
        self._looked.clear()
        return done

    def _laser(self, name: str) -> _Laser:
        if name not in self._lasers:
            self._lasers[name] = _Laser(self._model, self._motion)
        return self._lasers[name]

    def _misplaced(self, laser: _Laser, stamp_ns: int) -> str:
        """Return why a stamp does not follow the last one; empty: it does, or the clock was set."""
        pause_ns = self._model.pause_s * SECOND_NS
        if laser.last_ns is not None and stamp_ns <= laser.last_ns:
            if stamp_ns == laser.last_ns:
                return "its stamp is that of the scan before"
            if laser.last_ns - stamp_ns <= pause_ns:
                return "its stamp is before that of the scan before"
            return ""
        if self._last_ns is not None and self._last_ns - stamp_ns > pause_ns:
            return "its stamp is long before those of the robot's other lasers"
        return ""

    def _look(self, scans: Sequence[PlacedScan], doors: WatchedDoors) -> list[Visit]:
        if not scans:
            return []
        stack = ScanStack.of(scans, self._model)
        done: list[Visit] = []
        for name, rows in _rows_by_laser(scans).items():
            passages = self._laser(name).track.go(stack, rows, doors)
            done += [self._passed(name, passage, doors) for passage in passages]
        done += self._fold(stack, [self._view(scan) for scan in scans], doors)
        now_ns = int(stack.stamps_ns.max())
        return done + self.end(doors, [i for i in self._going if self._is_over(i, now_ns)])

    def _view(self, scan: PlacedScan) -> _View:
        """Return what a scan is worth, whatever doors it sees."""
        x, y = scan.origins[len(scan.origins) // 2].tolist()
        worth = self._laser(scan.laser).newness.of(scan.stamp_ns, (x, y))
        stand = self._stands.at(scan.laser, (x, y))
        return _View(scan.laser, worth, LookedAt(scan.stamp_ns, self._motion.looks), stand)

    def _fold(self, stack: ScanStack, views: Sequence[_View], doors: WatchedDoors) -> list[Visit]:
        """Take the sights of these scans into visits; return those that ended before."""
        scan, door = doors.grid.near(stack.levels, stack.places)
        new = np.array([view.worth > 0 for view in views])[scan]
        sights = sights_of(stack, doors.lines, (scan[new], door[new]), self._model)
        if not len(sights.beams.sight):
            return []
        sums = SightSums.of(sights, doors, self._model)
        done: list[Visit] = []
        for row in np.flatnonzero(sums.seen).tolist():
            at = int(sights.door[row])
            door_id, stamp_ns = int(doors.ids[at]), int(stack.stamps_ns[sights.scan[row]])
            if door_id in self._going and self._is_over(door_id, stamp_ns):
                done.append(self._ended(door_id, doors))
            if door_id not in self._going:
                self._going[door_id] = VisitSums.begun(stamp_ns, doors.leaves[at])
            view = views[int(sights.scan[row])]
            scan_seen = SeenBy(stamp_ns, view.laser, self._worth(door_id, view), view.stand)
            self._going[door_id].add(scan_seen, sums, sights, row)
            self._seen_ns[door_id] = max(stamp_ns, self._seen_ns.get(door_id, 0))
            self._looked[door_id] = view.at
        return done

    def _worth(self, door_id: int, view: _View) -> float:
        """Return a scan's share of a new look at a door."""
        if self._was_away(door_id, view.at.stamp_ns):
            return 1.0
        return min(view.worth, self._looked[door_id].not_seen_since(view.at, self._model))

    def _was_away(self, door_id: int, now_ns: int) -> bool:
        """Return whether the door was out of sight, so that its next sighting is new."""
        seen_ns = self._seen_ns.get(door_id)
        return seen_ns is None or now_ns - seen_ns > self._model.pause_s * SECOND_NS

    def _is_over(self, door_id: int, now_ns: int) -> bool:
        long_ns = now_ns - self._going[door_id].first_ns
        return self._was_away(door_id, now_ns) or long_ns > self._model.longest_s * SECOND_NS

    def _ended(self, door_id: int, doors: WatchedDoors) -> Visit:
        """End a visit; return its result."""
        sums, at = self._going.pop(door_id), doors.row_of[door_id]
        leaves = doors.leaves[at]
        verdict = Verdict.of(sums, leaves, self._model, is_glass=bool(doors.glass[at]))
        told_ns = self._stands.told_ns(door_id, verdict.state, sums)
        if not told_ns and not verdict.why:
            self._stands.tell(door_id, verdict.state, sums)
        return Visit(
            door_id=DoorId(door_id),
            first_ns=sums.first_ns,
            last_ns=sums.last_ns,
            scans=sums.scans,
            state=verdict.state,
            accuracy=max(verdict.p_open, 1 - verdict.p_open),
            opening=verdict.opening,
            ajar=verdict.ajar,
            looks=sums.looks,
            through=float(sums.through[0]),
            stopped=float(sums.stopped[0]),
            behind_m=behind_m(sums),
            near=sums.near,
            p_open=verdict.p_open,
            leaves=leaves.on_map(verdict.likeliest, doors.lines[at]),
            why=verdict.why,
            laser=sums.laser,
            robot=self._robot,
            side=sum(sums.sides),
            told_ns=told_ns,
        )

    def _passed(self, laser: str, passage: Passage, doors: WatchedDoors) -> Visit:
        """Return a visit in which the robot drove through."""
        return Visit(
            door_id=DoorId(int(doors.ids[passage.door])),
            first_ns=passage.first_ns,
            last_ns=passage.last_ns,
            scans=passage.scans,
            state=DoorState.OPEN,
            accuracy=self._model.passed_accuracy,
            opening=1.0,
            ajar=0.0,
            looks=0.0,
            through=0.0,
            stopped=0.0,
            behind_m=nan,
            passed=True,
            p_open=self._model.passed_accuracy,
            laser=laser,
            robot=self._robot,
        )


class _Laser:
    """One of the robot's lasers."""

    def __init__(self, model: ScanModel, motion: Motion, last_ns: int | None = None) -> None:
        self.track = Track()
        self.newness = Newness(model, motion)
        self.last_ns = last_ns
        """Stamp of its last scan."""


@dataclass(frozen=True, slots=True)
class _View:
    """A scan, whatever doors it sees."""

    laser: str
    worth: float
    """Of a new look; 0: it waits for the next one."""
    at: LookedAt
    stand: int


def _rows_by_laser(scans: Sequence[PlacedScan]) -> dict[str, list[int]]:
    found: dict[str, list[int]] = {}
    for row, scan in enumerate(scans):
        found.setdefault(scan.laser, []).append(row)
    return found


@dataclass(frozen=True, slots=True)
class _Told:
    state: DoorState
    at_ns: int
    stand: int


@dataclass(slots=True)
class Stands:
    """Where the lasers of one robot stand, and what was reported from there."""

    model: ScanModel
    number: int = 0
    """Of the stand; the next one after it left."""
    _from: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Laser -> where it was first in this stand."""
    _told: dict[int, _Told] = field(default_factory=dict)
    """Door -> the last report of it."""

    def at(self, laser: str, place: tuple[float, float]) -> int:
        """Take in where a laser is; return the number of the stand."""
        if dist(place, self._from.setdefault(laser, place)) > self.model.stand:
            self.number += 1
            self._from = {laser: place}
        return self.number

    def told_ns(self, door_id: int, state: DoorState, sums: VisitSums) -> int:
        """Return when a visit's state was last reported from the same stand; 0: it is new."""
        told = self._told.get(door_id)
        if told is None or (told.state, {told.stand}) != (state, sums.stands):
            return 0
        since_ns = sums.last_ns - told.at_ns
        return told.at_ns if 0 <= since_ns < self.model.same_again_s * SECOND_NS else 0

    def tell(self, door_id: int, state: DoorState, sums: VisitSums) -> None:
        """Record that a visit's state is reported."""
        self._told[door_id] = _Told(state, sums.last_ns, max(sums.stands))

    def forget(self, door_id: int) -> None:
        """Forget what was reported of a door that has changed."""
        self._told.pop(door_id, None)


@dataclass(slots=True)
class Motion:
    """How many new looks there were to be had, since its lasers went so far: of one robot."""

    looks: float = 0.0

    def went(self, before: float, looks: float) -> None:
        """Take in that a laser went so far since there were `before`; others went with it."""
        self.looks = max(self.looks, before + looks)


class Newness:
    """How much of a new look each scan of a laser is: who parks proves nothing more by parking.

    Nor by a localisation that puts it a centimetre elsewhere at each scan: what counts is how far
    it came from where it was, not how long the way was.
    """

    def __init__(self, model: ScanModel, motion: Motion) -> None:
        self._model, self._motion = model, motion
        self._last_ns: int | None = None
        self._from, self._from_looks = (0.0, 0.0), 0.0
        """Where it was when it last was somewhere else, and how far the robot was then."""
        self._fresh = inf
        self._looked_ns = 0

    def of(self, stamp_ns: int, place: tuple[float, float]) -> float:
        """Return what share of a new look the next scan is; 0: it waits for the next one."""
        self._go(stamp_ns, place)
        is_old = stamp_ns - self._looked_ns >= self._model.least_often_s * SECOND_NS
        if self._fresh < self._model.least_fresh and not is_old:
            return 0.0
        worth = min(self._fresh, 1.0)
        self._fresh, self._looked_ns = 0.0, stamp_ns
        return worth

    def _go(self, stamp_ns: int, place: tuple[float, float]) -> None:
        """Take in when and where the next scan was made."""
        if self._last_ns is None:
            self._from, self._from_looks = place, self._motion.looks
        else:
            self._fresh += waited_looks(stamp_ns - self._last_ns, self._model)
            moved = dist(place, self._from) / self._model.step
            if moved >= self._model.least_fresh:
                self._fresh += moved
                self._motion.went(self._from_looks, moved)
                self._from, self._from_looks = place, self._motion.looks
        self._last_ns = stamp_ns


@dataclass(frozen=True, slots=True)
class LookedAt:
    """When a robot looked at a door last, and how far it was."""

    stamp_ns: int
    looks: float
    """See `Motion`."""

    def not_seen_since(self, now: LookedAt, model: ScanModel) -> float:
        """Return how many new looks there are since, by whichever laser.

        What one has looked at, another that looks from there, too, sees with the same errors: two
        lasers, or a scan and its filtered copy, prove no more than one.
        """
        waited = waited_looks(max(now.stamp_ns - self.stamp_ns, 0), model)
        return max(now.looks - self.looks + waited, 0.0)


def waited_looks(waited_ns: int, model: ScanModel) -> float:
    """Return how many new looks a robot gets that stands for so long."""
    return waited_ns / SECOND_NS / model.still_s
