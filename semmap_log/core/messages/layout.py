"""Where each field of a fixed-size message lies in its CDR bytes, read off the `.msg` text.

CDR (XCDR1, little endian, as ROS 2 writes it): four bytes of encapsulation, then the fields in
order, each aligned to its own size, counted from the end of those four bytes. A message without
strings and unbounded arrays therefore always has one size, and n of them are one numpy array.

Also converts single events to CDR bytes and back; and what rosbag2 expects of a file of messages.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from operator import attrgetter
from typing import Any

import numpy as np

from semmap_log.core.messages import type_hash
from semmap_log.core.model.events import KINDS, Event, FloorMap, event_of, field_names

OBJECT_KINDS: frozenset[int] = frozenset(
    kind.kind for kind in KINDS if not all(rule.dtype for rule in kind.rules.fields.values())
)
"""Kinds with text or arrays, read as objects; all others are read as columns."""


def ros_type(kind: int) -> str:
    """Return the ROS 2 type that carries events of that kind."""
    cls = KINDS[kind - 1]
    return type_hash.OCCUPANCY_GRID if cls is FloorMap else type_hash.type_name(cls.__name__)


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


@cache
def field_getters(kind: int) -> tuple[Callable[[Event], Any], ...]:
    """Return the same as one for each field: of many events, a field at a time is taken faster."""
    return tuple(map(attrgetter, fixed_layout(kind).fields))


def encode(event: Event, happened_ns: int) -> bytes:
    """Return the CDR bytes of an event; `happened_ns` stamps the header of a FloorMap."""
    if event.kind not in OBJECT_KINDS:
        fixed = fixed_layout(event.kind)
        return fixed.pack(*field_getter(event.kind)(event))
    if isinstance(event, FloorMap):
        return type_hash.write_message(
            type_hash.OCCUPANCY_GRID, _floor_map_fields(event, happened_ns)
        )
    values = {name: getattr(event, name) for name in field_names(type(event))}
    if "salt" in values:
        values["salt"] = values["salt"] or bytes(16)
    return type_hash.write_message(ros_type(event.kind), values)


def decode(kind: int, data: bytes | memoryview, happened_ns: int | None, level: int = 0) -> Event:
    """Return the event that these CDR bytes hold.

    Args:
        kind: `Event.kind`.
        data: The CDR bytes.
        happened_ns: When it happened.
        level: The level of a FloorMap, which its channel states.

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
    values = type_hash.read_message(
        ros_type(kind), bytes(data)
    )  # a copy: its arrays outlive the file
    cls = KINDS[kind - 1]
    if cls is FloorMap:
        return _floor_map(values, happened_ns, level)
    if "salt" in values:
        values["salt"] = bytes(values["salt"])
    return event_of(cls, values, happened_ns)


