"""Where the scans of visits are kept, and how.

    office/              the log
    office.scans/        beside it
      20260301T212000.123456789Z.mcap     the visits of one run, named after the first one

Each file is an MCAP of standard ROS 2 messages, for `ros2 bag play` and whatever reads bags:

- `/tf`: tf2_msgs/TFMessage, from `map` to the frame of the laser at each scan;
- `/<robot>/<laser>/scan`: sensor_msgs/LaserScan;
- `/<robot>/<laser>/pose`: geometry_msgs/PoseWithCovarianceStamped, how sure the place is;
- `/<robot>/<laser>/beams`: sensor_msgs/PointCloud2, frame `map`, where each beam began and ended:
  only of scans that a LaserScan cannot tell well, by a laser that moves while it turns;
- `/visits`: std_msgs/String, a JSON object: the door, its line then, what was found, its scans.

A scan is in a file once, before the first visit that it is of; a visit is one chunk with the scans
that are new, so that what a killed recorder leaves is read up to its last visit. The times of
chunks overlap, as visits do: the file's index puts messages in order.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path, PurePath
from typing import Protocol

from semmap_log.analysis.scans.placed_scan import PlacedScan
from semmap_log.analysis.scans.visit import Visit
from semmap_log.core.model.doors import DoorId

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
    """Stamps ascending; empty if they were not asked for."""
    event: int | None = None
    """Number of the DoorObserved or DoorPassed that it became; None: not told, or none."""


class VisitReader(Protocol):
    """Reads the visits that are kept beside a log, file by file, in the order in which they ended.

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


def folder_beside(log: PurePath) -> Path:
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
