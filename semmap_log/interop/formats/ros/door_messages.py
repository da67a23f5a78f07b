"""Doors and costmaps as messages that existing displays take.

Markers, for RViz, Foxglove and Lichtblick: a leaf in the state's colour, and its name. Every
message is complete: first a marker that deletes all, then those of all doors. When a player seeks,
Foxglove and Lichtblick remove all markers and load the last message of each topic, that one alone
(Lichtblick's `Renderer.handleSeek` and `McapIndexedIterableSource.getBackfillMessages`); of
messages with changes alone they would show the last change. And RViz, where a bag is played from
an earlier time, deletes nothing by itself. The markers' stamps are 0, and they are frame-locked:
good at any time, however old.

The thesis's DoorMap (4.2.5, appendix C) is what its costmap layer and OPRS listen to.

A costmap over time goes out as costmap_2d publishes it (costmap_2d_publisher.cpp): on one topic the
whole grid (nav_msgs/OccupancyGrid), on another its changes (map_msgs/OccupancyGridUpdate). RViz's
map display takes the changes; Foxglove and rerun know whole grids only, so those are repeated while
the costmap changes.

Messages of one long array are joined from elements that were encoded once each: when a door
changes, the message with all doors is sent again, but only one door has other bytes. In CDR the
bytes depend on their offset in the message, modulo 8; so each element is kept for both offsets.
rosbags encodes them; here they are only concatenated.
"""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from semmap_log.analysis.costmap_2d.costs import bounds_of, to_occupancy
from semmap_log.analysis.costmap_2d.grid import CellWindow, GridGeometry
from semmap_log.core.model.doors import Corners, Door, DoorId, middle_of, reduced
from semmap_log.interop.formats.bags.bag_protocol import BagTopic, NewBag
from semmap_log.interop.formats.ros.ros_types import (
    DOOR_ENTRY,
    DOOR_MAP,
    GRID,
    GRID_UPDATE,
    MARKER,
    MARKERS,
    Messages,
    RosVersion,
    ros_types,
)

LEAVES, NAMES = "doors", "names"
"""Namespaces: the two can be switched off one by one."""

LEAF_HEIGHT_M = 2.0
LEAF_THICKNESS_M = 0.1
NAME_HEIGHT_M = 0.3
NAME_GAP_M = 0.35
"""From the door to the middle of a name south of it, or to the beginning of one east of it."""
LETTER_SHARE = 0.6
"""How wide a letter is, of its height: as in Foxglove's font; RViz's is a little narrower."""

_CUBE: Final = 1
_LINE: Final = 4
_TEXT: Final = 9
_ADD: Final = 0
_DELETE_ALL: Final = 3

Rgb = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class DoorLook:
    """What is drawn of a door; equal looks are drawn alike."""

    door_id: DoorId
    start: tuple[float, float]
    """Metres, frame `map`."""
    theta: float
    width: float
    z: float
    """The floor's height, metres."""
    label: str
    colour: Rgb
    text_colour: Rgb
    outline: Corners = ()
    """Of a polygon: its line on the floor is drawn, and no leaf."""


def is_drawn(door: Door) -> bool:
    """Return whether there is something to draw: all of its place is known, and is a number."""
    return door.is_placed and math.isfinite(sum(door.end))


