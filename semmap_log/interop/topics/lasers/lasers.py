"""The lasers of one robot or several: scans wait until TF shows where the laser was.

A frame's place at a moment may come yet, never come, or jump there: see `Uncovered`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from semmap_log.analysis.scans.visit import PlacedScan
from semmap_log.core.io.clock import MAX_TIME_NS
from semmap_log.core.model.events import RobotPose
from semmap_log.interop.formats.ros.ros_types import LASER_SCAN
from semmap_log.interop.topics import transforms
from semmap_log.interop.topics.lasers import placing
from semmap_log.interop.topics.topic_reader import TopicMessage, TopicProblems, happened_ns
from semmap_log.interop.topics.topic_rules import ReadScan, RosMapping

KEEP_NS = 10 * 10**9
"""Of TF's past."""
WAIT_NS = 2 * 10**9
"""A scan that has no place when another comes that is so far from it gets none."""
MOST_WAITING = 500
AT_ONCE_BACK_NS = 5 * 10**9
"""A stamp that is further before the last one is that of a clock that was set, or of a bag that
begins again."""


@dataclass(frozen=True, slots=True, eq=False)
class RobotScan:
    """A scan on the map, and where the robot stood."""

    scan: PlacedScan
    pose: RobotPose
    topic: str


@dataclass(slots=True)
class ScanCounts:
    """What became of the scans of a topic."""

    received: int = 0
    placed: int = 0
    repeated: int = 0
    """With the stamp of the one before, or an older one."""
    jumps: int = 0
    """Dropped while the pose jumped."""
    worst_jump: Jump | None = None

    @property
    def dropped(self) -> int:
        """How many of those received were not placed; those that wait, too."""
        return self.received - self.placed


@dataclass(slots=True)
class Lasers:
    """Reads scans, and hands them out once they have places."""

    mapping: RosMapping
    complaints: TopicProblems
    counts: dict[str, ScanCounts] = field(default_factory=dict)
    """By topic."""
    why_not: dict[str, str] = field(default_factory=dict)
    """Topic -> why the last of its scans without a place had none."""
    tops: dict[str, str] = field(default_factory=dict)
    """Topic -> where the frames above the laser end, where that is not the map; the laser's own
    frame: in no transform."""
    _trees: dict[str, transforms.TransformTree] = field(default_factory=dict)
    _spreads: dict[str, placing.Spreads] = field(default_factory=dict)
    _links: dict[str, placing.MapLink] = field(default_factory=dict)
    """By the topic of the poses."""
    _lasers: dict[str, _Laser] = field(default_factory=dict)

    def tree(self, robot: str) -> transforms.TransformTree:
        """Return the frames of a robot, to put transforms in; "": of all that have none apart."""
        if robot not in self._trees:
            tree = transforms.TransformTree(KEEP_NS if self.mapping.reads_scans else 0)
            tree.placed_by_hand = self.mapping.map_frame if self._has_poses(robot) else None
            self._trees[robot] = tree
        return self._trees[robot]

    def tree_of(self, robot: str) -> transforms.TransformTree:
        """Return the frames in which a robot is: its own, where there are such, or those of all."""
        return self.tree(robot if robot in self._trees else "")

    def _has_poses(self, robot: str) -> bool:
        """Return whether a topic of poses puts a robot on the map, instead of TF."""
        rules = self.mapping.scan_rules()
        return any(rule.pose_topic and rule.robot in {None, robot} for rule in rules)

    def add(self, topic: str, rule: ReadScan, level: int) -> None:
        """Have a laser, whose scans come by a topic."""
        self._lasers[topic] = _Laser(topic, rule, level, self)
        self.counts[topic] = ScanCounts()

    def robot_of(self, namespace: str) -> str:
        """Return the robot whose frames have a namespace, or one around it; "": nobody's."""
        while namespace and namespace not in self._trees:
            namespace = namespace.rpartition("/")[0]
        return namespace

    def take_scan(self, got: TopicMessage) -> None:
        """Have a LaserScan or PointCloud2 wait for its place."""
        self._lasers[got.topic].take(got)

    def take_pose(self, got: TopicMessage, robot: str) -> None:
        """Take in where a robot is, in the map's frame, and how sure it is of that."""
        self._spreads.setdefault(robot, placing.Spreads()).take(got.message)
        for laser in self._lasers.values():
            if laser.rule.pose_topic == got.topic and got.topic not in self._links:
                tree = self.tree_of(laser.robot)
                self._links[got.topic] = placing.MapLink(
                    tree, self.mapping.map_frame, laser.robot_frame(tree)
                )
        if got.topic in self._links:
            self._links[got.topic].take(got.message, got.received_ns)

    def spread(self, robot: str, when_ns: int) -> tuple[float, float]:
        """Return how sure a robot was of its place: m and rad; NaN where it gave none."""
        own = self._spreads.get(robot) or self._spreads.get("") or placing.Spreads()
        return own.at(when_ns)

    def placed(self, *, is_end: bool = False) -> Iterator[RobotScan]:
        """Yield the scans whose places are known now; at the end all others are dropped."""
        for link in self._links.values():
            link.settle()
        for laser in self._lasers.values():
            yield from laser.placed(is_end=is_end)


