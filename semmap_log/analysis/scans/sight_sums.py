"""What each sight of a door adds to its visit, and which doors the robot drove through.

The robot's own track is the proof of a passage. `WatchedDoors` are the doors of a moment, prepared
for the scans.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import cos, hypot, sin

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.beam_model import log_likelihoods, log_ratios, wall_log_likelihoods
from semmap_log.analysis.scans.door_beams import DoorBeams, DoorGrid, Sights
from semmap_log.analysis.scans.leaves import Leaves, leaves_of, shifted_planes
from semmap_log.analysis.scans.visit import DoorPlaces, ScanModel, ScanStack
from semmap_log.core.model.moments import SECOND_NS

Floats = NDArray[np.float64]
Rows = NDArray[np.intp]

AT_ONCE = 96
"""Beams whose tables are made together: what a processor's cache holds."""


@dataclass(frozen=True, slots=True, eq=False)
class SightSums:
    """Sums over the beams of each of `p` sights, as if each beam were a look."""

    seen: Floats
    """(p,) beams that came back from the line, or from beyond it; 0 where they are too few."""
    through: Floats
    """(p, s) beams that went through the line, were the laser shifted."""
    stopped: Floats
    """(p, s) beams that ended on it."""
    deep: Floats
    """(p, s) beams that ended far beyond it."""
    near: Floats
    """(p,) beams that ended near the line, the laser where it is believed to be."""
    behind: Floats
    """(p,) sum over these: how far beyond it, m."""
    left: Floats
    """(p,) beams that began to the left of the line."""
    tables: dict[int, NDArray[np.float32]]
    """Of a sight with beams (s, h): the sum of their log-likelihoods."""
    over: dict[int, NDArray[np.float32]]
    """The same of the log-ratios of those next to the door that cross its leaf."""
    walls: Floats
    """(p, s + 1): the same of the beams next to the door."""
    beside: Floats
    """(p,) beams next to the door."""

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


SIDE_M = 0.35
"""The track must come from so far on one side of the line and go on to so far on the other."""
MIDDLE = 0.1
"""The line is crossed within its width less this share at both ends."""
HOP_M, GAP_S = 1.5, 5.0
"""Between two scans: a robot that is farther than that, or later, may have been put elsewhere."""
SLACK_M, FASTEST = 0.15, 2.0
"""The largest correction by localisation, m; and the top speed of a robot beyond it, m/s."""
SPACING_M = 0.02
"""Places of a track are so far apart at least: a robot that stands has one."""
PLACES = 512
"""Of a track are kept."""

Line = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Passage:
    """A robot drove through a door: which row of the doors, and from when to when."""

    door: int
    first_ns: int
    last_ns: int
    scans: int


@dataclass(frozen=True, slots=True)
class _Place:
    stamp_ns: int
    x: float
    y: float
    level: int
    number: int
    """Of the scan, counted from the track's first one."""


@dataclass(frozen=True, slots=True)
class _Crossing:
    """The line was crossed; whether the robot goes on is not known yet."""

    door_id: int
    line: Line
    begin: _Place
    to_left: bool


