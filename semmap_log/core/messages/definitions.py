"""Our messages as their `.msg` texts define them: texts, fields, and the types that these name."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType

from semmap_log.core.lazy.late_dataclass import dataclass
from semmap_log.core.lazy.lazily import late_pattern
from semmap_log.core.model.meaning import REGISTERS

PACKAGE = "semmap_msgs"
OCCUPANCY_GRID = "nav_msgs/msg/OccupancyGrid"
"""A floor map is ROS's own message; its text, with those of all that it holds, is shipped, too."""

CODES = {
    "bool": ("?", 1), "uint8": ("B", 1), "int8": ("b", 1), "uint16": ("H", 2), "int16": ("h", 2),
    "uint32": ("I", 4), "int32": ("i", 4), "uint64": ("Q", 8), "int64": ("q", 8),
    "float32": ("f", 4), "float64": ("d", 8),
}  # fmt: skip
"""ROS primitive -> struct code, which is also numpy's, and size in bytes."""

_TEXTS = Path(__file__).with_name("msg")

_FIELD = late_pattern(r"^(?P<type>[\w/]+)(?P<array>\[(?P<count>\d*)\])? +(?P<name>\w+) *(#.*)?$")
_COMMENTED = late_pattern(r"^[\w/\[\]]+ +(\w+) *(?:# *(.*))?$")
_CONSTANT = late_pattern(r"^\w+ \w+=\S+\s*(#.*)?$")
_NEXT = late_pattern(r"^=+\nMSG: (\S+)\n", re.MULTILINE)
"""What stands before the text of a message that another one holds."""

ROS_NAMES = {"u1": "uint8", "u2": "uint16", "u4": "uint32", "f8": "float64"}
"""Numpy type of a door's field -> ROS's name for it."""


@dataclass(frozen=True, slots=True)
class MessageField:
    """A line of a `.msg` text."""

    name: str
    type: str
    """A primitive of ROS, or the full name of a message."""
    count: int | None = None
    """Elements of an array; 0: any number; None: it is no array."""


def type_name(message: str) -> str:
    """Return the full ROS 2 name of one of our messages."""
    return f"{PACKAGE}/msg/{message}"


@cache
def message_text(name: str) -> str:
    """Return the `.msg` text of one of our messages, as shipped and as written into each log."""
    text = (_TEXTS / f"{name}.msg").read_text(encoding="ascii")
    return text.replace("@REGISTERS@\n", "".join(_register_lines())) if "@" in text else text


def schema_text(ros_type: str) -> str:
    """Return the `ros2msg` text of a type with those of all that it holds."""
    return message_text(ros_type.rpartition("/")[2])


@cache
def comments_of(name: str) -> Mapping[str, str]:
    """Return what the `.msg` text of one of our messages says of each field; "": nothing."""
    found = (_COMMENTED.match(line) for line in message_text(name).splitlines())
    return MappingProxyType({match[1]: match[2] or "" for match in found if match})


@cache
def definitions(ros_type: str) -> Mapping[str, tuple[MessageField, ...]]:
    """Return the fields of a type, then of each that it holds, by their full names.

    Raises:
        ValueError: A line of its text is none of a `.msg`.
    """
    own, *rest = _NEXT.split(schema_text(ros_type))
    texts = {ros_type: own} | {
        _full_name(name): text for name, text in zip(rest[::2], rest[1::2], strict=True)
    }
    return MappingProxyType({name: tuple(_fields(name, text)) for name, text in texts.items()})


@cache
def flat_fields(ros_type: str) -> tuple[MessageField, ...]:
    """Return a type's fields as they follow each other in the bytes, such as `header.stamp.sec`.

    Raises:
        ValueError: It holds an array of messages.
    """
    return tuple(_flattened(definitions(ros_type), ros_type, ""))


def _flattened(
    known: Mapping[str, tuple[MessageField, ...]], ros_type: str, prefix: str
) -> Iterator[MessageField]:
    for field in known[ros_type]:
        name = f"{prefix}{field.name}"
        if field.type not in known:
            yield MessageField(name, field.type, field.count)
        elif field.count is None:
            yield from _flattened(known, field.type, f"{name}.")
        else:
            raise ValueError(f"{ros_type}: {name} is an array of messages, which no event has.")


def _fields(ros_type: str, text: str) -> Iterator[MessageField]:
    for line in text.splitlines():
        if not line.strip() or line.startswith("#") or _CONSTANT.match(line):
            continue
        match = _FIELD.match(line)
        if match is None:
            raise ValueError(f"{ros_type}: no line of a .msg: {line!r}")
        count = int(match["count"] or 0) if match["array"] else None
        yield MessageField(match["name"], _full_name(match["type"]), count)


def _full_name(name: str) -> str:
    """Return `std_msgs/msg/Header` for `std_msgs/Header`; a primitive's name as it is."""
    package, slash, message = name.rpartition("/")
    return f"{package}/msg/{message}" if slash else message


def _register_lines() -> Iterator[str]:
    """Yield the lines of Keyframe that hold what is known of doors: values, and their stamps."""
    for register, fields in REGISTERS.items():
        for name, dtype in fields.items():
            yield f"{ROS_NAMES[dtype]}[] {name}\n"
        yield f"int64[] {register}_happened_ns\n"
        yield f"int64[] {register}_event\n"
