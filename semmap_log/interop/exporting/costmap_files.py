"""A costmap as a file for map_server and Nav2, people or numpy: written whole, or not at all.

A costmap over time becomes a bag, for ROS's players: RViz, Foxglove, rerun.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import are_on_map
from semmap_log.analysis.costmap_2d.keepout import keepout_mask
from semmap_log.analysis.costmaps import Costmap, CostmapFrame, CostmapOptions, costmap_frames
from semmap_log.core.io.disk import (
    atomic_file,
    check_outside_log,
    log_name,
    output_errors,
    replace_file,
)
from semmap_log.core.io.progress import Progress
from semmap_log.core.lazily import computed_once
from semmap_log.core.model.doors import Door, middle_of
from semmap_log.core.model.events import FloorMap
from semmap_log.core.model.moments import Time, format_local
from semmap_log.errors import FormatError
from semmap_log.interop.formats.bags.bag_reading import bytes_of, new_bag
from semmap_log.interop.formats.files.map_server_out import write_costs, write_map
from semmap_log.interop.formats.ros.door_messages import GRIDS, UPDATES, GridFrame, write_grids
from semmap_log.log import DoorLog, Scope
from semmap_log.views.costmap_picture import DoorMark, costmap_png

Part = Literal["master", "door", "keepout"]
"""Everything together; the doors alone; a mask of closed doors for Nav2's keepout filter."""

WRITABLE = ".yaml or .pgm (both are written: a ROS map), .png (a picture), .npy (the costs)"


@dataclass(frozen=True, slots=True)
class CostmapFile:
    """What was written."""

    files: tuple[Path, ...]
    doors: tuple[Door, ...]
    """Those that it shows, ids ascending."""
    left_out: tuple[tuple[Door, str], ...]
    """The others, with the reason."""
    values: NDArray[Any]
    """The cells, (height, width), row 0 at the lowest y: uint8 costs, or the mask's int8 values."""


def write_costmap(
    log: DoorLog, costmap: Costmap, out: Path, part: Part = "master", *, scope: Scope = Scope()
) -> CostmapFile:
    """Write a file in the format of its extension; old files of that name are replaced at once.

    `.npy` holds the costs themselves: uint8, (height, width), row 0 at the lowest y. A ROS map and
    the keepout mask hold the values that costmap_2d publishes of them.

    Args:
        log: Whose costmap it is: for the title.
        costmap: Of any moment.
        out: The file; `.yaml` and `.pgm` are written together, whichever is named.
        part: What of it.
        scope: Of which moment it is: for the title.

    Raises:
        FormatError: The name has no known extension, or its format cannot hold that part.
        OutputError: The file cannot be written; what was there is whole.
    """
    check_outside_log(log.path, out)
    write = _writer(out, part)
    shown, left_out = _sorted(costmap)
    page = _Page(costmap, part, shown, _title(log, costmap, part, scope))
    return CostmapFile(write(out, page), tuple(shown), tuple(left_out), page.values)


@dataclass(frozen=True)
class _Page:
    """What is to be written."""

    costmap: Costmap
    part: Part
    doors: list[Door]
    title: str

    @computed_once
    def values(self) -> NDArray[Any]:
        """Costs, or the mask."""
        if self.part == "keepout":
            return keepout_mask(self.costmap.layer.costs)
        return self.costmap.layer.costs if self.part == "door" else self.costmap.master.costs


def _writer(out: Path, part: Part) -> Callable[[Path, _Page], tuple[Path, ...]]:
    writers = {".yaml": _ros_map, ".pgm": _ros_map, ".png": _picture, ".npy": _array}
    if out.suffix not in writers:
        raise FormatError(out, f"unknown extension for a costmap; expected one of: {WRITABLE}.")
    if part == "keepout" and writers[out.suffix] is not _ros_map:
        raise FormatError(out, "a keepout mask is a ROS map: expected a name in .yaml or .pgm.")
    return writers[out.suffix]


def _ros_map(out: Path, page: _Page) -> tuple[Path, ...]:
    write = write_map if page.part == "keepout" else write_costs
    write(out, page.values, page.costmap.geometry, comment=page.title)
    return out.with_suffix(".yaml"), out.with_suffix(".pgm")


def _picture(out: Path, page: _Page) -> tuple[Path, ...]:
    marks = [
        DoorMark(door.door_id, door.name, *start, *end, door.state)
        for door in page.doors
        for start, end in [_marked(door)]
    ]
    png = costmap_png(page.values, page.costmap.geometry, marks, title=page.title)
    with output_errors(out):
        replace_file(out, png)
    return (out,)


def _marked(door: Door) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the ends of the line that marks a door; an area is marked at its middle."""
    if not door.outline:
        return door.start, door.end
    middle = middle_of(door.outline)
    return middle, middle


def _array(out: Path, page: _Page) -> tuple[Path, ...]:
    with output_errors(out), atomic_file(out) as temporary, temporary.open("wb") as file:
        np.save(file, page.values)
    return (out,)


def _sorted(costmap: Costmap) -> tuple[list[Door], list[tuple[Door, str]]]:
    """Return the doors that are drawn, and the others with the reason."""
    doors, lines = costmap.doors, costmap.lines
    on_map = are_on_map(costmap.geometry, list(lines.values()))
    drawn = {door for door, is_on in zip(lines, on_map.tolist(), strict=True) if is_on}
    shown: list[Door] = []
    left_out: list[tuple[Door, str]] = []
    only = costmap.options.object_class
    for door in doors.doors.values():
        if only not in (None, door.object_class.name):
            continue
        if not door.is_placed:
            left_out.append((door, "without a place"))
        elif door.level != costmap.level:
            left_out.append((door, f"on level {doors.level_name(door.level)}"))
        elif door.door_id not in lines:
            left_out.append((door, "of which nothing blocks"))
        elif door.door_id not in drawn:
            left_out.append((door, "off the map"))
        else:
            shown.append(door)
    return shown, left_out


def _title(log: DoorLog, costmap: Costmap, part: Part, scope: Scope) -> str:
    doors, tz = costmap.doors, log.info.timezone
    what = {"master": "costmap", "door": "door layer", "keepout": "keepout mask"}[part]
    level = f", level {doors.level_name(costmap.level)}" if len(doors.levels) > 1 else ""
    bounds = [] if scope.at_ns is None else [format_local(scope.at_ns, tz)]
    if scope.known_at_ns is not None:
        bounds.append(f"as known at {format_local(scope.known_at_ns, tz)}")
    if scope.event is not None:
        bounds.append(f"up to event {scope.event}")
    if not bounds and doors.event >= 0:
        bounds.append(format_local(doors.latest_ns, tz))
    return ", ".join([f"{log_name(log.path)}{level}: {what}", *bounds])


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
        progress: Called with how much of the time is done, in ns.

    Raises:
        CostmapError: As for `costmap_at`.
        FormatError: The name is not that of a bag.
        OutputError: It cannot be written; what was there is whole.
    """
    check_outside_log(log.path, out)
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
