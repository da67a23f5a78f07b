"""A log's costmap over time as a bag, for ROS's players: RViz, Foxglove, rerun."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Literal

from semmap_log.analysis.costmaps import CostmapFrame, CostmapOptions, costmap_frames
from semmap_log.core.io.disk import refuse_own_folder
from semmap_log.core.io.progress import Progress
from semmap_log.core.model.events import FloorMap
from semmap_log.core.model.keywords import knows_keywords
from semmap_log.interop.formats.bags.bag_writing import bytes_of, new_bag
from semmap_log.interop.formats.ros.grid_messages import GRIDS, UPDATES, GridFrame, write_grids
from semmap_log.log.door_log.door_log import DoorLog, Time

Which = Literal["master", "door"]
"""Floor, doors and the costs around them; or the doors alone."""

EVERY_S = 60.0
"""A week of a clinic's level, 1,097 x 970 cells inflated by 0.5 m, is then an .mcap of 20 MB. All
its 2,600 changes as whole grids would be 38 MB, and 2.8 GB to whoever unpacks them; once an hour
would be 3 MB, but who knows no updates would look at a door as it was an hour ago."""


@dataclass(frozen=True, slots=True)
class RecordedCostmap:
    """What was written."""

    grids: int
    updates: int
    bytes: int


@knows_keywords
def record_costmap(
    log: DoorLog,
    out: Path,
    options: CostmapOptions = CostmapOptions(),
    *,
    since: Time = None,
    until: Time = None,
    which: Which = "master",
    every_s: float = EVERY_S,
    updates: bool = True,
    floor: FloorMap | None = None,
    progress: Progress | None = None,
) -> RecordedCostmap:
    """Write the costmap as nav_msgs/OccupancyGrid, and its changes as OccupancyGridUpdate.

    Args:
        log: The log.
        out: `.mcap`, `.bag` (ROS 1) or, without an extension, a rosbag2 folder; written whole or
            not at all. A file that was there is replaced, a folder never.
        options: Which level, and what is drawn how.
        since: The first grid shows this moment; default: before the first event.
        until: The last moment; default: the log's end.
        which: Grid of the master, or of the door layer.
        every_s: Whole grids come at most so often; at a change, or that much later. 0: at each.
        updates: Each change as a patch, too, when it happens; RViz takes them in.
        floor: As for `costmap_at`.
        progress: Told how much of the time is done, in ns.

    Raises:
        CostmapError: As for `costmap_at`.
        FormatError: The name tells no bag.
        OutputError: It cannot be written; what was there is whole.
    """
    refuse_own_folder(log.path, out)
    frames = costmap_frames(log, options, since=since, until=until, floor=floor)
    first = next(frames)  # before the file is begun: what is wrong with the question shows here
    until_ns = log.instant(until)
    end_ns = log.end_ns() if until_ns is None else until_ns
    with new_bag(out, [GRIDS, UPDATES] if updates else [GRIDS]) as bag:
        counts = write_grids(
            bag,
            first.costmap.geometry,
            _grid_frames(chain([first], frames), which, end_ns, progress),
            every_ns=round(every_s * 1e9),
            updates=updates,
        )
    return RecordedCostmap(counts[GRIDS.name], counts[UPDATES.name], bytes_of(out))


def _grid_frames(
    frames: Iterable[CostmapFrame], which: Which, end_ns: int, progress: Progress | None
) -> Iterator[GridFrame]:
    first_ns = None
    for frame in frames:
        first_ns = frame.at_ns if first_ns is None else first_ns
        if progress is not None:
            progress(frame.at_ns - first_ns, end_ns - first_ns)
        grid = frame.costmap.master if which == "master" else frame.costmap.layer
        yield GridFrame(frame.at_ns, grid.costs, frame.windows, frame.costmap.geometry)
