"""The visits of one laser of one robot."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from math import inf, nan

import numpy as np
from numpy.typing import NDArray

from semmap_log.domain.doors import DoorId, DoorState
from semmap_log.scans.door_beams import Sights, sights_of
from semmap_log.scans.evidence import Evidence
from semmap_log.scans.known_doors import KnownDoors
from semmap_log.scans.likelihood import log_likelihoods
from semmap_log.scans.passages import Track
from semmap_log.scans.placed_scan import PlacedScan
from semmap_log.scans.scan_model import ScanModel
from semmap_log.scans.scan_stack import ScanStack, misfit
from semmap_log.scans.visit import Visit

AT_ONCE = 32
"""Scans whose beams are worked on together: what the processor's cache holds."""
SECOND_NS = 1_000_000_000


class LaserVisits:
    """Takes the scans of one laser in the order of their stamps."""

    def __init__(self, robot: str, laser: str, model: ScanModel, dropped: Counter[str]) -> None:
        self._robot, self._laser, self._model, self._dropped = robot, laser, model, dropped
        self._open: dict[int, Evidence] = {}
        self._track = Track()
        self._last: tuple[int, float, float] | None = None
        self._fresh = inf

    def take(self, scans: Sequence[PlacedScan], doors: KnownDoors) -> list[Visit]:
        done: list[Visit] = []
        good = []
        for scan in scans:
            why = misfit(scan) or self._out_of_order(scan, good)
            if why:
                self._dropped[why] += 1
            else:
                good.append(scan)
        for begin in range(0, len(good), AT_ONCE):
            done += self._take(ScanStack.of(good[begin : begin + AT_ONCE], self._model), doors)
        return done

    def _out_of_order(self, scan, good) -> str:
        last = good[-1].stamp_ns if good else self._last[0] if self._last else None
        if last is None or scan.stamp_ns > last:
            return ""
        return (
            "its stamp is that of the scan before"
            if scan.stamp_ns == last
            else "its stamp is before the last one"
        )

    def end(self, doors: KnownDoors, ids: Sequence[int] | None = None) -> list[Visit]:
        chosen = list(self._open) if ids is None else [i for i in ids if i in self._open]
        return [self._judged(i, doors) for i in chosen]

    def _judged(self, door_id: int, doors: KnownDoors) -> Visit:
        evidence = self._open.pop(door_id)
        return evidence.judged(
            DoorId(door_id),
            doors.leaves[doors.row_of[door_id]],
            self._model,
            robot=self._robot,
            laser=self._laser,
        )

    def _take(self, stack: ScanStack, doors: KnownDoors) -> list[Visit]:
        done = self._passed(stack, doors)
        fresh = self._freshness(stack)
        at, door = doors.grid.near(stack.levels, stack.places)
        worth = fresh[at] > 0
        sights = sights_of(stack, doors.lines, (at[worth], door[worth]), self._model)
        done += self._fold(stack, sights, fresh, doors)
        now = int(stack.stamps_ns[-1])
        over = [i for i, e in self._open.items() if self._is_over(e, now)]
        return done + self.end(doors, over)

    def _is_over(self, evidence: Evidence, now_ns: int) -> bool:
        return (
            now_ns - evidence.last_ns > self._model.pause_s * SECOND_NS
            or now_ns - evidence.first_ns > self._model.longest_s * SECOND_NS
        )

    def _freshness(self, stack: ScanStack) -> NDArray[np.float64]:
        """Return (t,) what share of a new look each scan is; 0: it waits for the next one."""
        worth = np.zeros(len(stack.stamps_ns))
        for i, (stamp, (x, y)) in enumerate(
            zip(stack.stamps_ns.tolist(), stack.places.tolist(), strict=True)
        ):
            if self._last is not None:
                moved = float(np.hypot(x - self._last[1], y - self._last[2]))
                self._fresh += (
                    moved / self._model.step
                    + (stamp - self._last[0]) / SECOND_NS / self._model.still_s
                )
            if self._fresh >= self._model.least_fresh:
                worth[i] = min(self._fresh, 1.0)
                self._fresh = 0.0
            self._last = (stamp, x, y)
        return worth

    def _fold(self, stack: ScanStack, sights: Sights, fresh, doors: KnownDoors) -> list[Visit]:
        done = []
        beams, model = sights.beams, self._model
        if not len(beams.pair):
            return done
        pairs = len(sights.scan)
        used = np.bincount(beams.pair, minlength=pairs)
        asked = np.minimum(sights.number, model.beams)
        width = doors.lines[sights.door, 3]
        most = np.minimum(np.minimum(sights.number, width / model.cell), model.most_looks_a_scan)
        behind = (beams.range - beams.plane) * np.abs(beams.uy)
        back = np.isfinite(beams.range)
        through = np.bincount(
            beams.pair[back & (beams.range > beams.plane + model.tolerance)], minlength=pairs
        )
        on = back & (np.abs(beams.range - beams.plane) <= model.tolerance)
        stopped = np.bincount(beams.pair[on], minlength=pairs)
        depth = np.bincount(beams.pair[on], behind[on], minlength=pairs)
        tables = self._tables(sights, doors)
        for p in np.flatnonzero(used).tolist():
            door_id, stamp = int(doors.ids[sights.door[p]]), int(stack.stamps_ns[sights.scan[p]])
            known = self._open.get(door_id)
            if known is not None and (
                stamp - known.last_ns > model.pause_s * SECOND_NS
                or stamp - known.first_ns > model.longest_s * SECOND_NS
            ):
                done.append(self._judged(door_id, doors))
                known = None
            weight = most[p] / asked[p] * (1.0 if known is None else fresh[sights.scan[p]])
            if known is None:
                known = self._open[door_id] = Evidence(
                    first_ns=stamp, last_ns=stamp, table=np.zeros(tables[p].shape)
                )
            known.last_ns = stamp
            known.scans += 1
            known.table += weight * tables[p]
            known.looks += weight * used[p]
            known.through += weight * through[p]
            known.stopped += weight * stopped[p]
            known.behind += weight * depth[p]
        return done

    def _tables(self, sights: Sights, doors: KnownDoors) -> dict[int, NDArray[np.float32]]:
        """Return of each sight the sum (s, h) of its beams' log-likelihoods."""
        beams = sights.beams
        glass = np.where(doors.glass, self._model.through_glass, self._model.through_leaf)
        starts = np.flatnonzero(np.diff(beams.pair, prepend=-1))
        found = {}
        kinds = doors.kind[sights.door[beams.pair]]
        for kind in np.unique(kinds):
            chosen = kinds == kind
            part = beams.only(chosen)
            starts = np.flatnonzero(np.diff(part.pair, prepend=-1))
            table = log_likelihoods(
                part, doors.kinds[kind], glass[sights.door[part.pair]], self._model
            )
            sums = np.add.reduceat(table, starts, axis=0)
            found |= dict(zip(part.pair[starts].tolist(), sums, strict=True))
        return found

    def _passed(self, stack: ScanStack, doors: KnownDoors) -> list[Visit]:
        passages = self._track.go(
            stack.stamps_ns, stack.places, stack.levels, doors.grid, doors.lines
        )
        return [
            Visit(
                door_id=DoorId(int(doors.ids[p.door])),
                first_ns=p.first_ns,
                last_ns=p.last_ns,
                scans=0,
                state=DoorState.OPEN,
                accuracy=0.999,
                opening=1.0,
                ajar=0.0,
                looks=0.0,
                through=0.0,
                stopped=0.0,
                behind_m=nan,
                passed=True,
                p_open=0.999,
                laser=self._laser,
                robot=self._robot,
            )
            for p in passages
        ]
