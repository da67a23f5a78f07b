"""A visit to a door: its scans, the model's constants, and where the scans are kept.

    office/              the log
    office.scans/        next to it
      20260301T212000.123456789Z.mcap     the visits of one run, named after the first one

Each file is an MCAP of standard ROS 2 messages, for `ros2 bag play` and whatever reads bags:

- `/tf`: tf2_msgs/TFMessage, from `map` to the frame of the laser at each scan;
- `/<robot>/<laser>/scan`: sensor_msgs/LaserScan;
- `/<robot>/<laser>/pose`: geometry_msgs/PoseWithCovarianceStamped, how sure the place is;
- `/<robot>/<laser>/beams`: sensor_msgs/PointCloud2, frame `map`, where each beam began and ended:
  only of scans that a LaserScan cannot represent well, by a laser that moves while it turns;
- `/visits`: std_msgs/String, a JSON object: the door, its line then, what was found, its scans.

A scan is in a file once, before the first visit that it is of; a visit is one chunk with the scans
that are new, so that what a killed recorder leaves is read up to its last visit. The times of
chunks overlap, as visits do: the file's index puts messages in order.

A scan is of a planar laser whose beams have their places on the map. The scans of one laser are
stacked, one after the other, as arrays over all their beams. Those of the last minutes are kept in
memory, since a visit that ends needs the scans that it was made from.
"""

from __future__ import annotations

import re
from collections import defaultdict, deque
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from math import nan, radians
from pathlib import Path, PurePath
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from semmap_log.core.model.doors import DoorId, DoorState
from semmap_log.core.model.moments import SECOND_NS

FOLDER_SUFFIX = ".scans"
METADATA = "semmap_log_scans"
FORM = "1"
VISITS_TOPIC = "/visits"
TF_TOPIC = "/tf"
ROBOT_KEY, LASER_KEY = "semmap_robot", "semmap_laser"
"""In the metadata of a laser's channels."""
FORGET_NS = 120 * 10**9
"""A scan that old is no part of a visit that ends now."""

DoorLine = tuple[float, float, float, float]
"""x, y of the start m, theta rad, width m; frame `map`."""


@dataclass(frozen=True, slots=True, eq=False)
class KeptVisit:
    """A visit, and what it was made from."""

    visit: Visit
    level: int
    line: DoorLine
    """Of the door at that moment."""
    scans: tuple[PlacedScan, ...]
    """The scans, stamps ascending; empty if not requested."""
    event: int | None = None
    """Number of the DoorObserved or DoorPassed that it became; None: unknown, or none."""


class VisitReader(Protocol):
    """Reads the visits that are kept next to a log, file by file, in the order in which they ended.

    See `kept_visits`, which is one.
    """

    def __call__(
        self,
        log: PurePath,
        log_id: str,
        *,
        since_ns: int | None = None,
        until_ns: int | None = None,
        doors: Collection[DoorId] | None = None,
        with_scans: Callable[[Visit], bool] | None = None,
        tell: Callable[[str], None] | None = None,
    ) -> Iterator[KeptVisit]:
        """Yield the visits of these doors that ended in [since_ns, until_ns)."""
        ...


def visit_key(visit: Visit) -> tuple[object, ...]:
    """Return what makes a visit one: what it says may be another, by a later version."""
    return (visit.door_id, visit.first_ns, visit.passed, visit.robot, visit.laser)


def scans_folder(log: PurePath) -> Path:
    """Return the folder where the scans of a log are kept, whether it is there or not."""
    folder = Path(log).resolve()
    return folder.with_name(folder.name + FOLDER_SUFFIX)


def file_name(first_ns: int, number: int) -> str:
    """Return what the file of a run is called that begins with a visit at that time.

    Args:
        first_ns: When the visit began.
        number: How many files are called so already.
    """
    seconds, nanoseconds = divmod(first_ns, 10**9)
    stamp = datetime.fromtimestamp(seconds, timezone.utc).strftime("%Y%m%dT%H%M%S")
    return f"{stamp}.{nanoseconds:09d}Z{f'-{number}' if number else ''}.mcap"


def topic_part(name: str) -> str:
    """Return a name as part of a ROS topic."""
    part = re.sub(r"[^A-Za-z0-9_]+", "_", name).strip("_")
    return f"n{part}" if part[:1].isdigit() else part


Floats = NDArray[np.float64]
Rows = NDArray[np.intp]

