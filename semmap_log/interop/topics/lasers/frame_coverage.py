"""Whether TF tells where a frame was at a moment: it may come yet, never come, or jump there."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from semmap_log.interop.topics.link_history import LinkHistory, LinkPose
from semmap_log.interop.topics.rotations import angle_between, rotated
from semmap_log.interop.topics.transforms import TransformTree

LONGEST_GAP_NS = 2 * 10**9
"""Between two transforms of a link; a longer one counts where the frame hardly moved in it."""
STILL_M, STILL_RAD = 0.1, math.radians(2)
CORRECTION_M, CORRECTION_RAD = 0.2, math.radians(5)
"""By more localisation puts the robot elsewhere: what lies between the two is no place."""
FASTEST_M_S, FASTEST_RAD_S = 2.5, 2.5
"""No robot in a building moves or turns faster."""


class Uncovered(NamedTuple):
    """A moment at which it is not told where a frame was."""

    frame: str
    parent: str
    off_ns: int
    """How long before the moment the last transform was (> 0), or how long after it the first one
    (< 0); or how long nothing came around it, where `is_gap`."""
    is_gap: bool = False

    @property
    def may_come(self) -> bool:
        """Tell whether later transforms can tell it."""
        return self.off_ns > 0 and not self.is_gap

    def __str__(self) -> str:
        link, seconds = f"{self.parent} -> {self.frame}", abs(self.off_ns) / 1e9
        if self.is_gap:
            return f"{link}: nothing for {seconds:.1f} s while the robot moved"
        which = "the newest is" if self.off_ns > 0 else "the first is"
        return f"{link}: {which} {seconds:.1f} s {'older' if self.off_ns > 0 else 'younger'}"


class Jump(NamedTuple):
    """Localisation, or odometry, put the robot elsewhere at once."""

    metres: float
    degrees: float
    stamp_ns: int

    def __str__(self) -> str:
        return f"{self.metres:.2f} m, {self.degrees:.0f} degrees"


def uncovered(
    tree: TransformTree, chain: tuple[str, ...], first_ns: int, last_ns: int
) -> Uncovered | None:
    """Return the link that does not reach over a time; None: all of them do."""
    for frame, history in tree.moving(chain):
        stamps, parent = history.stamps, tree.parent(frame)
        if not stamps:
            return Uncovered(frame, parent, 1)
        if stamps[0] > first_ns:
            return Uncovered(frame, parent, first_ns - stamps[0])
        if stamps[-1] < last_ns and not history.holds:
            return Uncovered(frame, parent, last_ns - stamps[-1])
        for before, after in history.steps(first_ns, last_ns):
            gap_ns = stamps[after] - stamps[before]
            if gap_ns > LONGEST_GAP_NS and not _is_still(history, before, after):
                return Uncovered(frame, parent, gap_ns, is_gap=True)
    return None


def _is_still(history: LinkHistory, before: int, after: int) -> bool:
    a, b = history.poses[before], history.poses[after]
    turned = float(angle_between(a.turn, b.turn))
    return math.dist(a.shift, b.shift) <= STILL_M and turned <= STILL_RAD


def jump_in(
    tree: TransformTree, chain: tuple[str, ...], first_ns: int, last_ns: int
) -> Jump | None:
    """Return the jump between two transforms around a time that is covered; None: there is none.

    A link that hangs on the uppermost frame, with odometry below it, is localisation's: each of its
    steps is a correction, measured where the robot is. All others are motion.
    """
    moving = tree.moving(chain)
    for i, (frame, history) in enumerate(moving):
        for before, after in history.steps(first_ns, last_ns):
            middle_ns = (history.stamps[before] + history.stamps[after]) // 2
            when_ns = min(max(middle_ns, first_ns), last_ns)
            a, b = history.poses[before], history.poses[after]
            is_correction = len(moving) > 1 and i == len(moving) - 1 and frame == chain[-1]
            at = (0.0, 0.0, 0.0)
            if is_correction:
                below = tree.at(chain[:-1], np.array([when_ns], np.int64)).shift
                at = tuple(float(each[0]) for each in below)  # type: ignore[assignment]
            metres, turned = math.dist(_moved(at, a), _moved(at, b)), angle_between(a.turn, b.turn)
            seconds = (history.stamps[after] - history.stamps[before]) / 1e9
            share = 0.0 if is_correction else seconds
            if (
                metres > CORRECTION_M + FASTEST_M_S * share
                or turned > CORRECTION_RAD + FASTEST_RAD_S * share
            ):
                return Jump(metres, math.degrees(float(turned)), history.stamps[after])
    return None


def _moved(at: tuple[float, float, float], pose: LinkPose) -> tuple[float, float, float]:
    x, y, z = rotated(at, pose.turn)
    dx, dy, dz = pose.shift
    return float(x + dx), float(y + dy), float(z + dz)
