"""RIHS01, the hash by which ROS 2 decides whether two types of one name are the same (REP 2016).

Also our messages as their `.msg` texts define them: texts, fields, and the types that these name;
and messages with texts and arrays <-> CDR bytes, field by field.

XCDR1, little endian, as ROS 2 writes it: numbers are aligned to their own size, counted from the
end of the encapsulation; a text is its length, including the final zero, and its bytes; an array of
any size begins with its length. The bytes are those that rosbags reads and writes, which is the
oracle in the tests. Here arrays are views, nothing is generated, and nothing heavy is imported: a
moment of the past needs one Keyframe, with hundreds of doors in columns, in under a millisecond.
"""

from __future__ import annotations

import hashlib
import json
import re
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from semmap_log.core.lazily import computed_once, late_pattern
from semmap_log.core.model.meaning import REGISTERS

_TYPE_IDS = {
    "int8": 2, "uint8": 3, "int16": 4, "uint16": 5, "int32": 6, "uint32": 7, "int64": 8,
    "uint64": 9, "float32": 10, "float64": 11, "bool": 15, "string": 17,
}  # fmt: skip
"""As type_description_interfaces/msg/FieldType numbers them."""
_MESSAGE_ID = 1
_OF_FIXED_SIZE = 48
_OF_ANY_SIZE = 144
"""Added for arrays."""


@cache
def type_hash(ros_type: str) -> str:
    """Return the RIHS01 hash of one of the types that a log holds."""
    known = {
        name: {"type_name": name, "fields": [_field(field) for field in fields]}
        for name, fields in definitions(ros_type).items()
    }
    described = {
        "type_description": known[ros_type],
        "referenced_type_descriptions": [known[name] for name in sorted(known.keys() - {ros_type})],
    }
    return f"RIHS01_{hashlib.sha256(json.dumps(described).encode()).hexdigest()}"


def _field(field: MessageField) -> dict[str, Any]:
    of_array = 0 if field.count is None else _OF_FIXED_SIZE if field.count else _OF_ANY_SIZE
    is_message = field.type not in _TYPE_IDS
    return {
        "name": field.name,
        "type": {
            "type_id": of_array + _TYPE_IDS.get(field.type, _MESSAGE_ID),
            "capacity": field.count or 0,
            "string_capacity": 0,
            "nested_type_name": field.type if is_message else "",
        },
    }


CDR_HEADER = b"\x00\x01\x00\x00"
"""Representation identifier CDR_LE and no options."""

MOST_PADDING = 3
"""Padding after the last field: some writers fill up to four bytes."""

_LENGTH = struct.Struct("<I")

Read: TypeAlias = Callable[[memoryview, int], tuple[Any, int]]
"""A field's value at a place, and where the next one begins."""
Write: TypeAlias = Callable[[bytearray, Any], None]


def read_message(ros_type: str, data: bytes | memoryview) -> dict[str, Any]:
    """Return the fields of a message: numbers, arrays, texts, lists of texts.

    Args:
        ros_type: Its type; fields of messages that it holds are called `header.stamp.sec`.
        data: Its CDR bytes; the arrays are views of them.

    Raises:
        ValueError: The bytes are not such a message.
    """
    if bytes(data[: len(CDR_HEADER)]) != CDR_HEADER:
        raise ValueError(f"not a {ros_type}: its encapsulation is {bytes(data[:4]).hex()}")
    body = memoryview(data)[len(CDR_HEADER) :]
    values: dict[str, Any] = {}
    at: int | Texts = 0
    try:
        for name, read in _readers(ros_type):
            if read is None:
                values[name] = at = Texts(body, at)
            else:
                values[name], at = read(body, at if isinstance(at, int) else at.end)
    except (struct.error, IndexError, ValueError) as error:
        raise ValueError(f"not a {ros_type}: {error}") from error
    if isinstance(at, int) and at + MOST_PADDING < len(body):
        raise ValueError(f"not a {ros_type}: {len(body) - at} bytes after its end")
    return values


def write_message(ros_type: str, values: Mapping[str, Any]) -> bytes:
    """Return the CDR bytes of a message.

    Args:
        ros_type: Its type.
        values: Each field's value; an array of bytes as `bytes` or numpy's.

    Raises:
        ValueError: A field cannot have its value.
    """
    data = bytearray()
    name = ""
    try:
        for name, write in _writers(ros_type):  # for the message
            write(data, values[name])
    except (struct.error, AttributeError, OverflowError, TypeError, ValueError) as error:
        raise ValueError(f"{ros_type}: {name}: {error}") from error
    return CDR_HEADER + bytes(data)


