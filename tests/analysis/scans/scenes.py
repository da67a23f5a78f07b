"""A corridor with one door in it, as a laser sees it: cast by hand, segment by segment."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import cos, nan, pi, sin

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.scans.door_watcher import DoorWatcher
from semmap_log.analysis.scans.visit import DoorPlaces, PlacedScan, Visit
from semmap_log.core.model.doors import DoorId
from tests.analysis.scans.beams import ranges_at

Segment = tuple[float, float, float, float]
Floats = NDArray[np.float64]
WIDTH = 0.9
DOOR = DoorId(7)
LINE = (0.0, 1.0, 0.0, WIDTH)
"""The corridor runs along x, its walls at y = -1 and y = 1; the room is behind y = 1."""
WALLS: tuple[Segment, ...] = (
    (-20, 1, 0, 1), (WIDTH, 1, 20, 1), (-20, -1, 20, -1),
    (-2, 1, -2, 4.5), (3, 1, 3, 4.5), (-2, 4.5, 3, 4.5),
)  # fmt: skip
ANGLES = np.radians(np.linspace(-135, 135, 361))


def leaf(angle_deg: float, *, at_end: bool = False, side: int = 1, recess: float = 0) -> Segment:
    """Return a leaf of the door; positive angles on side 1 are in the room."""
    hinge = (WIDTH if at_end else 0.0, 1.0 + recess)
    turn = side * angle_deg * pi / 180
    along = (-cos(turn) if at_end else cos(turn)) * WIDTH
    return (*hinge, hinge[0] + along, hinge[1] + sin(turn) * WIDTH)


def places(
    line: Sequence[float] = LINE, *, kind: str = "", glass: bool = False, door: int = DOOR
) -> DoorPlaces:
    """Return one door."""
    return DoorPlaces(
        ids=np.array([door]),
        levels=np.array([0]),
        lines=np.array([line], float),
        kinds=(kind,),
        glass=np.array([glass]),
    )


def joined(parts: Sequence[DoorPlaces]) -> DoorPlaces:
    """Return all these doors."""
    return DoorPlaces(
        ids=np.concatenate([part.ids for part in parts]),
        levels=np.concatenate([part.levels for part in parts]),
        lines=np.concatenate([part.lines for part in parts]),
        kinds=tuple(kind for part in parts for kind in part.kinds),
        glass=np.concatenate([part.glass for part in parts]),
    )


def cast(pose: Sequence[float], segments: Iterable[Segment], angles: Floats = ANGLES) -> Floats:
    """Return how far each beam goes from x, y, theta; inf: into the open."""
    return ranges_at(pose[:2], pose[2] + angles, segments)


@dataclass(frozen=True)
class Drive:
    """A robot that drives past, or stands, and what it sees and believes."""

    segments: tuple[Segment, ...]
    poses: tuple[tuple[float, float, float], ...]
    every_s: float = 0.5
    start_s: float = 1000.0
    error: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of what it believes: x, y m, theta rad."""
    noise: float = 0.01
    robot: str = ""
    laser: str = "front"
    sd_xy: float = nan
    sd_theta: float = nan
    max_range: float = 30.0

    def scans(self) -> list[PlacedScan]:
        rng = np.random.default_rng(5)
        found = []
        for i, pose in enumerate(self.poses):
            ranges = cast(pose, self.segments)
            ranges = ranges + rng.normal(0, self.noise, len(ranges))
            believed = np.array(pose) + self.error
            found.append(
                PlacedScan(
                    stamp_ns=round((self.start_s + i * self.every_s) * 1e9),
                    level=0,
                    laser=self.laser,
                    origins=np.tile(believed[:2], (len(ranges), 1)),
                    bearings=believed[2] + ANGLES,
                    ranges=ranges,
                    max_range=self.max_range,
                    sd_xy=self.sd_xy,
                    sd_theta=self.sd_theta,
                    robot=self.robot,
                )
            )
        return found


def past(*leaves: Segment, start: float = -2.0, stop: float = 3.0, **how: object) -> Drive:
    """Return a robot that drives along the corridor, a quarter of a metre a scan."""
    track = tuple((x, 0.0, 0.0) for x in np.arange(start, stop, 0.25).tolist())
    return Drive((*WALLS, *leaves), track, **how)  # type: ignore[arg-type]


def seen(scans: Sequence[PlacedScan], doors: DoorPlaces, *, at_once: int = 1000) -> list[Visit]:
    """Return all visits, scans taken so many at a time."""
    watcher = DoorWatcher()
    visits: list[Visit] = []
    for start in range(0, len(scans), at_once):
        visits += watcher.take(scans[start : start + at_once], doors)
    return visits + watcher.close()


def the_visit(scans: Sequence[PlacedScan], doors: DoorPlaces) -> Visit:
    """Return the one visit there is."""
    (visit,) = seen(scans, doors)
    return visit


def moved(scan: PlacedScan, x: float, y: float, turn: float) -> PlacedScan:
    """Return a scan of the world turned about its origin, then moved."""
    c, s = cos(turn), sin(turn)
    return replaced(
        scan,
        origins=scan.origins @ np.array([[c, s], [-s, c]]) + (x, y),
        bearings=scan.bearings + turn,
    )


def replaced(scan: PlacedScan, **fields: object) -> PlacedScan:
    """Return a scan with other fields."""
    names = PlacedScan.__dataclass_fields__
    return PlacedScan(**{name: fields.get(name, getattr(scan, name)) for name in names})
