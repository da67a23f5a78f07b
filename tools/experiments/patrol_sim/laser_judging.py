"""What an estimator makes of a simulated patrol, visit by visit, beside the truth."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from patrol_sim.laser_doors import DoorLife
from patrol_sim.laser_pose import Localisation, PoseError
from patrol_sim.laser_surfaces import Floats
from patrol_sim.laser_world import START_NS, Patrol, SimScan
from semmap_log.analysis.scans.door_watcher import DoorWatcher
from semmap_log.analysis.scans.visit import DoorPlaces, PlacedScan, Visit
from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.moments import SECOND_NS

SOME = 200
"""Scans are handed on in as many at a time."""

IN_VIEW = 15
"""Fewer beams than that are strays: a door behind a wall is crossed by nonsense now and then."""

PLAIN_REACH_M, PLAIN_EDGE_M, PLAIN_SLACK_M = 6.0, 0.1, 0.15
"""The plain rule looks at doors so near, leaves out so much of the line at either end, and takes a
beam that ends so near to it for one that ended on it."""


@dataclass(frozen=True, slots=True)
class Pose:
    """How well the robot is localised, and whether the estimator knows."""

    name: str
    error: PoseError
    told: bool


@dataclass(frozen=True, slots=True)
class Judged:
    """One visit, what it said, and what was true."""

    pose: str
    seed: int
    door_id: DoorId
    kind: str
    glass: bool
    first_s: float
    last_s: float
    state: str
    accuracy: float
    p_open: float
    """P(open), as far as it says."""
    opening: float
    looks: float
    why: str
    passed: bool
    truly_passed: bool
    plain: str
    in_view: bool
    """At least so many beams truly came as far as the door: `IN_VIEW`."""
    moved: bool
    group: str
    """closed, ajar (10 to 45 degrees), open (60 and more), slid (a sliding door, partly), half."""
    towards: bool
    """Its leaf stands on the robot's side of the line."""
    angle_deg: float
    """NaN: it slides."""
    true_opening: float


def judged(
    patrol: Patrol, scans: Sequence[SimScan], where: Localisation, pose: Pose
) -> list[Judged]:
    """Return all visits that the estimator makes of these scans, judged."""
    doors = door_places(patrol)
    watcher = DoorWatcher()
    placed = list(placed_scans(patrol, scans, where, pose))
    visits: list[Visit] = []
    for begin in range(0, len(placed), SOME):
        visits += watcher.take(placed[begin : begin + SOME], doors)
    visits += watcher.close()
    believed = _counts(placed, doors)
    truly = _counts(list(_truly_placed(patrol, scans)), doors)
    return [_judged(visit, patrol, (believed, truly), pose) for visit in visits]


def door_places(patrol: Patrol) -> DoorPlaces:
    """Return the doors as they are drawn."""
    bodies = [life.body for life in patrol.lives.values()]
    return DoorPlaces(
        ids=np.array([b.drawn.door_id for b in bodies], np.int64),
        levels=np.full(len(bodies), patrol.plan.level, np.int64),
        lines=np.array([(b.drawn.x, b.drawn.y, b.drawn.theta, b.drawn.width) for b in bodies]),
        kinds=tuple(b.drawn.kind for b in bodies),
        glass=np.array([b.glass for b in bodies]),
    )


def placed_scans(
    patrol: Patrol, scans: Sequence[SimScan], where: Localisation, pose: Pose
) -> Iterator[PlacedScan]:
    """Yield scans where the robot believed that they were taken."""
    sd_xy = pose.error.sd_xy if pose.told else math.nan
    sd_theta = math.radians(pose.error.sd_theta_deg) if pose.told else math.nan
    for scan in scans:
        base = where.believed_at(patrol.beam_times_s(scan.at_s))
        beams = patrol.laser.placed(base, as_told=True)
        yield PlacedScan(
            stamp_ns=START_NS + round(scan.at_s * SECOND_NS), level=patrol.plan.level,
            laser="laser", origins=beams.origins, bearings=beams.bearings, ranges=scan.ranges,
            max_range=patrol.laser.range_max, sd_xy=sd_xy, sd_theta=sd_theta,
        )  # fmt: skip


def seen_through(patrol: Patrol, scans: Sequence[SimScan]) -> set[DoorId]:
    """Return the doors through which at least `IN_VIEW` beams truly went."""
    through = _counts(list(_truly_placed(patrol, scans)), door_places(patrol)).through.sum(0)
    return {door for door, beams in zip(patrol.lives, through, strict=True) if beams >= IN_VIEW}


def group_of(life: DoorLife, at_s: float) -> str:
    """Return how a door stood: closed, ajar, open, or half open."""
    amounts = life.amounts(at_s)
    word, angle = life.body.word(amounts), life.body.angle_deg(amounts)
    if word != "AJAR":
        return word.lower()
    return "slid" if angle is None else "ajar" if 10 <= angle <= 45 else "half"


def _stands_towards(life: DoorLife, at_s: float, robot: Floats) -> bool:
    """Tell whether the door's leaf stands on the robot's side of its line."""
    start, _ = life.body.ends
    left = life.body.drawn.left
    tips = [tip for _, tip in life.body.panels(life.amounts(at_s))]
    return float((np.mean(tips, axis=0) - start) @ left) * float((robot - start) @ left) > 0


