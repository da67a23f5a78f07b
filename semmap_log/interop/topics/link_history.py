"""What TF told of one link over the last seconds, and how it was at any moment in between."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.interop.topics.rotations import Quaternion, Vector, between

Times = NDArray[np.int64]
LEAST_APART_NS = 10**6
"""Of poses that follow each other faster some are left out, however many come: nothing that has
wheels moves by a centimetre meanwhile."""


@dataclass(frozen=True, slots=True)
class LinkPose:
    """Where a frame stands in its parent; the components are numbers, or arrays of many moments."""

    shift: Vector
    turn: Quaternion


@dataclass(slots=True)
class LinkHistory:
    """Poses of one link by their stamps, ascending."""

    keep_ns: int
    """So long before the newest they are kept; 0: nothing is."""
    holds: bool = False
    """A pose holds until the next one comes: nothing lies between two of them."""
    stamps: list[int] = field(default_factory=list)
    poses: list[LinkPose] = field(default_factory=list)
    _odd: tuple[int, LinkPose] | None = None
    """One whose stamp is far from the others': theirs is the clock, unless the next agrees."""

    def add(self, stamp_ns: int, pose: LinkPose) -> int | None:
        """Take in a pose; return the stamp of one that is left out for good by that, if one is.

        A single stamp from the future, or from long ago, is left out. Two that follow each other
        are a clock that was set, or a recording that was stopped: what was before is forgotten.
        """
        if not self.keep_ns:
            return None
        odd_ns = None if self._odd is None else self._odd[0]
        fits = not self.stamps or abs(stamp_ns - self.stamps[-1]) <= self.keep_ns or self.holds
        if not fits:
            if self._odd is None or abs(stamp_ns - self._odd[0]) > self.keep_ns:
                self._odd = (stamp_ns, pose)
                return odd_ns
            odd_ns = None
            self.stamps[:], self.poses[:] = [self._odd[0]], [self._odd[1]]
        self._odd = None
        self._insert(stamp_ns, pose)
        return odd_ns

    def _insert(self, stamp_ns: int, pose: LinkPose) -> None:
        place = bisect_left(self.stamps, stamp_ns)
        if place < len(self.stamps) and self.stamps[place] == stamp_ns:
            self.poses[place] = pose  # told again: the later word counts
            return
        if place == len(self.stamps) > 1 and stamp_ns - self.stamps[-2] < LEAST_APART_NS:
            self.stamps[-1], self.poses[-1] = stamp_ns, pose
            return
        is_between = 0 < place < len(self.stamps)
        if is_between and self.stamps[place] - self.stamps[place - 1] < LEAST_APART_NS:
            return
        self.stamps.insert(place, stamp_ns)
        self.poses.insert(place, pose)
        old = bisect_right(self.stamps, self.stamps[-1] - self.keep_ns) - 1
        if old > 0:  # the last one before is kept: it is where an interval begins
            del self.stamps[:old], self.poses[:old]

    def steps(self, first_ns: int, last_ns: int) -> list[tuple[int, int]]:
        """Return the neighbours between which a time lies, as places: (before, after)."""
        if self.holds:
            return []
        begin = bisect_right(self.stamps, first_ns) - 1
        end = bisect_left(self.stamps, last_ns)
        return [(i, i + 1) for i in range(max(begin, 0), min(end, len(self.stamps) - 1))]

    def at(self, times: Times) -> LinkPose:
        """Return the poses at moments that it reaches over; in between by time, the short way."""
        stamps = np.array(self.stamps, np.int64)
        before = np.clip(np.searchsorted(stamps, times, "right") - 1, 0, None)
        first, last = int(before.min()), min(int(before.max()) + 2, len(stamps))
        before = before - first
        after = before if self.holds else np.minimum(before + 1, last - first - 1)
        stamps = stamps[first:last]
        gap = np.maximum(stamps[after] - stamps[before], 1)
        share = np.where(after == before, 0.0, (times - stamps[before]) / gap)
        shifts, turns = (
            np.array([getattr(pose, name) for pose in self.poses[first:last]], float)
            for name in ("shift", "turn")
        )
        shift = shifts[before] + share[:, None] * (shifts[after] - shifts[before])
        turn = between(_columns(turns[before]), _columns(turns[after]), share)
        return LinkPose(_columns(shift), turn)


def _columns(rows: NDArray[np.float64]) -> Any:
    return tuple(rows.T)