class DoorMarkers:
    """Builds MarkerArrays."""

    def __init__(self, ros_version: RosVersion) -> None:
        self._messages = Messages(ros_version)
        self._type = ArrayType(ros_version, MARKERS, "markers", MARKER)
        self._delete_all = self._type.encoded(self._marker("", 0, _CUBE, _DELETE_ALL))

    def encoded(self, look: DoorLook) -> tuple[EncodedElement, ...]:
        """Return a door's markers."""
        return tuple(self._type.encoded(marker) for marker in self._of_door(look))

    def message(self, doors: Iterable[tuple[EncodedElement, ...]]) -> bytes:
        """Return the message that shows these doors, and nothing else."""
        return self._type.joined([self._delete_all, *(part for door in doors for part in door)])

    def _of_door(self, look: DoorLook) -> Iterator[Any]:
        (x, y), half = look.start, look.width / 2
        along = (half * math.cos(look.theta), half * math.sin(look.theta))
        middle = (x + along[0], y + along[1])
        marker_id = marker_id_of(look.door_id)
        if look.outline:
            middle, along = middle_of(look.outline), (0.0, 0.0)
            yield self._outline(look)
        else:
            yield self._marker(
                LEAVES, marker_id, _CUBE,
                pose=self._messages.pose(*middle, look.z + LEAF_HEIGHT_M / 2, look.theta),
                scale=(max(look.width, LEAF_THICKNESS_M), LEAF_THICKNESS_M, LEAF_HEIGHT_M),
                colour=look.colour,
            )  # fmt: skip
        name_at = _name_place(middle, along, look.label)
        yield self._marker(
            NAMES, marker_id, _TEXT,
            pose=self._messages.pose(*name_at, look.z + LEAF_HEIGHT_M),
            scale=(0.0, 0.0, NAME_HEIGHT_M),
            colour=look.text_colour,
            text=look.label,
        )  # fmt: skip

    def _outline(self, look: DoorLook) -> Any:
        point = partial(self._messages.new, "geometry_msgs/msg/Point", z=look.z)
        corners = [point(x=x, y=y) for x, y in look.outline]
        return self._marker(
            LEAVES, marker_id_of(look.door_id), _LINE,
            scale=(LEAF_THICKNESS_M, 0.0, 0.0),
            colour=look.colour,
            points=[*corners, corners[0]],
        )  # fmt: skip

    def _marker(
        self,
        namespace: str,
        marker_id: int,
        kind: int,
        action: int = _ADD,
        *,
        pose: Any = None,
        scale: tuple[float, float, float] = (1.0, 1.0, 1.0),
        colour: Rgb = (0, 0, 0),
        text: str = "",
        points: Sequence[Any] = (),
    ) -> Any:
        new = self._messages.new
        red, green, blue = (part / 255 for part in colour)
        return new(
            MARKER,
            header=self._messages.header(0),
            ns=namespace,
            id=marker_id,
            type=kind,
            action=action,
            pose=self._messages.pose(0.0, 0.0) if pose is None else pose,
            scale=new("geometry_msgs/msg/Vector3", x=scale[0], y=scale[1], z=scale[2]),
            color=new("std_msgs/msg/ColorRGBA", r=red, g=green, b=blue, a=1.0),
            lifetime=new("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
            frame_locked=True,
            points=list(points),
            colors=[],
            text=text,
            mesh_resource="",
            mesh_use_embedded_materials=False,
            **self._of_ros_2(),
        )

    def _of_ros_2(self) -> dict[str, Any]:
        """Return the fields that ROS 1's markers do not have, empty."""
        if self._messages.ros_version == 1:
            return {}
        new, nothing = self._messages.new, np.zeros(0, np.uint8)
        return {
            "texture_resource": "",
            "texture": new(
                "sensor_msgs/msg/CompressedImage",
                header=new("std_msgs/msg/Header", stamp=self._messages.stamp(0), frame_id=""),
                format="",
                data=nothing,
            ),
            "uv_coordinates": [],
            "mesh_file": new("visualization_msgs/msg/MeshFile", filename="", data=nothing),
        }


def _name_place(
    middle: tuple[float, float], along: tuple[float, float], label: str
) -> tuple[float, float]:
    """Return where the middle of a name is, so that from above it lies on no door and no wall.

    It stands south of a door that rather lies from west to east, else east of it: the wall goes on
    in the door's direction.

    Args:
        middle: The door's, metres.
        along: From there to the door's end, metres.
        label: The name.
    """
    (x, y), (east, north) = middle, along
    if abs(east) >= abs(north):
        return x, y - abs(north) - NAME_GAP_M
    half = len(label) * LETTER_SHARE * NAME_HEIGHT_M / 2
    return x + abs(east) + NAME_GAP_M + half, y


def marker_id_of(door_id: DoorId) -> int:
    """Return the marker's id, an int32: door ids beyond go on among the negative numbers."""
    return door_id - 2**32 if door_id >= 2**31 else int(door_id)


class ThesisMessages:
    """Builds DoorMaps: door after door of all levels, which the message knows nothing of."""

    def __init__(self, ros_version: RosVersion, default_prob: float | None) -> None:
        """Choose.

        Args:
            ros_version: Whose bytes.
            default_prob: Stands for a probability that was not given; None: NaN does.
        """
        self._messages = Messages(ros_version)
        self._type = ArrayType(ros_version, DOOR_MAP, "door_db", DOOR_ENTRY)
        self._default_prob = math.nan if default_prob is None else default_prob

    def encoded(self, door: Door) -> EncodedElement:
        """Return a door's entry; its state is OPEN, CLOSED or UNKNOWN."""
        return self._type.encoded(
            self._messages.new(
                DOOR_ENTRY,
                door_id=int(door.door_id),
                pos_x=door.x,
                pos_y=door.y,
                pos_theta=door.theta,
                width=door.width,
                door_state=reduced(door.state).name,
                prob_open=self._given(door.prob_open),
                prob_closed=self._given(door.prob_closed),
            )
        )

    def message(self, doors: Iterable[EncodedElement]) -> bytes:
        """Return the message with these entries."""
        return self._type.joined(doors)

    def _given(self, prob: float) -> float:
        return self._default_prob if math.isnan(prob) else prob


GRIDS = BagTopic("/semmap/costmap", GRID, is_latched=True)
UPDATES = BagTopic("/semmap/costmap_updates", GRID_UPDATE, is_latched=False)
"""RViz looks for the changes of a map under its topic's name and `_updates`."""


@dataclass(frozen=True, slots=True)
class GridFrame:
    """A costmap at a moment at which it changed."""

    at_ns: int
    costs: NDArray[np.uint8]
    """(height, width), row 0 at the lowest y; only valid until the next frame."""
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
    the last whole grid is at most that old.

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


_CDR_HEADER = b"\x00\x01\x00\x00"
_COUNT_BYTES = 4
_ALIGNMENT = 4
"""Of an element: it begins with a field of 4 bytes, such as a stamp or an id."""


@dataclass(frozen=True, slots=True)
class EncodedElement:
    """An encoded element."""

    at_0: bytes
    """As it is at a multiple of 8."""
    at_4: bytes
    """As it is 4 bytes after a multiple of 8."""


class ArrayType:
    """A message type with one field, an array; its elements begin with a field of 4 bytes."""

    def __init__(self, ros_version: RosVersion, array: str, field: str, element: str) -> None:
        """Name the types.

        Args:
            ros_version: Whose bytes.
            array: The message, such as `visualization_msgs/msg/MarkerArray`.
            field: Its only field.
            element: What that is an array of.
        """
        self._types = ros_types(ros_version)
        self._is_cdr = ros_version == 2
        self._array, self._field, self._element = array, field, element

    def encoded(self, element: Any) -> EncodedElement:
        """Return an element as bytes."""
        if not self._is_cdr:
            data = bytes(self._types.serialize_ros1(element, self._element))
            return EncodedElement(data, data)
        alone = self._types.serialize_cdr(element, self._element)
        one = self._types.types[self._array](**{self._field: [element]})
        after_count = self._types.serialize_cdr(one, self._array)
        skipped = len(_CDR_HEADER)
        return EncodedElement(bytes(alone[skipped:]), bytes(after_count[skipped + _COUNT_BYTES :]))

    def joined(self, parts: Iterable[EncodedElement]) -> bytes:
        """Return the message with these elements."""
        listed = list(parts)
        count = struct.pack("<I", len(listed))
        if not self._is_cdr:
            return count + b"".join([part.at_0 for part in listed])
        pieces, at = [_CDR_HEADER, count], _COUNT_BYTES
        for part in listed:
            gap = -at % _ALIGNMENT
            data = part.at_4 if (at + gap) % 8 else part.at_0
            pieces += [bytes(gap), data]
            at += gap + len(data)
        return b"".join(pieces)