def _truly_placed(patrol: Patrol, scans: Sequence[SimScan]) -> Iterator[PlacedScan]:
    """Yield scans where they were taken."""
    for scan in scans:
        base = patrol.track.at(patrol.beam_times_s(scan.at_s))
        beams = patrol.laser.placed(base, as_told=False)
        stamp_ns = START_NS + round(scan.at_s * SECOND_NS)
        yield PlacedScan(stamp_ns, patrol.plan.level, "laser", beams.origins, beams.bearings,
                         scan.ranges, patrol.laser.range_max)  # fmt: skip


def _judged(
    visit: Visit, patrol: Patrol, counts: tuple[_Counts, _Counts], pose: Pose
) -> Judged:  # fmt: skip
    believed, truly = counts
    life = patrol.lives[visit.door_id]
    first_s, last_s = ((ns - START_NS) / SECOND_NS for ns in (visit.first_ns, visit.last_ns))
    amounts = life.amounts(first_s)
    angle = life.body.angle_deg(amounts)
    through_s = patrol.passages.get(visit.door_id, [])
    decided = {DoorState.OPEN: visit.accuracy, DoorState.CLOSED: 1 - visit.accuracy}
    return Judged(
        pose=pose.name, seed=patrol.seed, door_id=visit.door_id, kind=life.body.kind,
        glass=life.body.glass, first_s=first_s, last_s=last_s, state=visit.state.name,
        accuracy=visit.accuracy, p_open=decided.get(visit.state, visit.p_open),
        opening=visit.opening, looks=visit.looks, why=visit.why, passed=visit.passed,
        truly_passed=any(first_s - 3 <= at_s <= last_s + 3 for at_s in through_s),
        plain=believed.plain(visit), in_view=sum(truly.of(visit)) >= IN_VIEW,
        moved=life.moves(first_s, last_s), group=group_of(life, first_s),
        towards=_stands_towards(life, first_s, patrol.track.pose((first_s + last_s) / 2)[:2]),
        angle_deg=math.nan if angle is None else angle, true_opening=life.body.opening(amounts),
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _Counts:
    """How many beams of each scan went through each door's line, and how many ended on it."""

    stamps: NDArray[np.int64]
    column: dict[int, int]
    through: NDArray[np.int32]
    stopped: NDArray[np.int32]

    def of(self, visit: Visit) -> tuple[int, int]:
        """Return how many beams of a visit went through, and how many ended on the line."""
        first = np.searchsorted(self.stamps, visit.first_ns)
        last = np.searchsorted(self.stamps, visit.last_ns, side="right")
        door = self.column[visit.door_id]
        return (
            int(self.through[first:last, door].sum()), int(self.stopped[first:last, door].sum())
        )  # fmt: skip

    def plain(self, visit: Visit) -> str:
        """Return what more than half of the beams say."""
        through, stopped = self.of(visit)
        if through + stopped == 0:
            return "UNKNOWN"
        return "OPEN" if through > stopped else "CLOSED"


def _counts(scans: Sequence[PlacedScan], doors: DoorPlaces) -> _Counts:
    through = np.zeros((len(scans), len(doors.ids)), np.int32)
    stopped = np.zeros_like(through)
    x, y, theta, width = doors.lines.T
    along = np.stack([np.cos(theta), np.sin(theta)], -1)
    middles = np.stack([x, y], -1) + along * width[:, None] / 2
    for row, scan in enumerate(scans):
        near = np.flatnonzero(np.hypot(*(middles - scan.origins[0]).T) < PLAIN_REACH_M)
        far = _to_lines(scan, doors.lines[near])
        back = np.where(np.isfinite(scan.ranges), scan.ranges, math.nan)
        with np.errstate(invalid="ignore"):
            through[row, near] = np.sum(back > far + PLAIN_SLACK_M, axis=1)
            stopped[row, near] = np.sum(np.abs(back - far) <= PLAIN_SLACK_M, axis=1)
    stamps = np.array([scan.stamp_ns for scan in scans], np.int64)
    return _Counts(stamps, {int(i): k for k, i in enumerate(doors.ids)}, through, stopped)


def _to_lines(scan: PlacedScan, lines: Floats) -> Floats:
    """Return how far each beam has to each door's line, (d, b); NaN: it does not cross it."""
    x, y, theta, width = (column[:, None] for column in lines.T)
    c, s = np.cos(theta), np.sin(theta)
    aside = -(scan.origins[:, 0] - x) * s + (scan.origins[:, 1] - y) * c
    on = (scan.origins[:, 0] - x) * c + (scan.origins[:, 1] - y) * s
    turned = scan.bearings - theta
    with np.errstate(divide="ignore", invalid="ignore"):
        far = -aside / np.sin(turned)
        at = on + far * np.cos(turned)
        crosses = (far > 0) & (at > PLAIN_EDGE_M) & (at < width - PLAIN_EDGE_M)
    found: Floats = np.where(crosses, far, math.nan)
    return found