@dataclass(slots=True)
class _Laser:
    """One topic of scans."""

    topic: str
    rule: ReadScan
    level: int
    all: Lasers
    waiting: deque[tuple[placing.Sweep | placing.Cloud, int]] = field(default_factory=deque)
    """With when they came."""
    _stamp_ns: int = 0
    """Of the last scan that was taken."""
    _happened_ns: int = 0

    @property
    def robot(self) -> str:
        """Whose laser it is: as the mapping says, else by the namespace that has frames."""
        if self.rule.robot is not None:
            return self.rule.robot
        return self.all.robot_of(self.topic.strip("/").rpartition("/")[0])

    @property
    def counts(self) -> ScanCounts:
        return self.all.counts[self.topic]

    def robot_frame(self, tree: transforms.TransformTree) -> str:
        """Return what the robot's own frame is called: with its name before it, where that is."""
        plain = self.all.mapping.robot_frame
        prefixed = f"{self.robot}/{plain}"
        return prefixed if self.robot and tree.has(prefixed) else plain

    def take(self, got: TopicMessage) -> None:
        self.counts.received += 1
        is_laser = got.ros_type == LASER_SCAN
        scan = placing.sweep_of(got.message) if is_laser else placing.cloud_of(got.message)
        if isinstance(scan, placing.Unusable):
            self.drop(scan)
        elif self._advances(scan.stamp_ns):
            self._stamp_ns = scan.stamp_ns
            self.waiting.append((scan, got.received_ns))

    def _advances(self, stamp_ns: int) -> bool:
        if stamp_ns <= 0:
            self.drop(placing.Unusable("a scan without a stamp"))
            return False
        back_ns = self._stamp_ns - stamp_ns
        if 0 <= back_ns <= AT_ONCE_BACK_NS:
            self.counts.repeated += 1
            self.drop(
                placing.Unusable(
                    "a scan whose stamp does not advance", f"by {-back_ns / 1e9:.3f} s"
                )
            )
            return False
        if back_ns > 0:
            self.all.complaints.add(
                self.topic, "stamps go back: a clock was set, or a bag begins again",
                f"by {back_ns / 1e9:.1f} s",
            )  # fmt: skip
        return True

    def placed(self, *, is_end: bool) -> Iterator[RobotScan]:
        """Yield those at the queue's head that have their places."""
        while self.waiting:
            scan, received_ns = self.waiting[0]
            found = self._placed(scan)
            if isinstance(found, _Waits):
                late = abs(self._stamp_ns - scan.stamp_ns) > WAIT_NS  # or it is from the future
                if not (late or is_end or len(self.waiting) > MOST_WAITING):
                    return
                self.drop(self._without_place(found.on))
            elif isinstance(found, placing.Unusable):
                self.drop(found)
            else:
                robot_scan = self._on_level(scan, found, received_ns)
                if robot_scan is not None:
                    self.counts.placed += 1
                    yield robot_scan
            self.waiting.popleft()

    def _placed(
        self, scan: placing.Sweep | placing.Cloud
    ) -> placing.Placed | placing.Unusable | _Waits:
        """Return a scan on the map, or why it is not there, or not yet."""
        tree, top = self.all.tree_of(self.robot), self.all.mapping.map_frame
        chain = tree.chain(top, scan.frame)
        if chain is None:
            self.all.tops[self.topic] = tree.root(scan.frame)
            return _Waits(tree.no_way(top, scan.frame))
        last_ns = scan.stamp_ns
        first_ns = last_ns
        if isinstance(scan, placing.Sweep):
            first_ns += int(scan.after_ns.min())
            last_ns += int(scan.after_ns.max())
        missing = uncovered(tree, chain, first_ns, last_ns)
        if missing is not None:
            return _Waits(str(missing)) if missing.may_come else self._without_place(str(missing))
        jump = jump_in(tree, chain, first_ns, last_ns)
        if jump is not None:
            self.counts.jumps += 1
            self.counts.worst_jump = max(jump, self.counts.worst_jump or jump)
            return placing.Unusable("a scan while the pose jumped", str(jump))
        where = placing.Where(tree, chain, self.robot_frame(tree))
        if isinstance(scan, placing.Sweep):
            return placing.place_sweep(scan, where)
        return placing.place_cloud(scan, where, self.rule.heights)

    def _on_level(
        self, scan: placing.Sweep | placing.Cloud, placed: placing.Placed, received_ns: int
    ) -> RobotScan | None:
        """Return what was seen when, by the clock of the log; None: that does not advance."""
        happened = self._when(scan.stamp_ns, received_ns)
        if 0 <= self._happened_ns - happened <= AT_ONCE_BACK_NS:
            self.counts.repeated += 1
            self.drop(placing.Unusable("a scan whose stamp does not advance"))
            return None
        self._happened_ns = happened
        sd_xy, sd_theta = self.all.spread(self.robot, scan.stamp_ns)
        x, y, theta = placed.robot
        return RobotScan(
            PlacedScan(
                stamp_ns=happened, level=self.level, laser=scan.frame, origins=placed.origins,
                bearings=placed.bearings, ranges=placed.ranges, max_range=placed.max_range,
                sd_xy=sd_xy, sd_theta=sd_theta, robot=self.robot,
            ),
            RobotPose(
                level=self.level, x=x, y=y, theta=theta, sd_xy=sd_xy, sd_theta=sd_theta,
                happened_ns=happened,
            ),
            self.topic,
        )  # fmt: skip

    def _when(self, stamp_ns: int, received_ns: int) -> int:
        if not 0 < received_ns <= MAX_TIME_NS:  # no clock had come
            return stamp_ns
        within_s = self.all.mapping.stamps_within_s
        return happened_ns(_Stamp(*divmod(stamp_ns, 10**9)), received_ns, within_s=within_s)

    def _without_place(self, why: str) -> placing.Unusable:
        self.all.why_not[self.topic] = why
        return placing.Unusable("a scan without a TF position at its time; dropped", why)

    def drop(self, why: placing.Unusable) -> None:
        self.all.complaints.add(self.topic, why.kind, why.example)


