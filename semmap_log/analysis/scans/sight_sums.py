"""What each sight of a door adds to its visit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.beam_model import log_likelihoods, log_ratios, wall_log_likelihoods
from semmap_log.analysis.scans.door_beams import DoorBeams, Sights
from semmap_log.analysis.scans.leaves import Leaves
from semmap_log.analysis.scans.scan_model import ScanModel
from semmap_log.analysis.scans.shifts import shifted_planes
from semmap_log.analysis.scans.watched_doors import WatchedDoors

Floats = NDArray[np.float64]
Rows = NDArray[np.intp]

AT_ONCE = 96
"""Beams whose tables are made together: what a processor's cache holds."""


@dataclass(frozen=True, slots=True, eq=False)
class SightSums:
    """Sums over the beams of each of `p` sights, as if each beam were a look."""

    seen: Floats
    """(p,) beams that came back from the line, or from behind it; 0 where they are too few."""
    through: Floats
    """(p, s) beams that went through the line, were the laser shifted."""
    stopped: Floats
    """(p, s) beams that ended on it."""
    deep: Floats
    """(p, s) beams that ended far behind it."""
    near: Floats
    """(p,) beams that ended near the line, the laser where it is believed to be."""
    behind: Floats
    """(p,) sum over these: how far behind it, m."""
    left: Floats
    """(p,) beams that began to the left of the line."""
    tables: dict[int, NDArray[np.float32]]
    """Of a sight with beams (s, h): the sum of their log-likelihoods."""
    over: dict[int, NDArray[np.float32]]
    """The same of the log-ratios of those beside the door that come over its leaf."""
    walls: Floats
    """(p, s + 1): the same of the beams beside the door."""
    beside: Floats
    """(p,) beams beside the door."""

    @classmethod
    def of(cls, sights: Sights, doors: WatchedDoors, model: ScanModel) -> SightSums:
        """Return the sums of all sights."""
        beams, count = sights.beams, len(sights.scan)
        back = beams.came_back
        ended = np.where(back, beams.range, -np.inf)
        past = ended[:, None] - shifted_planes(beams)
        near = back & (np.abs(np.where(back, beams.behind, np.inf)) <= model.deep)
        walls = wall_log_likelihoods(sights.beside, model)
        seen = np.bincount(beams.sight[back & beams.reaches], minlength=count).astype(float)
        return cls(
            seen=np.where(seen >= model.least_seen * (seen + sights.hidden), seen, 0),
            through=_by_sight(past > model.tolerance, beams.sight, count),
            stopped=_by_sight(np.abs(past) <= model.tolerance, beams.sight, count),
            deep=_by_sight(past * np.abs(beams.uy)[:, None] > model.deep, beams.sight, count),
            near=np.bincount(beams.sight[near], minlength=count).astype(float),
            behind=np.bincount(beams.sight[near], beams.behind[near], count).astype(float),
            left=np.bincount(beams.sight[beams.y > 0], minlength=count).astype(float),
            tables=_tables(log_likelihoods, sights.beams, sights.door, doors, model),
            over=_tables(log_ratios, sights.over, sights.door, doors, model),
            walls=_by_sight(walls, sights.beside.sight, count),
            beside=np.bincount(sights.beside.sight, minlength=count).astype(float),
        )


def _tables(
    of_beams: Callable[[DoorBeams, Leaves, Floats, ScanModel], NDArray[np.float32]],
    all_beams: DoorBeams, door_of: Rows, doors: WatchedDoors, model: ScanModel,
) -> dict[int, NDArray[np.float32]]:  # fmt: skip
    """Return of each sight the sum (s, h) of what its beams say, by its door's kind."""
    glass = np.where(doors.glass, model.through_glass, model.through_leaf)
    door = door_of[all_beams.sight]
    kinds = doors.kind[door]
    found: dict[int, NDArray[np.float32]] = {}
    for kind in np.unique(kinds).tolist():
        chosen = np.flatnonzero(kinds == kind)
        for rows in _blocks(all_beams.sight[chosen]):
            beams = all_beams.only(chosen[rows])
            through = glass[door[chosen[rows]]]
            table = of_beams(beams, doors.kinds[kind], through, model)
            starts = _starts(beams.sight)
            sums = np.add.reduceat(table, starts, axis=0)
            found |= dict(zip(beams.sight[starts].tolist(), sums, strict=True))
    return found


def _blocks(sight: Rows) -> Iterator[slice]:
    """Yield slices of whole sights, of about `AT_ONCE` beams each."""
    starts = _starts(sight)
    block = starts // AT_ONCE
    ends = [*starts[_starts(block)].tolist(), len(sight)]
    for start, end in pairwise(ends):
        yield slice(start, end)


def _by_sight(values: NDArray[np.generic], sight: Rows, count: int) -> Floats:
    """Return (count, k) the sums of rows (m, k) by sight."""
    found = np.zeros((count, values.shape[1]))
    if len(sight):
        starts = _starts(sight)
        found[sight[starts]] = np.add.reduceat(values.astype(np.float64), starts, axis=0)
    return found


def _starts(sight: Rows) -> Rows:
    return np.flatnonzero(np.diff(sight, prepend=-1))