def _floor_map_fields(event: FloorMap, happened_ns: int) -> dict[str, Any]:
    height, width = event.cells.shape
    half = event.origin_theta / 2
    sec, nanosec = min(happened_ns // 10**9, 2**31 - 1), happened_ns % 10**9
    return {
        "header.stamp.sec": sec,
        "header.stamp.nanosec": nanosec,
        "header.frame_id": "map",
        "info.map_load_time.sec": sec,
        "info.map_load_time.nanosec": nanosec,
        "info.resolution": event.resolution,
        "info.width": width,
        "info.height": height,
        "info.origin.position.x": event.origin_x,
        "info.origin.position.y": event.origin_y,
        "info.origin.position.z": 0.0,
        "info.origin.orientation.x": 0.0,
        "info.origin.orientation.y": 0.0,
        "info.origin.orientation.z": math.sin(half),
        "info.origin.orientation.w": math.cos(half),
        "data": np.ravel(event.cells),
    }


def _floor_map(values: dict[str, Any], happened_ns: int | None, level: int) -> FloorMap:
    turn = (values["info.origin.orientation.z"], values["info.origin.orientation.w"])
    return FloorMap(
        happened_ns=happened_ns,
        level=level,
        resolution=values["info.resolution"],
        origin_x=values["info.origin.position.x"],
        origin_y=values["info.origin.position.y"],
        origin_theta=_angle_of(*turn),
        cells=values["data"].reshape(values["info.height"], values["info.width"]),
    )


def _angle_of(z: float, w: float) -> float:
    """Return the angle about z of a quaternion: if possible, one that packs to it again.

    The arc tangent may be off by a bit; a map that is copied from log to log must not turn.
    """
    angle = below = above = 2 * math.atan2(z, w)
    for _ in range(NEXT_FLOATS):
        below, above = math.nextafter(below, -math.inf), math.nextafter(above, math.inf)
        for near in (angle, below, above):
            if (math.sin(near / 2), math.cos(near / 2)) == (z, w):
                return near
    return angle


NEXT_FLOATS = 2
"""So many floats on either side are tried: enough for every angle from -pi to pi."""


@dataclass(frozen=True, slots=True)
class Layout:
    """The bytes of a fixed-size message, encapsulation included."""

    name: str
    fields: tuple[str, ...]
    dtype: np.dtype[np.void]
    """`itemsize` is the size of the CDR bytes; padding belongs to no field."""
    packer: struct.Struct
    """Packs the field values in order; byte arrays as `bytes`."""

    def pack(self, *values: Any) -> bytes:
        """Return the CDR bytes of these field values, in the order of `fields`."""
        return self.packer.pack(type_hash.CDR_HEADER, *values)

    def packer_after(self, prefix: struct.Struct, count: int = 1) -> struct.Struct:
        """Return what packs such a message together with fixed fields before it, in one call.

        Args:
            prefix: What comes first, little endian, such as a record's head.
            count: How many such pairs it packs in a row.
        """
        one = prefix.format.removeprefix("<") + self.packer.format.removeprefix("<")
        return struct.Struct("<" + count * one)

    def unpack(self, data: bytes | memoryview, offset: int = 0) -> dict[str, Any]:
        """Return the field values of the CDR bytes at `offset`."""
        return dict(zip(self.fields, self.packer.unpack_from(data, offset)[1:], strict=True))

    def behind(self, prefix: np.dtype[np.void]) -> np.dtype[np.void]:
        """Return the dtype of such a message that follows other fixed fields, such as a record's.

        Args:
            prefix: What comes first; its fields keep their names and offsets.
        """
        assert prefix.fields is not None
        assert self.dtype.fields is not None
        both = {name: spec[:2] for name, spec in prefix.fields.items()}
        for name, spec in self.dtype.fields.items():
            both[name] = (spec[0], prefix.itemsize + spec[1])
        return np.dtype(
            {
                "names": list(both),
                "formats": [spec[0] for spec in both.values()],
                "offsets": [spec[1] for spec in both.values()],
                "itemsize": prefix.itemsize + self.dtype.itemsize,
            }
        )


@cache
def layout(name: str) -> Layout:
    """Return the layout of one of our messages.

    Raises:
        ValueError: The message has a field without a fixed size.
    """
    names: list[str] = []
    formats: list[Any] = []
    offsets: list[int] = []
    codes = f"<{len(type_hash.CDR_HEADER)}s"
    end = 0
    for field in type_hash.flat_fields(type_hash.type_name(name)):
        if field.type not in type_hash.CODES or field.count == 0:
            raise ValueError(f"{name}.msg: no fixed size: {field.name}")
        code, size = type_hash.CODES[field.type]
        padding = -end % size
        count = field.count or 1
        names.append(field.name)
        formats.append((f"<{code}", (count,)) if field.count else f"<{code}")
        offsets.append(len(type_hash.CDR_HEADER) + end + padding)
        codes += "x" * padding + (f"{count}s" if field.count else code)
        end += padding + count * size
    dtype = np.dtype(
        {
            "names": names,
            "formats": formats,
            "offsets": offsets,
            "itemsize": len(type_hash.CDR_HEADER) + end,
        }
    )
    return Layout(name, tuple(names), dtype, struct.Struct(codes))


PROFILE = "ros2"
LIBRARY = "semmap-log"
BAG_METADATA_NAME = "metadata.yaml"
VOLATILE, TRANSIENT_LOCAL = "volatile", "transient_local"


def offered_qos(durability: str) -> str:
    """Return a channel's QoS as rosbag2 writes it, one block for all topics.

    In words, as version 9 has it: it takes a number for an unknown policy (rosbag2_storage/qos.cpp)
    and would play nothing. rosbags drops, in silence, a file whose channel and metadata.yaml differ
    here: both are written from this text.
    """
    infinite = "{sec: 9223372036, nsec: 854775807}"
    return (
        f"- {{history: keep_last, depth: 10, reliability: reliable, durability: {durability}, "
        f"deadline: {infinite}, lifespan: {infinite}, liveliness: automatic, "
        f"liveliness_lease_duration: {infinite}, avoid_ros_namespace_conventions: false}}"
    )