class Texts(Sequence[str]):
    """An array of texts; parsed when one of them, or what follows it, is requested.

    The first use raises ValueError if these bytes are not such an array.
    """

    def __init__(self, body: memoryview, start: int | Texts) -> None:
        """Take note of where they are.

        Args:
            body: The message without its encapsulation.
            start: Where they begin; or the texts that they follow.
        """
        self._body = body
        self._start = start

    def __getitem__(self, i: Any) -> Any:
        return self._walked[0][i]

    def __len__(self) -> int:
        return len(self._walked[0])

    @property
    def end(self) -> int:
        """Where the next field begins."""
        return self._walked[1]

    @computed_once
    def _walked(self) -> tuple[list[str], int]:
        body, start = self._body, self._start
        texts = []
        try:
            count, at = _read_length(body, start if isinstance(start, int) else start.end)
            for _ in range(count):  # inline: a map of 500 doors has a thousand texts
                at += -at & 3
                begin = at + 4
                at = begin + int.from_bytes(body[at:begin], "little")
                texts.append(str(body[begin : at - 1], "utf-8"))
                if body[at - 1]:
                    raise ValueError("a text that does not end")
        except (IndexError, struct.error):
            raise ValueError("texts that reach beyond the end") from None
        return texts, at


@cache
def _readers(ros_type: str) -> tuple[tuple[str, Read | None], ...]:
    """Return each field with what reads it; None: texts, which are walked when they are wanted."""
    return tuple((field.name, _reader(field)) for field in flat_fields(ros_type))


def _reader(field: MessageField) -> Read | None:
    if field.type == "string":
        return _read_text if field.count is None else None
    if field.count is None:
        return partial(_read_number, struct.Struct("<" + CODES[field.type][0]))
    return partial(_read_array, np.dtype("<" + CODES[field.type][0]), field.count)


def _read_number(packed: struct.Struct, body: memoryview, at: int) -> tuple[Any, int]:
    at += -at % packed.size
    return packed.unpack_from(body, at)[0], at + packed.size


_read_length = partial(_read_number, _LENGTH)


def _read_text(body: memoryview, at: int) -> tuple[str, int]:
    at += -at & 3
    begin = at + 4
    end = begin + int.from_bytes(body[at:begin], "little")
    if end == begin or end > len(body) or body[end - 1]:
        raise ValueError("a text that does not end")
    return str(body[begin : end - 1], "utf-8"), end


def _read_array(
    dtype: np.dtype[Any], count: int, body: memoryview, at: int
) -> tuple[np.ndarray[Any, Any], int]:
    """Read `count` numbers, or as many as stand before them if it is 0."""
    if not count:
        count, at = _read_length(body, at)
    if not count:
        return np.empty(0, dtype), at
    at += -at % dtype.itemsize
    return np.frombuffer(body, dtype, count, at), at + count * dtype.itemsize


@cache
def _writers(ros_type: str) -> tuple[tuple[str, Write], ...]:
    return tuple((field.name, _writer(field)) for field in flat_fields(ros_type))


def _writer(field: MessageField) -> Write:
    if field.type == "string":
        return _write_text if field.count is None else _write_texts
    if field.count is None:
        return partial(_write_number, struct.Struct("<" + CODES[field.type][0]))
    return partial(_write_array, np.dtype("<" + CODES[field.type][0]), field.count)


def _write_number(packed: struct.Struct, data: bytearray, value: Any) -> None:
    _align(data, packed.size)
    data += packed.pack(value)


_write_length = partial(_write_number, _LENGTH)


def _write_text(data: bytearray, text: str) -> None:
    said = text.encode()
    _write_length(data, len(said) + 1)
    data += said
    data.append(0)


def _write_texts(data: bytearray, texts: Sequence[str]) -> None:
    _write_length(data, len(texts))
    for text in texts:
        _write_text(data, text)


def _write_array(dtype: np.dtype[Any], count: int, data: bytearray, values: Any) -> None:
    is_bytes = isinstance(values, bytes)
    array = np.frombuffer(values, dtype) if is_bytes else np.asarray(values, dtype)
    if not count:
        _write_length(data, len(array))
    elif len(array) != count:
        raise ValueError(f"expected {count} elements, got {len(array)}")
    if len(array):
        _align(data, dtype.itemsize)
        data += array.tobytes()


def _align(data: bytearray, size: int) -> None:
    data += bytes(-len(data) % size)


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
        ValueError: A line of its text is not valid in a `.msg`.
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
