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

from semmap_log.analysis.costmap_2d.costs import to_occupancy
from semmap_log.analysis.costmap_2d.door_layer import bounds_of
from semmap_log.analysis.costmap_2d.grid import CellWindow, GridGeometry
from semmap_log.interop.formats.bags.bag_protocol import BagTopic, NewBag
from semmap_log.interop.formats.ros.ros_messages import Messages
from semmap_log.interop.formats.ros.ros_types import GRID, GRID_UPDATE, RosVersion

GRIDS = BagTopic("/semmap/costmap", GRID, is_latched=True)
UPDATES = BagTopic("/semmap/costmap_updates", GRID_UPDATE, is_latched=False)
"""RViz looks for the changes of a map under its topic's name and `_updates`."""


@dataclass(frozen=True, slots=True)
class GridFrame:
    """A costmap at a moment at which it changed."""

    at_ns: int
    costs: NDArray[np.uint8]
    """(height, width), row 0 at the lowest y; looked at before the next frame is asked for."""
    windows: Sequence[CellWindow]
    """Where cells may have changed since the frame before."""
    geometry: GridGeometry | None = None
    """From now on; None: as before. On another grid than before all of it is sent."""


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
        geometry: Of the frames, until one says otherwise.
        frames: Times ascending.
        every_ns: Between whole grids; 0: one at each change.
        updates: Write each change as a patch, too, as soon as it happens.

    Returns:
        How many messages went to each topic.

    Raises:
        OutputError: A time cannot be a ROS stamp.
    """
    stream = GridStream(bag, geometry, every_ns=every_ns, updates=updates)
    for frame in frames:
        stream.take(frame)
    stream.finish()
    return stream.counts


class GridStream:
    """Remembers what was published, and so which cells really changed."""

    def __init__(
        self,
        bag: NewBag,
        geometry: GridGeometry,
        *,
        every_ns: int,
        updates: bool,
        topics: tuple[BagTopic, BagTopic] = (GRIDS, UPDATES),
    ) -> None:
        """Begin; arguments as for `write_grids`, and the topics of grids and updates."""
        self.counts: Counter[str] = Counter()
        self._bag = bag
        self._of_grids, self._of_updates = topics
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
        """Publish what changed; frames come with ascending times."""
        if self._changed_ns is not None and self._next_ns < frame.at_ns:
            self._publish_grid(self._next_ns)
        if frame.geometry is not None and frame.geometry != self._messages.geometry:
            self._grid = None
            self._messages = _Messages(self._bag.ros_version, frame.geometry)
        if self._grid is None:
            self._grid = to_occupancy(frame.costs)
            self._publish_grid(frame.at_ns)
            return
        for window in frame.windows:
            self._take_window(self._grid, window, frame)
        if self._changed_ns is not None and self._next_ns <= frame.at_ns:
            self._publish_grid(frame.at_ns)

    def finish(self) -> None:
        """Publish what waits."""
        if self._changed_ns is not None:
            self._publish_grid(self._changed_ns)

    def _take_window(self, grid: NDArray[np.int8], window: CellWindow, frame: GridFrame) -> None:
        before, after = grid[window.slices], to_occupancy(frame.costs[window.slices])
        for inside in bounds_of(before != after):
            before[inside.slices] = after[inside.slices]
            self._changed_ns = frame.at_ns
            if self._updates:
                x, y = window.x0 + inside.x0, window.y0 + inside.y0
                number = self.counts[self._of_updates.name]
                self._publish(self._of_updates, frame.at_ns,
                              self._messages.update(frame.at_ns, number, x, y,
                                                    after[inside.slices]))  # fmt: skip

    def _publish_grid(self, at_ns: int) -> None:
        assert self._grid is not None
        number = self.counts[self._of_grids.name]
        self._publish(self._of_grids, at_ns, self._messages.grid(at_ns, number, self._grid))
        self._next_ns, self._changed_ns = at_ns + self._every_ns, None

    def _publish(self, topic: BagTopic, at_ns: int, message: Any) -> None:
        self._bag.write(topic, at_ns, message)
        self.counts[topic.name] += 1


class _Messages:
    """Builds the messages of a grid."""

    def __init__(self, ros_version: RosVersion, geometry: GridGeometry) -> None:
        self._messages = Messages(ros_version)
        self.geometry = geometry

    def grid(self, at_ns: int, number: int, cells: NDArray[np.int8]) -> Any:
        geometry = self.geometry
        origin = self._messages.pose(geometry.origin_x, geometry.origin_y)
        return grid_message(
            self._messages, at_ns, number, cells, resolution=geometry.resolution, origin=origin
        )

    def update(self, at_ns: int, number: int, x: int, y: int, cells: NDArray[np.int8]) -> Any:
        height, width = cells.shape
        return self._messages.new(
            GRID_UPDATE,
            header=self._messages.header(at_ns, number),
            x=x,
            y=y,
            width=width,
            height=height,
            data=np.ascontiguousarray(cells).reshape(-1),
        )


def grid_message(
    messages: Messages,
    at_ns: int,
    number: int,
    cells: NDArray[np.int8],
    *,
    resolution: float,
    origin: Any,
) -> Any:
    """Return a nav_msgs/OccupancyGrid.

    Args:
        messages: Of which ROS.
        at_ns: Its stamp.
        number: How many came before on its topic.
        cells: (height, width), row 0 at the lowest y.
        resolution: Metres a cell; float32 on the wire.
        origin: The pose of the lower left corner of cell (0, 0).
    """
    height, width = cells.shape
    info = messages.new(
        "nav_msgs/msg/MapMetaData",
        map_load_time=messages.stamp(0),  # when a server read a file, which none did: unset
        resolution=resolution,
        width=width,
        height=height,
        origin=origin,
    )
    header = messages.header(at_ns, number)
    return messages.new(GRID, header=header, info=info, data=cells.reshape(-1))
