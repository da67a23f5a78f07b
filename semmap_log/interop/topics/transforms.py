"""The tree of frames from TF: each link over the last seconds, at any moment in between.

Rotations in space are quaternions: one at a time, or many as arrays. A vector is (x, y, z), a
quaternion (x, y, z, w); each component is a number, or an array of as many as there are of the
others.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.model.rigid_transform import yaw_of

LONGEST_CHAIN = 100
MOST_FRAMES = 5000
"""Of more those are forgotten that are silent: some nodes give each thing they see a new frame."""
SILENT_NS = 60 * 10**9
_FROM = {True: "from the future", False: "too old"}


@dataclass(slots=True)
class _Link:
    parent: str
    pose: LinkPose
    """As it came last."""
    stamp: Any
    received_ns: int
    is_static: bool
    history: LinkHistory


class TransformTree:
    """Child frame -> its transforms to its parent."""

    def __init__(self, keep_ns: int = 0) -> None:
        """Begin without frames.

        Args:
            keep_ns: How long before the newest of a link the others are kept, to ask how it was;
                0: only the newest is known.
        """
        self.keep_ns = keep_ns
        self.placed_by_hand: str | None = None
        """A frame whose children another source places: what TF says of them is passed over."""
        self.strays = 0
        """Transforms at odds with others of their link: their stamps, or their parents."""
        self.stray = ""
        """The last of them, in words."""
        self._links: dict[str, _Link] = {}
        self._tidied_ns = 0

    def take(self, transform: Any, received_ns: int, *, is_static: bool) -> str:
        """Take in a geometry_msgs/TransformStamped; return its child frame.

        Raises:
            ValueError: It is no transform.
        """
        child = str(transform.child_frame_id.removeprefix("/"))
        parent = str(transform.header.frame_id.removeprefix("/"))
        shift, turn = transform.transform.translation, transform.transform.rotation
        translation = (shift.x, shift.y, shift.z)
        yaw_of(turn)  # refuses what is no rotation
        if not all(math.isfinite(value) for value in translation):
            raise ValueError(f"a translation that is not finite: {translation}")
        if parent != self.placed_by_hand:
            pose = LinkPose(translation, unit((turn.x, turn.y, turn.z, turn.w)))
            stamp = transform.header.stamp
            self.put(child, parent, pose, stamp, received_ns, is_static=is_static)
        return child

    def put(
        self, child: str, parent: str, pose: LinkPose, stamp: Any, received_ns: int, *,
        is_static: bool = False, holds: bool = False,
    ) -> None:  # fmt: skip
        """Take in where a frame stands in its parent; one too many is noted as a stray."""
        link = self._links.get(child)
        if link is None and len(self._links) >= MOST_FRAMES and not self._forget(received_ns):
            self._note(f"{child}: more than {MOST_FRAMES:,} frames")
            return
        if self.keep_ns and link is not None and link.parent != parent:
            self._note(f"{child} stands in {parent}, and stood in {link.parent}")
        if link is None or (link.parent, link.is_static) != (parent, is_static):
            history = LinkHistory(0 if is_static else self.keep_ns, holds)
            self._links[child] = link = _Link(parent, pose, stamp, received_ns, is_static, history)
        link.pose, link.stamp, link.received_ns = pose, stamp, received_ns
        if not link.history.keep_ns:
            return
        stray_ns = link.history.add(stamp_ns(stamp), pose)
        if stray_ns is not None:
            off_s = (stray_ns - stamp_ns(stamp)) / 1e9
            self._note(f"{parent} -> {child}: {abs(off_s):.1f} s {_FROM[off_s > 0]}")

    def _forget(self, now_ns: int) -> bool:
        """Forget frames that move and are silent; return whether there is room again."""
        if abs(now_ns - self._tidied_ns) >= SILENT_NS // 60:
            self._tidied_ns = now_ns
            self._links = {
                frame: link for frame, link in self._links.items()
                if link.is_static or link.history.holds
                or abs(now_ns - link.received_ns) < SILENT_NS
            }  # fmt: skip
        return len(self._links) < MOST_FRAMES

    def _note(self, stray: str) -> None:
        self.strays += 1
        self.stray = stray

    def links(self) -> list[tuple[str, str]]:
        """Return parent and child of each transform."""
        return sorted((link.parent, child) for child, link in self._links.items())

    def has(self, frame: str) -> bool:
        """Return whether a frame stands in another, or another in it."""
        return frame in self._links or any(link.parent == frame for link in self._links.values())

    def chain(self, top: str, frame: str) -> tuple[str, ...] | None:
        """Return the children on the way from a frame up to another; None: there is no way."""
        frames, end = self._way_up(frame, top)
        return frames if end == top else None

    def root(self, frame: str) -> str:
        """Return the frame that stands above all others over a frame; itself in a circle."""
        return self._way_up(frame, None)[1] or frame

    def no_way(self, top: str, frame: str) -> str:
        """Return in words why there is no chain."""
        frames, end = self._way_up(frame, top)
        way = " on ".join((*frames, *([end] if end else [])))
        if not end:
            return f"a loop: {way}"
        return f"{way}, which has no parent" if frames else f"{frame} is in no transform"

    def _way_up(self, frame: str, top: str | None) -> tuple[tuple[str, ...], str | None]:
        """Return the children on the way up, and where it ends; None: in a circle."""
        frames: list[str] = []
        while frame != top:
            link = self._links.get(frame)
            if link is None:
                break
            if frame in frames or len(frames) > LONGEST_CHAIN:
                return tuple(frames), None
            frames.append(frame)
            frame = link.parent
        return tuple(frames), frame

    def pose(self, chain: Sequence[str]) -> tuple[float, float, float]:
        """Return x, y and the angle around z of the chain's lowest frame in its uppermost."""
        placed = _composed([self._links[frame].pose for frame in chain])
        x, y, _ = placed.shift
        return float(x), float(y), float(yaw(placed.turn))

    def at(self, chain: Sequence[str], times: Times) -> LinkPose:
        """Return how the chain's lowest frame stood in its uppermost at moments that are covered.

        Args:
            chain: See `chain`.
            times: (n,) by the stamps' clock, nanoseconds.

        Returns:
            Its components are arrays (n,).
        """
        placed = _composed([self._link_at(frame, times) for frame in chain])
        shift, turn = placed.shift, placed.turn
        return LinkPose(
            tuple(np.broadcast_to(each, times.shape) for each in shift),  # type: ignore[arg-type]
            tuple(np.broadcast_to(each, times.shape) for each in turn),  # type: ignore[arg-type]
        )

    def _link_at(self, frame: str, times: Times) -> LinkPose:
        link = self._links[frame]
        return link.pose if link.is_static else link.history.at(times)

    def moving(self, chain: Sequence[str]) -> list[tuple[str, LinkHistory]]:
        """Return the links of a chain that are not static, the lowest first: child and history."""
        links = [(frame, self._links[frame]) for frame in chain]
        return [(frame, link.history) for frame, link in links if not link.is_static]

    def parent(self, frame: str) -> str:
        """Return the frame in which another stands."""
        return self._links[frame].parent

    def stamp(self, chain: Sequence[str]) -> Any:
        """Return the stamp of the link that came last: of a robot that drives, its odometry's."""
        moving = [self._links[frame] for frame in chain if not self._links[frame].is_static]
        return max(moving, key=lambda link: link.received_ns).stamp if moving else None

    def late_s(self, chain: Sequence[str]) -> float:
        """Return how long before the last of the links the first of them came, seconds."""
        came = [
            self._links[frame].received_ns for frame in chain if not self._links[frame].is_static
        ]
        return (max(came) - min(came)) / 1e9 if came else 0.0


