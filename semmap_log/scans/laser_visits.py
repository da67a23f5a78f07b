"""The visits of one laser of one robot."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from math import dist, inf, nan

import numpy as np
from numpy.typing import NDArray

from semmap_log.domain.doors import DoorId, DoorState
from semmap_log.domain.moments import SECOND_NS
from semmap_log.scans.door_beams import sights_of
from semmap_log.scans.passages import Passage, Track
from semmap_log.scans.placed_scan import PlacedScan
from semmap_log.scans.scan_model import ScanModel
from semmap_log.scans.scan_stack import ScanStack, misfit
from semmap_log.scans.sight_sums import SightSums
from semmap_log.scans.verdict import Verdict, behind_m
from semmap_log.scans.visit import Visit
from semmap_log.scans.visit_sums import VisitSums
from semmap_log.scans.watched_doors import WatchedDoors

AT_ONCE = 64
"""Scans that are worked on together."""


class LaserVisits:
    """Takes the scans of one laser in the order of their stamps."""

    def __init__(self, robot: str, laser: str, model: ScanModel, dropped: Counter[str]) -> None:
        self._robot, self._laser, self._model, self._dropped = robot, laser, model, dropped
        self._going: dict[int, VisitSums] = {}
        self._seen_ns: dict[int, int] = {}
        """When each door was last seen."""
        self._track = Track()
        self._last_ns: int | None = None
        self._newness = _Newness(model)

    def take(self, scans: Iterable[PlacedScan], doors: WatchedDoors) -> list[Visit]:
        """Look at scans; return the visits that ended, and passages."""
        done: list[Visit] = []
        wait: list[PlacedScan] = []
        for scan in scans:
            why = misfit(scan) or self._misplaced(scan.stamp_ns)
            if why:
                self._dropped[why] += 1
                continue
            if self._last_ns is not None and scan.stamp_ns < self._last_ns:
                done += [*self._look(wait, doors), *self.restart(doors)]
                wait = []
            self._last_ns = scan.stamp_ns
            wait.append(scan)
            if len(wait) == AT_ONCE:
                done += self._look(wait, doors)
                wait = []
        return done + self._look(wait, doors)

    def end(self, doors: WatchedDoors, ids: Iterable[int] | None = None) -> list[Visit]:
        """End the visits to these doors, or to all; return those that there were."""
        chosen = [i for i in (list(self._going) if ids is None else ids) if i in self._going]
        return [self._ended(door_id, doors) for door_id in chosen]

    def restart(self, doors: WatchedDoors) -> list[Visit]:
        """End all visits, since the laser's clock went back far; return them."""
        self._track.forget()
        self._newness = _Newness(self._model)
        self._seen_ns.clear()
        return self.end(doors)

    def _misplaced(self, stamp_ns: int) -> str:
        """Return why a stamp does not follow the last one; empty: it does, or the clock was set."""
        if self._last_ns is None or stamp_ns > self._last_ns:
            return ""
        if stamp_ns == self._last_ns:
            return "its stamp is that of the scan before"
        is_late = self._last_ns - stamp_ns <= self._model.pause_s * SECOND_NS
        return "its stamp is before that of the scan before" if is_late else ""

    def _look(self, scans: Sequence[PlacedScan], doors: WatchedDoors) -> list[Visit]:
        if not scans:
            return []
        stack = ScanStack.of(scans, self._model)
        passages = self._track.go(stack, doors)
        done = [self._passed(passage, doors) for passage in passages]
        done += self._fold(stack, self._newness.of(stack), doors)
        now_ns = int(stack.stamps_ns[-1])
        return done + self.end(doors, [i for i in self._going if self._is_over(i, now_ns)])

    def _fold(
        self, stack: ScanStack, fresh: NDArray[np.float64], doors: WatchedDoors
    ) -> list[Visit]:
        """Take the sights of these scans into visits; return those that ended before."""
        scan, door = doors.grid.near(stack.levels, stack.places)
        new = fresh[scan] > 0
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
            worth = 1.0 if self._was_away(door_id, stamp_ns) else float(fresh[sights.scan[row]])
            self._going[door_id].add(stamp_ns, sums, sights, row, worth)
            self._seen_ns[door_id] = stamp_ns
        return done

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
            laser=self._laser,
            robot=self._robot,
            side=sum(sums.sides),
        )

    def _passed(self, passage: Passage, doors: WatchedDoors) -> Visit:
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
            laser=self._laser,
            robot=self._robot,
        )


class _Newness:
    """How much of a new look each scan is: a robot that parks proves nothing more by parking.

    Nor by a localisation that puts it a centimetre elsewhere at each scan: what counts is how far
    it came from where it was, not how long the way was.
    """

    def __init__(self, model: ScanModel) -> None:
        self._model = model
        self._last_ns: int | None = None
        self._from = (0.0, 0.0)
        """Where it was when it last was somewhere else."""
        self._fresh = inf
        self._looked_ns = 0

    def of(self, stack: ScanStack) -> NDArray[np.float64]:
        """Return (t,) what share of a new look each scan is; 0: it waits for the next one."""
        worth = np.zeros(len(stack.stamps_ns))
        for i, stamp_ns in enumerate(stack.stamps_ns.tolist()):
            self._go(stamp_ns, tuple(stack.places[i].tolist()))
            is_old = stamp_ns - self._looked_ns >= self._model.least_often_s * SECOND_NS
            if self._fresh >= self._model.least_fresh or is_old:
                worth[i] = min(self._fresh, 1.0)
                self._fresh, self._looked_ns = 0.0, stamp_ns
        return worth

    def _go(self, stamp_ns: int, place: tuple[float, float]) -> None:
        """Take in when and where the next scan was made."""
        if self._last_ns is None:
            self._from = place
        else:
            self._fresh += (stamp_ns - self._last_ns) / SECOND_NS / self._model.still_s
            moved = dist(place, self._from) / self._model.step
            if moved >= self._model.least_fresh:
                self._fresh += moved
                self._from = place
        self._last_ns = stamp_ns