LEAST_RANGE = 0.02
"""m; what is nearer was not measured."""
LARGEST_RANGE = 1000.0
"""m; a laser that reports more means that it does not know."""
LARGEST_SD = 10.0
"""m, or rad: whoever reports more does not know where the robot is."""
FARTHEST = 1e7
"""m from the map's origin; what is farther is no place on Earth."""


@dataclass(frozen=True, slots=True, eq=False)
class ScanStack:
    """`t` scans of `n` beams in all; within a scan the bearings ascend."""

    stamps_ns: NDArray[np.int64]
    """(t,)"""
    levels: NDArray[np.int64]
    """(t,)"""
    places: Floats
    """(t, 2) of the laser in the middle of its turn, m."""
    sd_xy: Floats
    sd_theta: Floats
    """(t,) as reported, else the model's; m, rad."""
    max_range: Floats
    """(t,) m"""
    begins: Rows
    """(t + 1,) the beams of scan i are begins[i] to begins[i + 1]."""
    origins: Floats
    """(n, 2) m"""
    bearings: Floats
    """(n,) rad"""
    ranges: Floats
    """(n,) m; inf: nothing came back; NaN: says nothing."""
    keys: Floats
    """(n,) ascending: bearings since each scan's first beam, the scans `apart` from each other."""
    apart: float
    """rad"""

    @classmethod
    def of(cls, scans: Sequence[PlacedScan], model: ScanModel) -> ScanStack:
        """Return scans that have no `misfit` as arrays."""
        ways = [slice(None, None, 1 if _ascends(scan.bearings) else -1) for scan in scans]
        turned = list(zip(scans, ways, strict=True))
        counts = np.array([len(scan.bearings) for scan in scans], np.intp)
        begins = np.concatenate([[0], np.cumsum(counts)]).astype(np.intp)
        bearings = np.concatenate([scan.bearings[way] for scan, way in turned])
        since = bearings - np.repeat(bearings[begins[:-1]], counts)
        apart = float(since.max()) + 8 * np.pi
        return cls(
            stamps_ns=np.array([scan.stamp_ns for scan in scans], np.int64),
            levels=np.array([scan.level for scan in scans], np.int64),
            places=np.array([scan.origins[len(scan.origins) // 2] for scan in scans], np.float64),
            sd_xy=_told([scan.sd_xy for scan in scans], model.sd_xy, model.least_sd_xy),
            sd_theta=_told([scan.sd_theta for scan in scans], model.sd_theta, model.least_sd_theta),
            max_range=np.minimum([scan.max_range for scan in scans], LARGEST_RANGE),
            begins=begins,
            origins=np.concatenate([scan.origins[way] for scan, way in turned]),
            bearings=bearings,
            ranges=np.concatenate([_cleaned(scan)[way] for scan, way in turned]),
            keys=since + apart * np.repeat(np.arange(len(counts)), counts),
            apart=apart,
        )

    def between(self, scan: Rows, start: Floats, extent: Floats) -> tuple[Rows, Rows]:
        """Return the first beam from `start` on, rad since each scan's first, and how many follow.

        All scans are searched at once, since their keys follow one another.
        """
        first = self.apart * scan + np.maximum(start, -np.pi)
        last = self.apart * scan + np.clip(start + extent, -np.pi, self.apart - 2 * np.pi)
        low = np.searchsorted(self.keys, first, side="left")
        high = np.searchsorted(self.keys, last, side="right")
        return low, np.maximum(high - low, 0)


def misfit(scan: PlacedScan) -> str:
    """Return why a scan cannot be used; empty if it can."""
    beams = len(scan.bearings)
    if not beams:
        return "no beams"
    if len(scan.ranges) != beams or scan.origins.shape != (beams, 2):
        return "ranges, bearings and origins differ in number"
    if not (np.isfinite(scan.origins).all() and np.isfinite(scan.bearings).all()):
        return "a place or a bearing is not finite"
    if np.abs(scan.origins).max() > FARTHEST or np.abs(scan.bearings).max() > FARTHEST:
        return "a place or a bearing is too large"
    steps = np.diff(scan.bearings)
    if not ((steps > 0).all() or (steps < 0).all()):
        return "bearings are not in order"
    if not scan.max_range > 0:
        return "no largest range"
    return ""


def _ascends(bearings: Floats) -> bool:
    return bool(bearings[-1] >= bearings[0])


def _cleaned(scan: PlacedScan) -> Floats:
    """Return the ranges; inf beyond the largest, NaN where nothing was measured."""
    largest = min(scan.max_range, LARGEST_RANGE)
    ranges = np.where(scan.ranges >= largest, np.inf, scan.ranges)
    return np.where(ranges > LEAST_RANGE, ranges, np.nan)


def _told(values: Sequence[float], default: float, least: float) -> Floats:
    """Return standard deviations, none below the least; the default where none is given."""
    told = np.array(values, np.float64)
    return np.clip(np.where(told >= 0, told, default), least, LARGEST_SD)


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanModel:
    """The numbers of the beam model and of a visit; lengths m, angles rad, times s."""

    sd_range: float = 0.02
    """Noise of a range."""
    sd_xy: float = 0.05
    """Of the laser's place along each axis, if the scan has none."""
    sd_theta: float = radians(1.0)
    """Of its heading, if the scan has none."""
    least_sd_xy: float = 0.02
    least_sd_theta: float = radians(0.3)
    """Reported standard deviations below these are not believed."""
    sd_door: float = 0.04
    """Of a leaf's place against the map: recesses, mouldings, the drawing."""

    reach: float = 6.0
    """Doors whose middle is farther away are not judged."""
    least_off: float = 0.30
    """Nearer to the door's line the laser sees it edge on."""
    flattest: float = radians(25.0)
    """Angle between beam and line below which a beam is not used: flatter ones end on the frame."""
    margin: float = 0.10
    """Of the line at both ends: taken by the frame."""
    beams: int = 12
    """Used of one door in one scan, evenly spaced."""
    tolerance: float = 0.15
    """A beam that ends so near to the line ended on it."""
    deep: float = 0.5
    """A beam that ended further beyond the line ended in the room, whatever the pose."""
    beside: float = 0.7
    """How far from a door's ends the wall is looked at."""
    side_beams: int = 4
    """Used of the wall at each end."""

    short: float = 0.15
    """P(something stands in front)."""
    stray: float = 0.03
    """P(a range that means nothing): mixed pixels."""
    through_leaf: float = 0.01
    """P(a beam passes a leaf)."""
    through_glass: float = 0.6
    """The same of a glass door."""
    lost: float = 0.05
    """P(no return) of what is in range."""
    room: float = 3.0
    """Mean depth of what lies beyond a door."""
    before: float = 0.15
    """A leaf nearer to the robot than the line by more looks like anybody who stands there ..."""
    persuades: float = 0.4
    """... and counts for so much less."""
    blurred: float = 0.08
    """A leaf's ends are known so well at best: nearer to them a beam may meet it, or may not."""
    wall_in_line: float = 0.7
    """P(the wall next to a door is in its line)."""
    wall_there: float = 0.6
    """P(a beam next to the door ends on the wall, if it is in line)."""

    cell: float = 0.10
    """Beams nearer to each other on the line count once."""
    looks_a_scan: float = 4.0
    """What a scan is worth at most."""
    step: float = 0.25
    """A scan this far from the last one is new altogether; nearer ones are worth less."""
    still_s: float = 120.0
    """A robot that stands gets one new scan's worth in this time."""
    least_fresh: float = 0.45
    """Scans are left out until one is worth this much ..."""
    least_often_s: float = 2.0
    """... or the last that was looked at is this old."""
    most_looks: float = 20.0
    """What a visit can be worth, however much it saw."""
    pause_s: float = 10.0
    """A visit ends this long after the door was last seen ..."""
    longest_s: float = 30.0
    """... or this long after it was first seen."""
    stand: float = 0.5
    """A laser that is no farther from where it was stands."""
    same_again_s: float = 1800.0
    """From one stand the same state of a door is reported again after this: a patrol's pace."""

    enough: float = 0.7
    """Looks through the line, or on it, that a verdict needs."""
    most_deep: float = 0.3
    """CLOSED needs that fewer looks went deep, as a share of those that ended on the line."""
    least_seen: float = 0.2
    """Share of the beams of a scan towards the door that come as far: fewer are strays, and the
    door is out of sight."""
    most_hidden: float = 0.8
    """Share of the beams towards the door that something before it stopped: more, and what the
    others met is as likely its edge as the door."""
    least_accuracy: float = 0.8
    """Below it there is no verdict."""
    most_ajar_shut: float = 0.5
    most_ajar_open: float = 0.125
    """P(ajar) above which the verdict is not CLOSED, or not OPEN."""
    lapse: float = 0.008
    """P(the visit means nothing at all): a wrong map, another door, glass that nobody annotated."""
    passed_accuracy: float = 0.999
    """Of OPEN, where the robot drove through."""


DEFAULT = ScanModel()


KEPT_NS = round((DEFAULT.longest_s + DEFAULT.pause_s) * SECOND_NS)
"""A visit that takes longest ends so long after its first scan."""


class RecentScans:
    """Holds the scans of each laser of each robot for a while."""

    def __init__(self, kept_ns: int = KEPT_NS) -> None:
        self._kept_ns = kept_ns
        self._of: defaultdict[tuple[str, str], deque[PlacedScan]] = defaultdict(deque)

    def take(self, scan: PlacedScan) -> None:
        """Take the next scan of its laser."""
        self._of[scan.robot, scan.laser].append(scan)

    def forget_old(self) -> None:
        """Let go of scans that no visit is made from that is still going on.

        After a clock was set back those of before end none: their visits have ended.
        """
        for here in self._of.values():
            last_ns = here[-1].stamp_ns
            while not last_ns - self._kept_ns <= here[0].stamp_ns <= last_ns:
                here.popleft()

    def of(self, visit: Visit) -> list[PlacedScan]:
        """Return the scans between the first and the last that the visit was made from."""
        here = self._of.get((visit.robot, visit.laser), ())
        return [scan for scan in here if visit.first_ns <= scan.stamp_ns <= visit.last_ns]


@dataclass(frozen=True, slots=True, kw_only=True)
class Visit:
    """A door was looked at for a while, from one robot, and this is what the scans say."""

    door_id: DoorId
    first_ns: int
    """Stamp of the first scan that saw the door."""
    last_ns: int
    scans: int
    state: DoorState
    """OPEN, CLOSED or UNKNOWN: undecided."""
    accuracy: float
    """P(this state is right), for both states alike: accuracy / (1 - accuracy) is the likelihood
    ratio of open to shut, free of any prior. 0.5 to 1."""
    opening: float
    """The clear share of the width that is expected, 0..1; NaN: nothing was seen of it."""
    ajar: float
    """P(neither shut nor open)."""
    looks: float
    """How many independent looks it is worth."""
    through: float
    """Looks that went through the line; the robot where it is believed to be."""
    stopped: float
    """Looks that ended on it."""
    behind_m: float
    """Where beams within half a metre of the line ended, beyond (+) or before (-) it: the average,
    m, square to it; NaN: none did. For a door that is not shut it means nothing."""
    near: float = 0.0
    """How many looks that is."""
    passed: bool = False
    """The robot drove through."""
    p_open: float = nan
    """P(open | open or shut), before which both are alike; NaN: nothing was seen of it."""
    leaves: tuple[tuple[float, float, float, float], ...] = ()
    """How its leaves stand most likely: x, y of one end and of the other, m, frame `map`; none: out
    of sight."""
    why: str = ""
    """Why it is UNKNOWN, in a few words; empty: it is not."""
    laser: str = ""
    """Which of the robot's lasers saw most of it."""
    robot: str = ""
    side: int = 0
    """The side it was seen from: 1 the left of its line, -1 the right, 0 both or unknown."""
    told_ns: int = 0
    """When the same state was last reported from the same stand; 0: it is new. See `Stands`."""


@dataclass(frozen=True, slots=True, eq=False)
class PlacedScan:
    """One scan on the map of a level: where each beam begins, where it points, how far it went.

    A laser that moves while it turns, hangs upside down or is tilted is worked in by whoever places
    the scan: `origins` and `bearings` are those of each beam at its own moment.
    """

    stamp_ns: int
    """Of the first beam, nanoseconds since 1970."""
    level: int
    laser: str
    """Which laser: its frame."""
    origins: NDArray[np.float64]
    """(b, 2) m, frame `map`."""
    bearings: NDArray[np.float64]
    """(b,) rad, frame `map`; unwrapped: neighbours differ by less than pi, all in one direction."""
    ranges: NDArray[np.float64]
    """(b,) m along the floor; inf: the beam did not come back (no return, out of range); NaN: it
    was not measured, and says nothing."""
    max_range: float
    """m; farther than that a beam does not come back."""
    sd_xy: float = nan
    """Standard deviation of the laser's place on the map along each axis, m; NaN: unknown."""
    sd_theta: float = nan
    """Of its heading, rad; NaN: unknown."""
    robot: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class DoorPlaces:
    """The doors of a moment that have a place: rows belong together."""

    ids: NDArray[np.int64]
    """(n,)"""
    levels: NDArray[np.int64]
    """(n,) level numbers."""
    lines: NDArray[np.float64]
    """(n, 4): x, y of the start m, theta rad, width m; frame `map`."""
    kinds: tuple[str, ...]
    """(n,) the annotation `kind`: hinged, double, sliding, folding, …; empty: not known."""
    glass: NDArray[np.bool_]
    """(n,) the annotation `glass`."""
