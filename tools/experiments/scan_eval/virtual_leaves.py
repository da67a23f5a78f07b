"""Leaves put into real scans: open doorways whose state is drawn anew each minute.

No door changes its state in the logs there are. A leaf that is not there is put into a doorway that
is: each beam that it would have stopped ends on it. All else in the scans stays real.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, nan, radians, sin

import numpy as np
from numpy.typing import NDArray

from scan_eval.packed_logs import PackedLog
from semmap_log.analysis.scans.visit import Visit

Floats = NDArray[np.float64]

WORDS = ("closed", "ajar", "open")
SHARES = (0.45, 0.20, 0.35)
AJAR_DEG, OPEN_DEG = (10.0, 45.0), (62.0, 115.0)
OUT_OF_SIGHT = 0.15
"""Share of the open doors whose leaf slid or folded away."""
RECESS_M = (-0.03, 0.08)
"""How far off the map's line the leaf hangs."""
NOISE_M = 0.01
MINUTE_S = 60.0
LASER_M = 9.0
"""Leaves farther away are left out: doors there are not judged."""
BODY_M = 0.25
"""A robot nearer to a leaf than that would have run into it."""


@dataclass(frozen=True, slots=True)
class VirtualLeaf:
    """How a leaf stands; a NaN angle: out of sight."""

    word: str
    angle: float
    """rad"""
    at_end: bool
    """Its hinge is where the door's line ends, not where it starts."""
    side: int
    recess: float
    """m"""

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> VirtualLeaf:
        """Return a leaf by chance."""
        word = WORDS[rng.choice(len(WORDS), p=SHARES)]
        degrees = {
            "closed": 0.0,
            "ajar": rng.uniform(*AJAR_DEG),
            "open": nan if rng.random() < OUT_OF_SIGHT else rng.uniform(*OPEN_DEG),
        }[word]
        at_end, side = bool(rng.integers(2)), int(rng.choice((-1, 1)))
        return cls(word, radians(degrees), at_end, side, rng.uniform(*RECESS_M))

    def segment(self, line: Floats) -> tuple[Floats, Floats]:
        """Return its hinge and its other edge (2,) m, at a door (x, y, theta, width)."""
        x, y, theta, width = line.tolist()
        along = np.array([cos(theta), sin(theta)])
        left = np.array([-along[1], along[0]])
        hinge = np.array([x, y]) + (width * along if self.at_end else 0) + self.recess * left
        shut = -along if self.at_end else along
        return hinge, hinge + width * (cos(self.angle) * shut + self.side * sin(self.angle) * left)


@dataclass(frozen=True, slots=True, eq=False)
class VirtualDay:
    """A log with leaves in its open doorways."""

    ranges: Floats
    """(t, b) m"""
    minutes: NDArray[np.int64]
    """(t,) in which minute each scan was taken."""
    leaves: dict[tuple[int, int], VirtualLeaf]
    """By minute and row of the door."""
    collided: NDArray[np.bool_]
    """(t, doors) the robot stands in the leaf."""
    stamps_ns: NDArray[np.int64]

    @classmethod
    def of(cls, log: PackedLog, seed: int) -> VirtualDay:
        """Return leaves by this seed; every doorway that is open gets one."""
        rng = np.random.default_rng(seed)
        ranges = log.ranges.copy()
        minutes = np.floor((log.stamps_s - log.stamps_s.min()) / MINUTE_S).astype(np.int64)
        collided = np.zeros((len(minutes), len(log.names)), bool)
        leaves: dict[tuple[int, int], VirtualLeaf] = {}
        for minute in np.unique(minutes).tolist():
            scans = np.flatnonzero(minutes == minute)
            for door in np.flatnonzero(log.is_open).tolist():
                leaf = leaves[minute, door] = VirtualLeaf.drawn(rng)
                if np.isnan(leaf.angle):
                    continue
                ends = leaf.segment(log.doors.lines[door])
                apart = _distances(log.poses[scans, :2], *ends)
                collided[scans, door] = apart < BODY_M
                near = scans[apart < LASER_M]
                hit = ranges_to(log.poses[near], log.angles, *ends)
                hit += rng.normal(0, NOISE_M, hit.shape)
                ranges[near] = np.minimum(ranges[near], hit)
        stamps_ns = np.round(log.stamps_s * 1e9).astype(np.int64)
        return cls(ranges, minutes, leaves, collided, stamps_ns)

    def truth(self, visit: Visit) -> str:
        """Return how the door stood through a visit; empty: it moved, or the robot ran into it."""
        door = visit.door_id - 1
        within = (self.stamps_ns >= visit.first_ns) & (self.stamps_ns <= visit.last_ns)
        minutes = np.unique(self.minutes[within])
        if len(minutes) != 1 or self.collided[within, door].any():
            return ""
        leaf = self.leaves.get((int(minutes[0]), door))
        return leaf.word if leaf else ""


def ranges_to(poses: Floats, angles: Floats, start: Floats, end: Floats) -> Floats:
    """Return (t, b) how far each beam goes to a segment, m; inf: it does not meet it."""
    bearings = poses[:, 2:] + angles
    ux, uy = np.cos(bearings), np.sin(bearings)
    ex, ey = end - start
    ax, ay = start[0] - poses[:, :1], start[1] - poses[:, 1:2]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = ux * ey - uy * ex
        far, along = (ax * ey - ay * ex) / cross, (ax * uy - ay * ux) / cross
    return np.where((far > 0.02) & (along >= 0) & (along <= 1), far, np.inf)


def _distances(points: Floats, start: Floats, end: Floats) -> Floats:
    """Return (t,) how far points (t, 2) are from a segment, m."""
    way = end - start
    along = np.clip((points - start) @ way / (way @ way), 0, 1)
    return np.asarray(np.hypot(*(points - start - along[:, None] * way).T))