@dataclass(frozen=True, slots=True)
class _Waits:
    """A scan has no place yet."""

    on: str
    """For what."""


@dataclass(frozen=True, slots=True)
class _Stamp:
    sec: int
    nanosec: int


LONGEST_GAP_NS = 2 * 10**9
"""Between two transforms of a link; a longer one counts where the frame hardly moved in it."""
STILL_M, STILL_RAD = 0.1, math.radians(2)
CORRECTION_M, CORRECTION_RAD = 0.2, math.radians(5)
"""By more localisation puts the robot elsewhere: what lies between the two is no place."""
FASTEST_M_S, FASTEST_RAD_S = 2.5, 2.5
"""No robot in a building moves or turns faster."""


class Uncovered(NamedTuple):
    """A moment at which a frame's place is unknown."""

    frame: str
    parent: str
    off_ns: int
    """How long before the moment the last transform was (> 0), or how long after it the first one
    (< 0); or how long nothing came around it, where `is_gap`."""
    is_gap: bool = False

    @property
    def may_come(self) -> bool:
        """Return whether later transforms can still supply it."""
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
    tree: transforms.TransformTree, chain: tuple[str, ...], first_ns: int, last_ns: int
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


def _is_still(history: transforms.LinkHistory, before: int, after: int) -> bool:
    a, b = history.poses[before], history.poses[after]
    turned = float(transforms.angle_between(a.turn, b.turn))
    return math.dist(a.shift, b.shift) <= STILL_M and turned <= STILL_RAD


def jump_in(
    tree: transforms.TransformTree, chain: tuple[str, ...], first_ns: int, last_ns: int
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
            metres, turned = (
                math.dist(_moved(at, a), _moved(at, b)),
                transforms.angle_between(a.turn, b.turn),
            )
            seconds = (history.stamps[after] - history.stamps[before]) / 1e9
            share = 0.0 if is_correction else seconds
            if (
                metres > CORRECTION_M + FASTEST_M_S * share
                or turned > CORRECTION_RAD + FASTEST_RAD_S * share
            ):
                return Jump(metres, math.degrees(float(turned)), history.stamps[after])
    return None


def _moved(at: tuple[float, float, float], pose: transforms.LinkPose) -> tuple[float, float, float]:
    x, y, z = transforms.rotated(at, pose.turn)
    dx, dy, dz = pose.shift
    return float(x + dx), float(y + dy), float(z + dz)
