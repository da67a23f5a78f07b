"""A costmap over time as the messages that costmap_2d publishes of one.

On one topic the whole grid (nav_msgs/OccupancyGrid), on another what changed of it
(map_msgs/OccupancyGridUpdate): costmap_2d_publisher.cpp. RViz's map display takes the changes in;
Foxglove and rerun know the whole grids only, so those are repeated while the costmap changes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from semmap_log.costmap.costs import to_occupancy
from semmap_log.costmap.door_layer import bounds_of
from semmap_log.costmap.grid import GridGeometry, Window
from semmap_log.errors import OutputError
from semmap_log.formats.bags import BagTopic, NewBag
from semmap_log.formats.ros_types import GRID, GRID_UPDATE, RosVersion, ros_types

GRIDS = BagTopic("/semmap/costmap", GRID, is_latched=True)
UPDATES = BagTopic("/semmap/costmap_updates", GRID_UPDATE, is_latched=False)
"""RViz looks for the changes of a map under its topic's name and `_updates`."""

FRAME = "map"

LAST_STAMP_NS = 2**31 * 10**9
"""builtin_interfaces/Time counts its seconds in 31 bits: until January 2038."""


@dataclass(frozen=True, slots=True)
class GridFrame:
    """A costmap at a moment at which it changed."""

    at_ns: int
    costs: NDArray[np.uint8]
    """(height, width), row 0 at the lowest y; looked at before the next frame is asked for."""
    windows: Sequence[Window]
    """Where cells may have changed since the frame before."""


def write_grids(
    bag: NewBag,
    geometry: GridGeometry,
    frames: Iterable[GridFrame],
    *,
    every_ns: int,
    updates: bool,
) -> Counter[str]:
    """Write a costmap's frames: the first as a whole grid, then what changes.

    A whole grid follows a change at once, but not within `every_ns` of the one before: then it
    comes when that time is over, or at the end with the time of the last change. So at any moment
    the last whole grid is at most that much behind.

    Args:
        bag: Has both topics; that of the updates only if they are wanted.
        geometry: Of the frames.
        frames: Times ascending.
        every_ns: Between whole grids; 0: one at each change.
        updates: Write each change as a patch, too, as soon as it happens.

    Returns:
        How many messages went to each topic.

    Raises:
        OutputError: A time cannot be a ROS stamp.
    """
    publisher = _Publisher(bag, geometry, every_ns=every_ns, updates=updates)
    for frame in frames:
        publisher.take(frame)
    publisher.finish()
    return publisher.counts


class _Publisher:
    """Remembers what was published, and so which cells really changed."""

    def __init__(
        self, bag: NewBag, geometry: GridGeometry, *, every_ns: int, updates: bool
    ) -> None:
        self.counts: Counter[str] = Counter()
        self._bag = bag
        self._messages = _Messages(bag.ros_version, geometry)
        self._every_ns = every_ns
        self._updates = updates
        self._grid: NDArray[np.int8] | None = None
        """As it is after the last frame."""
        self._next_ns = 0
        """From then on the next whole grid may come."""
        self._changed_ns: int | None = None
        """When the grid last became another than the last whole one."""

    def take(self, frame: GridFrame) -> None:
        if self._changed_ns is not None and self._next_ns < frame.at_ns:
            self._publish_grid(self._next_ns)
        if self._grid is None:
            self._grid = to_occupancy(frame.costs)
            self._publish_grid(frame.at_ns)
            return
        for window in frame.windows:
            self._take_window(self._grid, window, frame)
        if self._changed_ns is not None and self._next_ns <= frame.at_ns:
            self._publish_grid(frame.at_ns)

    def finish(self) -> None:
        if self._changed_ns is not None:
            self._publish_grid(self._changed_ns)

    def _take_window(self, grid: NDArray[np.int8], window: Window, frame: GridFrame) -> None:
        before, after = grid[window.slices], to_occupancy(frame.costs[window.slices])
        for inside in bounds_of(before != after):
            before[inside.slices] = after[inside.slices]
            self._changed_ns = frame.at_ns
            if self._updates:
                x, y = window.x0 + inside.x0, window.y0 + inside.y0
                self._publish(UPDATES, frame.at_ns,
                              self._messages.update(frame.at_ns, self.counts[UPDATES.name],
                                                    x, y, after[inside.slices]))  # fmt: skip

    def _publish_grid(self, at_ns: int) -> None:
        assert self._grid is not None
        self._publish(GRIDS, at_ns, self._messages.grid(at_ns, self.counts[GRIDS.name], self._grid))
        self._next_ns, self._changed_ns = at_ns + self._every_ns, None

    def _publish(self, topic: BagTopic, at_ns: int, message: Any) -> None:
        self._bag.write(topic, at_ns, message)
        self.counts[topic.name] += 1


class _Messages:
    """Builds the messages, of ROS 1's classes or of ROS 2's."""

    def __init__(self, ros_version: RosVersion, geometry: GridGeometry) -> None:
        self._ros_version = ros_version
        self._types = ros_types(ros_version).types
        self._geometry = geometry

    def grid(self, at_ns: int, number: int, cells: NDArray[np.int8]) -> Any:
        geometry = self._geometry
        info = self._new(
            "nav_msgs/msg/MapMetaData",
            map_load_time=self._stamp(0),  # of a map, which this is not: unset, as ROS leaves it
            resolution=geometry.resolution,  # float32 on the wire
            width=geometry.width,
            height=geometry.height,
            origin=self._new(
                "geometry_msgs/msg/Pose",
                position=self._new(
                    "geometry_msgs/msg/Point", x=geometry.origin_x, y=geometry.origin_y, z=0.0
                ),
                orientation=self._new("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
            ),
        )
        return self._new(
            GRID, header=self._header(at_ns, number), info=info, data=cells.reshape(-1)
        )

    def update(self, at_ns: int, number: int, x: int, y: int, cells: NDArray[np.int8]) -> Any:
        height, width = cells.shape
        return self._new(
            GRID_UPDATE,
            header=self._header(at_ns, number),
            x=x,
            y=y,
            width=width,
            height=height,
            data=np.ascontiguousarray(cells).reshape(-1),
        )

    def _header(self, at_ns: int, number: int) -> Any:
        count = {"seq": number} if self._ros_version == 1 else {}
        return self._new("std_msgs/msg/Header", stamp=self._stamp(at_ns), frame_id=FRAME, **count)

    def _stamp(self, at_ns: int) -> Any:
        if not 0 <= at_ns < LAST_STAMP_NS:
            raise OutputError(
                f"a ROS message's stamp: expected a time from 1970 to January 2038, got @{at_ns}; "
                "choose another --since or --until."
            )
        seconds, nanoseconds = divmod(at_ns, 10**9)
        return self._new("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)

    def _new(self, name: str, **values: Any) -> Any:
        return self._types[name](**values)
