"""Doors as markers of RViz, Foxglove and Lichtblick: a leaf in the state's colour, and its name.

Every message is the whole truth about its topic: first a marker that deletes all, then those of
all doors. For where a player jumps to, Foxglove and Lichtblick take away all markers and load the
last message of each topic, that one alone (Lichtblick's `Renderer.handleSeek` and
`McapIndexedIterableSource.getBackfillMessages`); of messages that tell changes they would show
the last change. And RViz, where a bag is played from an earlier time, deletes nothing by itself.

The markers' stamps are 0, and they are frame-locked: good at any time, however old.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from semmap_log.core.model.doors import Door, DoorId
from semmap_log.core.model.object_classes import Corners, middle_of
from semmap_log.interop.formats.ros.array_messages import ArrayType, EncodedElement
from semmap_log.interop.formats.ros.ros_messages import Messages
from semmap_log.interop.formats.ros.ros_types import MARKER, MARKERS, RosVersion

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
    """Tell whether there is something to draw: all of its place is known, and is a number."""
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
