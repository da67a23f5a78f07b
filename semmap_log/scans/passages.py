"""Doors that the robot drove through: its own track is the proof."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from semmap_log.scans.door_grid import DoorGrid

SIDE_M = 0.35
"""The track must come from so far on one side of the line and go on to so far on the other."""
MIDDLE = 0.1
"""The line is crossed within its width less this share at both ends."""
HOP_M, GAP_S = 1.5, 5.0
"""Between two scans: a robot that is farther than that, or later, may have been put elsewhere."""
SLACK_M, FASTEST = 0.15, 2.0
"""A correction that localisation makes, m, beside which no robot of a building drives faster, m/s."""
SPACING_M = 0.02
NEAR_M = 2.0


@dataclass(frozen=True, slots=True)
class Passage:
    """A door of the rows that the grid was made of, and when the robot was before and behind it."""

    door: int
    first_ns: int
    last_ns: int


@dataclass(slots=True)
class _Crossing:
    """The line was crossed; whether the robot goes on is not known yet."""

    door: int
    first_ns: int
    to_side: float


@dataclass(slots=True)
class Track:
    """Where one laser went since its last jump."""

    places: deque[tuple[int, float, float]] = field(default_factory=lambda: deque(maxlen=512))
    """Stamp ns, x, y m; two are `SPACING_M` apart at least."""
    crossings: list[_Crossing] = field(default_factory=list)
    last: tuple[int, float, float, int] | None = None
    """Stamp ns, x, y m, level of the last scan."""

    def go(
        self,
        stamps_ns: NDArray[np.int64],
        places: NDArray[np.float64],
        levels: NDArray[np.int64],
        grid: DoorGrid,
        lines: NDArray[np.float64],
    ) -> list[Passage]:
        """Follow the laser (t,), (t, 2), (t,); return the doors that it has driven through now."""
        near = _doors_at(grid, levels, places)
        found: list[Passage] = []
        rows = zip(stamps_ns.tolist(), places.tolist(), levels.tolist(), strict=True)
        for i, (stamp_ns, (x, y), level) in enumerate(rows):
            now = (stamp_ns, x, y, level)
            if self.last is not None and not _is_driven(self.last, now):
                self.forget()
            if self.crossings:
                found += self._ended(now, lines)
            if self.last is not None:
                for door in near.get(i, ()):
                    self._cross(door, lines[door], now)
            if (
                not self.places
                or abs(x - self.places[-1][1]) + abs(y - self.places[-1][2]) > SPACING_M
            ):
                self.places.append((stamp_ns, x, y))
            self.last = now
        return found

    def forget(self) -> None:
        """Begin anew: nothing connects what comes with what was."""
        self.places.clear()
        self.crossings.clear()
        self.last = None

    def _ended(self, now, lines) -> list[Passage]:
        passed, still = [], []
        for crossing in self.crossings:
            _, off = _in_line(lines[crossing.door], now[1], now[2])
            if off * crossing.to_side >= SIDE_M:
                passed.append(Passage(crossing.door, crossing.first_ns, now[0]))
            elif off * crossing.to_side > -SIDE_M:
                still.append(crossing)
        self.crossings = still
        return passed

    def _cross(self, door: int, line, now) -> None:
        along, off = _in_line(line, now[1], now[2])
        was_along, was_off = _in_line(line, self.last[1], self.last[2])
        if (off > 0) == (was_off > 0):
            return
        at = was_along + (along - was_along) * was_off / (was_off - off)
        if not MIDDLE * line[3] < at < (1 - MIDDLE) * line[3]:
            return
        to_side = 1.0 if off > 0 else -1.0
        if any(crossing.door == door for crossing in self.crossings):
            return
        for stamp_ns, x, y in reversed(self.places):
            _, before = _in_line(line, x, y)
            if before * to_side <= -SIDE_M:
                self.crossings.append(_Crossing(door, stamp_ns, to_side))
                break
            if before * to_side >= SIDE_M:
                break


def _doors_at(grid, levels, places) -> dict[int, list[int]]:
    at, doors = grid.near(levels, places)
    middle = grid.middles[doors]
    close = np.hypot(*(places[at] - middle).T) < NEAR_M
    near: dict[int, list[int]] = {}
    for i, door in zip(at[close].tolist(), doors[close].tolist(), strict=True):
        near.setdefault(i, []).append(door)
    return near


def _is_driven(last, now) -> bool:
    dt = (now[0] - last[0]) / 1e9
    hop = float(np.hypot(now[1] - last[1], now[2] - last[2]))
    return now[3] == last[3] and 0 < dt <= GAP_S and hop <= min(HOP_M, SLACK_M + FASTEST * dt)


def _in_line(line, x: float, y: float) -> tuple[float, float]:
    """Return how far along the line a point is, and how far left of it."""
    dx, dy = x - line[0], y - line[1]
    c, s = np.cos(line[2]), np.sin(line[2])
    return c * dx + s * dy, c * dy - s * dx