class Track:
    """Where one laser went since it was last put somewhere else."""

    def __init__(self) -> None:
        self._places: deque[_Place] = deque(maxlen=PLACES)
        self._crossings: list[_Crossing] = []
        self._last: _Place | None = None

    def go(self, stack: ScanStack, rows: Sequence[int], doors: WatchedDoors) -> list[Passage]:
        """Follow the laser through its scans; return the doors that it has driven through now.

        Args:
            stack: Scans.
            rows: Which of them are its own, ascending.
            doors: As they are.
        """
        near = _doors_near(stack, doors)
        found: list[Passage] = []
        for i in rows:
            x, y = stack.places[i].tolist()
            before = self._last
            number = 0 if before is None else before.number + 1
            now = _Place(int(stack.stamps_ns[i]), x, y, int(stack.levels[i]), number)
            if before is not None and not _is_driven(before, now):
                self.forget()
                before = None
            if before is not None:
                for door in near.get(i, ()):
                    self._cross(int(doors.ids[door]), _line(doors, door), before, now)
            found += self._went_on(now, doors)
            self._keep(now)
        return found

    def forget(self) -> None:
        """Begin again: nothing connects later scans with earlier ones."""
        self._places.clear()
        self._crossings.clear()
        self._last = None

    def _keep(self, now: _Place) -> None:
        self._last = now
        latest = self._places[-1] if self._places else None
        if latest is None or hypot(now.x - latest.x, now.y - latest.y) >= SPACING_M:
            self._places.append(now)

    def _went_on(self, now: _Place, doors: WatchedDoors) -> list[Passage]:
        """Return the passages that end here; drop the crossings that were taken back."""
        passed, still = [], []
        for crossing in self._crossings:
            door = doors.row_of.get(crossing.door_id)
            if door is None or _line(doors, door) != crossing.line:
                continue
            off = _off(crossing.line, now)
            ahead = off if crossing.to_left else -off
            if ahead >= SIDE_M:
                begin = crossing.begin
                scans = now.number - begin.number + 1
                passed.append(Passage(door, begin.stamp_ns, now.stamp_ns, scans))
            elif ahead > -SIDE_M:
                still.append(crossing)
        self._crossings = still
        return passed

    def _cross(self, door_id: int, line: Line, before: _Place, now: _Place) -> None:
        """Note that the line was crossed, if it was, coming from one side."""
        was_off, off = _off(line, before), _off(line, now)
        if (off > 0) == (was_off > 0) or any(c.door_id == door_id for c in self._crossings):
            return
        was_along, along = _along(line, before), _along(line, now)
        at = was_along + (along - was_along) * was_off / (was_off - off)
        if not MIDDLE * line[3] < at < (1 - MIDDLE) * line[3]:
            return
        begin = self._came_from(line, is_left=off <= 0)
        if begin is not None:
            self._crossings.append(_Crossing(door_id, line, begin, off > 0))

    def _came_from(self, line: Line, *, is_left: bool) -> _Place | None:
        """Return the last place well on that side of the line, if none was on the other since."""
        for place in reversed(self._places):
            off = _off(line, place) if is_left else -_off(line, place)
            if off >= SIDE_M:
                return place
            if off <= -SIDE_M:
                return None
        return None


def _doors_near(stack: ScanStack, doors: WatchedDoors) -> dict[int, list[int]]:
    """Return the doors that each scan's last step may have crossed, by their rows."""
    scan, door = doors.grid.near(stack.levels, stack.places)
    apart = np.hypot(*(stack.places[scan] - doors.grid.middles[door]).T)
    close = apart < HOP_M + doors.lines[door, 3] / 2
    near: dict[int, list[int]] = defaultdict(list)
    for i, row in zip(scan[close].tolist(), door[close].tolist(), strict=True):
        near[i].append(row)
    return near


def _is_driven(before: _Place, now: _Place) -> bool:
    """Return whether a robot can have driven from one place to the other."""
    waited_s = (now.stamp_ns - before.stamp_ns) / SECOND_NS
    hop = hypot(now.x - before.x, now.y - before.y)
    farthest = min(HOP_M, SLACK_M + FASTEST * waited_s)
    return now.level == before.level and 0 < waited_s <= GAP_S and hop <= farthest


def _line(doors: WatchedDoors, row: int) -> Line:
    x, y, theta, width = doors.lines[row].tolist()
    return x, y, theta, width


def _along(line: Line, place: _Place) -> float:
    """Return how far along the line a place is, m."""
    return cos(line[2]) * (place.x - line[0]) + sin(line[2]) * (place.y - line[1])


def _off(line: Line, place: _Place) -> float:
    """Return how far left of the line a place is, m."""
    return cos(line[2]) * (place.y - line[1]) - sin(line[2]) * (place.x - line[0])


class WatchedDoors:
    """Doors by place, by id and by kind."""

    def __init__(self, doors: DoorPlaces, model: ScanModel) -> None:
        self.places = doors
        self.ids, self.lines, self.glass = doors.ids, doors.lines, doors.glass
        self.grid = DoorGrid(doors, reach=model.reach)
        self.leaves = [leaves_of(kind) for kind in doors.kinds]
        self.kinds: list[Leaves] = list({id(leaves): leaves for leaves in self.leaves}.values())
        number = {id(leaves): i for i, leaves in enumerate(self.kinds)}
        self.kind = np.array([number[id(leaves)] for leaves in self.leaves], np.intp)
        self.row_of = {door_id: row for row, door_id in enumerate(doors.ids.tolist())}

    def changed_since(self, before: WatchedDoors) -> list[int]:
        """Return the ids of those doors of `before` that are gone or otherwise now."""
        return [
            door_id
            for door_id, row in before.row_of.items()
            if (now := self.row_of.get(door_id)) is None or self._says(now) != before._says(row)
        ]

    def _says(self, row: int) -> tuple[object, ...]:
        """Return all that a visit to the door rests on."""
        places = self.places
        line = tuple(places.lines[row].tolist())
        return int(places.levels[row]), line, places.kinds[row], bool(places.glass[row])