def _composed(poses: Sequence[LinkPose]) -> LinkPose:
    """Return the pose of the first frame in the parent of the last; each is in the next one."""
    at: Vector = NO_SHIFT
    turn: Quaternion = NO_TURN
    for pose in poses:
        x, y, z = rotated(at, pose.turn)
        dx, dy, dz = pose.shift
        at = (x + dx, y + dy, z + dz)
        turn = product(pose.turn, turn)
    return LinkPose(at, turn)


def stamp_ns(stamp: Any) -> int:
    """Return a message's stamp in nanoseconds; 0: it has none."""
    return 0 if stamp is None else int(stamp.sec) * 10**9 + int(stamp.nanosec)


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
            self.poses[place] = pose  # sent again: the later one counts
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


Vector: TypeAlias = tuple[Any, Any, Any]
Quaternion: TypeAlias = tuple[Any, Any, Any, Any]

NO_SHIFT: Vector = (0.0, 0.0, 0.0)
NO_TURN: Quaternion = (0.0, 0.0, 0.0, 1.0)


def product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the rotation by b, then by a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def inverse(turn: Quaternion) -> Quaternion:
    """Return the rotation back."""
    x, y, z, w = turn
    return -x, -y, -z, w


def unit(turn: Sequence[Any]) -> Quaternion:
    """Return a quaternion of length 1, as a turn has it: a longer one would stretch, too."""
    length = np.sqrt(sum(part * part for part in turn))
    x, y, z, w = (part / length for part in turn)
    return x, y, z, w


def rotated(vector: Vector, turn: Quaternion) -> Vector:
    """Return a vector turned."""
    return product(product(turn, (*vector, 0.0)), inverse(turn))[:3]


def between(a: Quaternion, b: Quaternion, share: Any) -> Quaternion:
    """Return the turn that lies a share of the way from a to b: at a constant rate, the short way.

    Two quaternions are the same turn if one is the other's negative: of those of `b` the one nearer
    to `a` counts, or a turn by one degree would go around by 359.
    """
    dot = sum(one * other for one, other in zip(a, b, strict=True))
    sign = np.where(np.less(dot, 0), -1.0, 1.0)
    angle = np.arccos(np.clip(np.abs(dot), 0.0, 1.0))
    sine = np.sin(angle)
    is_small = sine < SMALL
    safe = np.where(is_small, 1.0, sine)
    of_a = np.where(is_small, 1 - share, np.sin((1 - share) * angle) / safe)
    of_b = np.where(is_small, share, np.sin(share * angle) / safe) * sign
    mixed = [of_a * one + of_b * other for one, other in zip(a, b, strict=True)]
    return unit(mixed)


SMALL = 1e-6
"""Sine of an angle below which the arc is as good as straight."""


def angle_between(a: Quaternion, b: Quaternion) -> Any:
    """Return by how much two turns differ, radians."""
    *xyz, w = product(inverse(a), b)
    return 2 * np.arctan2(np.sqrt(sum(part * part for part in xyz)), np.abs(w))


def yaw(turn: Quaternion) -> Any:
    """Return the angle around z, radians."""
    x, y, z, w = turn
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
