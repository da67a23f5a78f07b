"""Event <-> CDR bytes, one at a time."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from operator import attrgetter
from typing import Any

import numpy as np

from semmap_log.domain.events import KINDS, Event, FloorMap, event_of, field_names
from semmap_log.messages.layout import Layout, layout
from semmap_log.messages.typestore import OCCUPANCY_GRID, deserialize, serialize, type_name

OBJECT_KINDS: frozenset[int] = frozenset(
    kind.kind for kind in KINDS if not all(rule.dtype for rule in kind.rules.fields.values())
)
"""Kinds with text or arrays, read as objects; all others are read as columns."""


def ros_type(kind: int) -> str:
    """Return the ROS 2 type that carries events of that kind."""
    cls = KINDS[kind - 1]
    return OCCUPANCY_GRID if cls is FloorMap else type_name(cls.__name__)


@cache
def fixed_layout(kind: int) -> Layout:
    """Return the layout of a kind of fixed size."""
    return layout(KINDS[kind - 1].__name__)


@cache
def field_getter(kind: int) -> Callable[[Event], tuple[Any, ...]]:
    """Return what takes the field values out of an event of a fixed-size kind, in wire order."""
    names = fixed_layout(kind).fields
    getter = attrgetter(*names)
    return getter if len(names) > 1 else lambda event: (getter(event),)


def encode(event: Event, happened_ns: int) -> bytes:
    """Return the CDR bytes of an event; `happened_ns` stamps the header of a FloorMap."""
    if event.kind not in OBJECT_KINDS:
        fixed = fixed_layout(event.kind)
        return fixed.pack(*field_getter(event.kind)(event))
    if isinstance(event, FloorMap):
        return _encode_floor_map(event, happened_ns)
    names, values_of = _object_fields(event.kind)
    values = dict(zip(names, values_of(event), strict=True))
    if "salt" in values:
        values["salt"] = np.frombuffer(values["salt"] or bytes(16), np.uint8)
    return serialize(ros_type(event.kind), **values)


def decode(kind: int, data: bytes | memoryview, happened_ns: int | None, level: int = 0) -> Event:
    """Return the event that these CDR bytes hold.

    Args:
        kind: `Event.kind`.
        data: The CDR bytes.
        happened_ns: When it happened.
        level: The level of a FloorMap, which its channel tells.

    Raises:
        ValueError: The bytes are not such an event.
    """
    if kind not in OBJECT_KINDS:
        fixed = fixed_layout(kind)
        if len(data) != fixed.dtype.itemsize:
            raise ValueError(
                f"{fixed.name}: expected {fixed.dtype.itemsize} bytes, got {len(data)}"
            )
        return event_of(KINDS[kind - 1], fixed.unpack(data), happened_ns)
    message = deserialize(ros_type(kind), data)
    cls = KINDS[kind - 1]
    if cls is FloorMap:
        return _decode_floor_map(message, happened_ns, level)
    names, values_of = _object_fields(kind)
    values = dict(zip(names, values_of(message), strict=True))
    if "salt" in values:
        values["salt"] = bytes(values["salt"])
    return event_of(cls, values, happened_ns)


@cache
def _object_fields(kind: int) -> tuple[tuple[str, ...], Callable[[Any], tuple[Any, ...]]]:
    """Return the fields of a kind that is read as objects, and what takes their values out."""
    names = field_names(KINDS[kind - 1])
    getter = attrgetter(*names)
    return names, getter if len(names) > 1 else lambda each: (getter(each),)


def _encode_floor_map(event: FloorMap, happened_ns: int) -> bytes:
    from semmap_log.messages.typestore import typestore

    types = typestore().types
    stamp = types["builtin_interfaces/msg/Time"](
        sec=min(happened_ns // 10**9, 2**31 - 1), nanosec=happened_ns % 10**9
    )
    height, width = event.cells.shape
    half = event.origin_theta / 2
    origin = types["geometry_msgs/msg/Pose"](
        position=types["geometry_msgs/msg/Point"](x=event.origin_x, y=event.origin_y, z=0.0),
        orientation=types["geometry_msgs/msg/Quaternion"](
            x=0.0, y=0.0, z=math.sin(half), w=math.cos(half)
        ),
    )
    info = types["nav_msgs/msg/MapMetaData"](
        map_load_time=stamp, resolution=event.resolution, width=width, height=height, origin=origin
    )
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="map")
    cells = np.ascontiguousarray(event.cells).reshape(-1)
    return serialize(OCCUPANCY_GRID, header=header, info=info, data=cells)


def _decode_floor_map(message: Any, happened_ns: int | None, level: int) -> FloorMap:
    info = message.info
    turn = info.origin.orientation
    return FloorMap(
        happened_ns=happened_ns,
        level=level,
        resolution=info.resolution,
        origin_x=info.origin.position.x,
        origin_y=info.origin.position.y,
        origin_theta=_angle_of(turn.z, turn.w),
        cells=message.data.reshape(info.height, info.width),
    )


def _angle_of(z: float, w: float) -> float:
    """Return the angle about z of a quaternion: where there is one, that which packs to it again.

    The arc tangent may be a bit beside it; a map that is copied from log to log must not turn.
    """
    angle = below = above = 2 * math.atan2(z, w)
    for _ in range(BITS_BESIDE):
        below, above = math.nextafter(below, -math.inf), math.nextafter(above, math.inf)
        for near in (angle, below, above):
            if (math.sin(near / 2), math.cos(near / 2)) == (z, w):
                return near
    return angle


BITS_BESIDE = 2
"""So many floats on either side are tried: enough for every angle from -pi to pi."""
