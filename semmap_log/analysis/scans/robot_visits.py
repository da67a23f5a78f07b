"""The visits of one robot, through all of its lasers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

from semmap_log.analysis.scans.door_beams import sights_of
from semmap_log.analysis.scans.newness import LookedAt, Motion, Newness
from semmap_log.analysis.scans.passages import Passage, Track
from semmap_log.analysis.scans.placed_scan import PlacedScan
from semmap_log.analysis.scans.scan_model import ScanModel
from semmap_log.analysis.scans.scan_stack import ScanStack, misfit
from semmap_log.analysis.scans.sight_sums import SightSums
from semmap_log.analysis.scans.stands import Stands
from semmap_log.analysis.scans.verdict import Verdict, behind_m
from semmap_log.analysis.scans.visit import Visit
from semmap_log.analysis.scans.visit_sums import SeenBy, VisitSums
from semmap_log.analysis.scans.watched_doors import WatchedDoors
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.moments import SECOND_NS

AT_ONCE = 64
"""Scans that are worked on together."""


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
        """End the visits to doors that are otherwise now, and forget what was told of them."""
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
        """Return how much of a new look at a door a scan is."""
        if self._was_away(door_id, view.at.stamp_ns):
            return 1.0
        return min(view.worth, self._looked[door_id].not_seen_since(view.at, self._model))

    def _was_away(self, door_id: int, now_ns: int) -> bool:
        """Return whether the door was out of sight: what is seen of it now is new."""
        seen_ns = self._seen_ns.get(door_id)
        return seen_ns is None or now_ns - seen_ns > self._model.pause_s * SECOND_NS

    def _is_over(self, door_id: int, now_ns: int) -> bool:
        long_ns = now_ns - self._going[door_id].first_ns
        return self._was_away(door_id, now_ns) or long_ns > self._model.longest_s * SECOND_NS

    def _ended(self, door_id: int, doors: WatchedDoors) -> Visit:
        """End a visit; return what it says."""
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
        """Return that the robot drove through."""
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
