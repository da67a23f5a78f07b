"""Doors that the robot drove through: its own track is the proof."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, hypot, sin

import numpy as np

from semmap_log.analysis.scans.scan_stack import ScanStack
from semmap_log.analysis.scans.watched_doors import WatchedDoors
from semmap_log.core.model.moments import SECOND_NS

SIDE_M = 0.35
"""The track must come from so far on one side of the line and go on to so far on the other."""
MIDDLE = 0.1
"""The line is crossed within its width less this share at both ends."""
HOP_M, GAP_S = 1.5, 5.0
"""Between two scans: a robot that is farther than that, or later, may have been put elsewhere."""
SLACK_M, FASTEST = 0.15, 2.0
"""A correction that localisation makes, m, beside which no robot of a building is faster, m/s."""
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
        """Begin anew: nothing connects what comes with what was."""
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
