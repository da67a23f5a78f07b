"""Drives through simulated buildings, as `scan_eval.proposal_scores` takes them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import atan2, hypot
from pathlib import Path

import numpy as np
from patrol_sim.laser_doors import DoorLife
from patrol_sim.laser_judging import Pose, placed_scans, seen_through
from patrol_sim.laser_plan import read_plan
from patrol_sim.laser_pose import PoseError, localised
from patrol_sim.laser_sensor import Laser
from patrol_sim.laser_world import Patrol, World, simulated

from scan_eval.proposal_scores import Doorway, Drive
from semmap_log.analysis.scans.proposing.proposals import proposals_of
from semmap_log.analysis.scans.proposing.swept_cells import KeptScans
from semmap_log.analysis.scans.visit import DoorPlaces
from semmap_log.interop.importing.door_proposing import walls_of

BUILDINGS = (
    ("rmf_clinic/clinic", 1), ("rmf_clinic/clinic", 2), ("rmf_hotel/hotel", 2),
    ("rmf_office/office", 1),
)  # fmt: skip
"""Seeds take turns in these: plan, level."""
POSE = Pose("5 cm, 1 deg, told", PoseError(0.05, 1.0), told=True)
NO_DOORS = DoorPlaces(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 4)), (), np.zeros(0, bool))


@dataclass(frozen=True, slots=True)
class Seen:
    """One drive, its doors proposed twice."""

    with_plan: Drive
    """By the walls of the floor plan."""
    without: Drive
    """By walls that the scans draw."""


def simulated_drives(
    maps: Path, seeds: Sequence[int], *, minutes: float, hz: float,
    tell: Callable[[str], None] = lambda _words: None,
) -> Iterator[Seen]:  # fmt: skip
    """Yield a drive for each seed, each in the building whose turn it is.

    Raises:
        FormatError: A plan cannot be read.
    """
    for seed in seeds:
        name, level = BUILDINGS[seed % len(BUILDINGS)]
        plan = read_plan(maps / f"{name}.building.yaml", level)
        patrol = simulated(plan, World(), Laser(hz=hz), seed=seed, minutes=minutes)
        yield seen_on(patrol)
        tell(f"seed {seed}: {name}, level {level}")


def seen_on(patrol: Patrol) -> Seen:
    """Return the doors that a patrol shows, and those that are there."""
    scans = [*patrol.scanned()]
    kept = KeptScans()
    where = localised(patrol.track, POSE.error, seed=patrol.seed)
    kept.take(placed_scans(patrol, scans, where, POSE))
    seen = seen_through(patrol, scans)
    doorways = [_doorway(life, is_seen=door in seen) for door, life in patrol.lives.items()]
    walls = walls_of(patrol.plan.floor)
    return Seen(
        Drive(doorways, proposals_of(kept.scans, NO_DOORS, walls)),
        Drive(doorways, proposals_of(kept.scans, NO_DOORS)),
    )


def _doorway(life: DoorLife, *, is_seen: bool) -> Doorway:
    body = life.body
    start, end = body.ends
    along = end - start
    x, y = map(float, start)
    return Doorway(
        x, y, atan2(along[1], along[0]), hypot(*along),
        kind=body.kind, hinge_at_end=body.hinge_at_end,
        is_seen=is_seen,
    )  # fmt: skip
